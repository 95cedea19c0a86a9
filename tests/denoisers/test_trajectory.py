from dataclasses import replace

import pytest
import torch

from geneoh.denoisers.base import HAND_SCALE, NOISE_SCALE
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.geometry.rotations import axis_angle_to_matrix

TINY = TrajectoryConfig(width=16, depth=1, heads=2)


@pytest.fixture(scope="module")
def model(wake):
    return wake(TrajectoryDenoiser(TINY))


@pytest.mark.parametrize("frames", [1, 2, 7])
def test_clean_keypoints_have_the_shape_of_the_noisy_ones(model, draw, make_observation, frames):
    x = draw(2, frames, 21, 3)
    got = model(x, torch.tensor([0.1, 0.02]), make_observation(frames=frames))
    assert got.shape == x.shape
    assert bool(got.isfinite().all())


@pytest.mark.parametrize(("given", "scale"), [(1.0, NOISE_SCALE), (0.0, HAND_SCALE)])
def test_an_untrained_network_is_the_skip_path(draw, make_observation, given, scale):
    seen = make_observation(given=given)
    x, sigma = 0.1 * draw(2, 4, 21, 3), torch.tensor([0.03, 0.2])
    with torch.no_grad():
        got = TrajectoryDenoiser(TINY)(x, sigma, seen)
    keep = (scale**2 / (scale**2 + sigma**2))[:, None, None, None]
    anchor = seen.joints * given
    torch.testing.assert_close(got, anchor + keep * (x - anchor))


def test_an_almost_clean_hand_comes_back(model, draw, make_observation):
    x = 0.1 * draw(2, 4, 21, 3)
    got = model(x, torch.full((2,), 1e-6), make_observation())
    torch.testing.assert_close(got, x, atol=1e-4, rtol=0)


def test_a_withheld_observation_does_not_matter(model, draw, make_observation):
    x, sigma = 0.1 * draw(2, 4, 21, 3, seed=5), torch.full((2,), 0.05)
    first, second = make_observation(seed=1), make_observation(seed=2)
    second = replace(second, trust=0 * second.trust)
    assert not torch.allclose(model(x, sigma, first), model(x, sigma, second), atol=1e-4)
    assert torch.equal(model(x, sigma, first.without()), model(x, sigma, second.without()))


def test_an_observed_hand_is_denoised_the_same_however_it_is_turned(model, draw, make_observation):
    x, sigma, seen = 0.1 * draw(2, 4, 21, 3), torch.full((2,), 0.05), make_observation()
    turn = axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    turned = replace(seen, joints=seen.joints @ turn.T)
    got = model(x @ turn.T, sigma, turned)
    torch.testing.assert_close(got, model(x, sigma, seen) @ turn.T, atol=1e-5, rtol=0)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, draw, make_observation):
    x, sigma, seen = 0.1 * draw(2, 4, 21, 3), torch.tensor([0.02, 0.1]), make_observation()
    whole = model(x, sigma, seen)
    for i in range(2):
        pick = slice(i, i + 1)
        one = replace(
            seen, joints=seen.joints[pick], trust=seen.trust[pick], given=seen.given[pick]
        )
        torch.testing.assert_close(model(x[pick], sigma[pick], one), whole[pick])
