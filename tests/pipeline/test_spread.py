import pytest
import torch
from draws import normal

from geneoh.pipeline.spread import (
    ALONE,
    CHANGED,
    DIFFERENCE_FILTER,
    ERROR_RATIO,
    LOST,
    UNCHANGED_SHARE,
    joint_spread,
)
from geneoh.sequence import windows


def test_samples_that_agree_leave_no_doubt():
    assert float(joint_spread(torch.ones(2, 4, 21, 3)).max()) == 0


def test_the_spread_is_the_scaled_deviation_over_samples():
    samples = 0.004 * normal(2000, 1, 21, 3).expand(-1, 3, -1, -1).clone()
    samples[:, :, 4] *= 2
    expected = torch.full((3, 21), ERROR_RATIO * 0.004 * 3**0.5)
    expected[:, 4] *= 2
    torch.testing.assert_close(joint_spread(samples), expected, atol=0, rtol=0.05)


def test_a_hand_that_is_cleaned_by_itself_is_less_sure():
    samples = 0.004 * normal(4, 3, 21, 3)
    found = joint_spread(samples, alone=torch.tensor([0.0, 0.5, 1.0]))
    share = torch.tensor([1.0, (1 + ALONE) / 2, ALONE])[:, None]
    torch.testing.assert_close(found, share * joint_spread(samples))


def test_a_hand_that_is_hardly_changed_is_surer():
    samples = 0.004 * normal(4, 9, 21, 3)
    mean, usual = samples.mean(0), joint_spread(samples)
    shift = torch.tensor([1.0, 0.0, 0.0])
    for change, share in ((0.0, UNCHANGED_SHARE), (CHANGED, (1 + UNCHANGED_SHARE) / 2), (1.0, 1.0)):
        found = joint_spread(samples, given=mean + change * shift)
        torch.testing.assert_close(found, share**0.5 * usual, atol=0, rtol=1e-3)


def test_the_change_counts_around_a_frame():
    samples = 0.004 * normal(4, 300, 21, 3)
    given = samples.mean(0).clone()
    given[150:] += 0.1
    share = joint_spread(samples, given=given) / joint_spread(samples)
    assert float(share[:100].max()) < 1.1 * UNCHANGED_SHARE**0.5
    assert float(share[150:].min()) > 0.99


def test_frames_that_were_filled_in_or_cleaned_alone_are_no_surer():
    samples = 0.004 * normal(4, 5, 21, 3)
    observed, alone = torch.tensor([True, False, True, True, True]), torch.zeros(5)
    alone[3] = 1
    settings = {"alone": alone, "observed": observed}
    found = joint_spread(samples, given=samples.mean(0), **settings)
    surer = (found / joint_spread(samples, **settings)).mean(-1)
    share = UNCHANGED_SHARE**0.5
    torch.testing.assert_close(surer, torch.tensor([share, 1, share, 1, share]))


@pytest.mark.parametrize("lost", [0, 1, 30])
def test_a_lost_hand_is_less_sure_the_longer_it_was_not_seen(lost):
    samples = 0.004 * normal(4, lost + 3, 21, 3)
    observed = torch.ones(lost + 3, dtype=torch.bool)
    observed[2 : lost + 2] = False
    grown = joint_spread(samples, observed=observed) / joint_spread(samples)
    times = torch.arange(1, lost + 1) / 30
    share = torch.ones(lost + 3, 1)
    share[2 : lost + 2] += LOST * torch.minimum(times, times.flip(0))[:, None]
    torch.testing.assert_close(grown, share.expand(-1, 21))


def test_a_common_motion_is_no_disagreement():
    samples = 0.004 * normal(4, 1, 21, 3) + torch.linspace(0, 1, 9)[:, None, None]
    still = joint_spread(samples - samples.mean(0))
    torch.testing.assert_close(joint_spread(samples), still, atol=1e-6, rtol=0)


def test_disagreement_that_comes_and_goes_hardly_counts():
    frames = 200
    shaking = joint_spread(0.004 * normal(50, frames, 21, 3))[50:150].square().mean().sqrt()
    # a Gaussian filter leaves 1 / (2 sqrt(pi) deviation) of the variance of white noise
    left = (2 * torch.pi**0.5 * DIFFERENCE_FILTER) ** -0.5
    torch.testing.assert_close(
        shaking, torch.tensor(ERROR_RATIO * 0.004 * 3**0.5 * left), atol=0, rtol=0.1
    )


def test_blocks_of_a_long_track_have_the_spread_of_the_whole(monkeypatch):
    samples = 0.004 * normal(4, 700, 21, 3)
    monkeypatch.setattr(windows, "BLOCK", 700)
    given = samples.mean(0) + 0.01 * normal(700, 21, 3)
    whole = joint_spread(samples, given=given)
    monkeypatch.setattr(windows, "BLOCK", 200)
    torch.testing.assert_close(joint_spread(samples, given=given), whole, atol=1e-7, rtol=0)
