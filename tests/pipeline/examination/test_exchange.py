"""Two hands that are exchanged in some frames, or are one and the same."""

from dataclasses import replace

import pytest
import torch

from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.examination.exchange import with_frames_of, without_exchange
from geneoh.readers.checks.convention import doubts
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import HandTrack, Sequence


def keys(hand: HandTrack, joints: torch.Tensor) -> HandTrack:
    """A hand of keypoints alone."""
    return HandTrack(hand.side, hand.valid, joints=joints)


def exchanged(pair: Sequence, frames: torch.Tensor) -> Sequence:
    """The pair with its hands exchanged in some frames."""
    one, other = pair.hands
    hands = (with_frames_of(one, other, frames), with_frames_of(other, one, frames))
    return replace(pair, hands=hands)


def noisy(pair: Sequence, noise: str) -> Sequence:
    if noise == "clean":
        return pair
    return corrupt_sequence(pair, noise, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("noise", ["clean", "gauss_strong", "camera"])
@pytest.mark.parametrize(("start", "stop"), [(50, 51), (50, 100), (20, 146)])
def test_exchanged_hands_are_put_right(pair, noise, start, stop):
    truth = noisy(pair, noise)
    frames = (torch.arange(146) >= start) & (torch.arange(146) < stop)
    found, said = without_exchange(exchanged(truth, frames))
    for hand, true in zip(found.hands, truth.hands, strict=True):
        torch.testing.assert_close(hand.joints, true.joints, equal_nan=True, rtol=0, atol=0)
    count = "1 frame" if stop == start + 1 else f"{stop - start} frames"
    assert said == (
        f"the left and the right hand are exchanged in {count}: each got what the other had",
    )


def test_hands_of_which_one_has_lost_a_keypoint_are_put_right(pair):
    given = exchanged(pair, (torch.arange(146) >= 50) & (torch.arange(146) < 100))
    sure = torch.ones(146, 21)
    sure[60, 8] = 0.0
    lost = replace(given.hands[0], confidence=sure)
    found, said = without_exchange(replace(given, hands=(lost, given.hands[1])))
    assert said
    for hand, true in zip(found.hands, pair.hands, strict=True):
        assert torch.equal(hand.joints, true.joints)
    assert float(found.hands[1].confidence[60, 8]) == 0
    assert float(found.hands[0].confidence.min()) == 1


def test_exchanged_hands_keep_their_own_scale_of_confidence(pair):
    frames = (torch.arange(146) >= 50) & (torch.arange(146) < 100)
    levels = zip(exchanged(pair, frames).hands, (0.9, 0.1), strict=True)
    hands = tuple(replace(hand, confidence=torch.full((146, 21), sure)) for hand, sure in levels)
    found, said = without_exchange(replace(pair, hands=hands))
    assert said
    assert all(bool((hand.trust == 1).all()) for hand in found.hands)


@pytest.mark.parametrize("noise", ["clean", "gauss_strong", "bias", "drift", "drop", "camera"])
def test_other_hands_stay_as_they_are(pair, noise):
    given = noisy(pair, noise)
    found, said = without_exchange(given)
    assert found is given
    assert said == ()


def test_hands_of_the_wrong_sides_in_all_frames_are_not_exchanged(pair):
    given = exchanged(pair, torch.ones(146, dtype=torch.bool))
    assert without_exchange(given) == (given, ())
    (said,) = doubts(given, "both")
    assert "exchange the two names" in said  # --side would read the other one, as wrong


def test_one_hand_under_two_names_is_told(pair):
    left, right = pair.hands
    given = replace(pair, hands=(left, keys(right, left.joints)))
    found, said = without_exchange(given)
    assert found is given
    assert any("in one place in 146 of 146 frames" in words for words in said)


def test_the_cleaner_puts_exchanged_hands_right(pair):
    cut = pair[:60]
    frames = torch.arange(60) >= 30
    result = denoise(exchanged(cut, frames), preset="fast")
    assert any("exchanged in 30 frames" in words for words in result.doubts)
    for hand, true in zip(result.sequence.hands, cut.hands, strict=True):
        assert (hand.joints - true.joints).norm(dim=-1).mean() < 0.01
        assert not result.hands[hand.side].filled.any()
