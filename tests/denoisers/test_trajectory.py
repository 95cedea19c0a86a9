import pytest
import torch

from geneoh.denoisers.base import HAND_SCALE
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.geometry.rotations import axis_angle_to_matrix

TINY = TrajectoryConfig(width=16, depth=1, heads=2)


@pytest.fixture(scope="module")
def model(wake):
    return wake(TrajectoryDenoiser(TINY))


@pytest.mark.parametrize("frames", [1, 2, 7])
def test_clean_keypoints_have_the_shape_of_the_noisy_ones(model, draw, frames):
    x = draw(2, frames, 21, 3)
    got = model(x, torch.tensor([0.1, 0.02]))
    assert got.shape == x.shape
    assert bool(got.isfinite().all())


def test_an_untrained_network_is_the_skip_path(draw):
    x, sigma = 0.1 * draw(2, 4, 21, 3), torch.tensor([0.03, 0.2])
    with torch.no_grad():
        got = TrajectoryDenoiser(TINY)(x, sigma)
    keep = (HAND_SCALE**2 / (HAND_SCALE**2 + sigma**2))[:, None, None, None]
    torch.testing.assert_close(got, keep * x)


def test_an_almost_clean_hand_comes_back(model, draw):
    x = 0.1 * draw(2, 4, 21, 3)
    got = model(x, torch.full((2,), 1e-6))
    torch.testing.assert_close(got, x, atol=1e-4, rtol=0)


def test_a_hand_is_denoised_the_same_however_it_is_turned(model, draw):
    x, sigma = 0.1 * draw(2, 4, 21, 3), torch.full((2,), 0.05)
    turn = axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    got = model(x @ turn.T, sigma)
    torch.testing.assert_close(got, model(x, sigma) @ turn.T, atol=1e-5, rtol=0)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, draw):
    x, sigma = 0.1 * draw(2, 4, 21, 3), torch.tensor([0.02, 0.1])
    whole = model(x, sigma)
    for i in range(2):
        pick = slice(i, i + 1)
        torch.testing.assert_close(model(x[pick], sigma[pick]), whole[pick])
