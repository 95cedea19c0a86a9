import pytest
import torch

from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser, centred
from geneoh.geometry.rotations import axis_angle_to_matrix

TINY = TrajectoryConfig(width=16, depth=1, heads=2)
SIZE = torch.tensor([0.03, 0.05])  # deviations of two windows, metres


@pytest.fixture(scope="module")
def model(wake):
    return wake(TrajectoryDenoiser(TINY))


@pytest.mark.parametrize("frames", [1, 2, 7])
def test_clean_keypoints_have_the_shape_of_the_noisy_ones(model, draw, frames):
    x = draw(2, frames, 21, 3)
    got = model(x, torch.tensor([2.0, 0.2]), SIZE)
    assert got.shape == x.shape
    assert bool(got.isfinite().all())


def test_an_untrained_network_is_the_skip_path(draw):
    x, sigma = draw(2, 4, 21, 3), torch.tensor([0.4, 2.0])
    with torch.no_grad():
        got = TrajectoryDenoiser(TINY)(x, sigma, SIZE)
    keep = (1 / (1 + sigma**2))[:, None, None, None]
    torch.testing.assert_close(got, keep * centred(x))


def test_an_almost_clean_hand_comes_back(model, draw):
    x = draw(2, 4, 21, 3)
    got = model(x, torch.full((2,), 1e-6), SIZE)
    torch.testing.assert_close(got, centred(x), atol=1e-4, rtol=0)


def test_the_mean_of_a_window_is_zero_in_its_units_whatever_the_noise(model, draw):
    x = draw(2, 5, 21, 3)
    moved = model(x + torch.tensor([0.5, -2.0, 1.0]), torch.ones(2), SIZE)
    torch.testing.assert_close(moved, model(x, torch.ones(2), SIZE), atol=1e-4, rtol=0)
    torch.testing.assert_close(moved.mean((1, 2)), torch.zeros(2, 3), atol=1e-5, rtol=0)


def test_a_hand_is_denoised_the_same_however_it_is_turned(model, draw):
    x, sigma = draw(2, 4, 21, 3), torch.full((2,), 0.5)
    turn = axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    got = model(x @ turn.T, sigma, SIZE)
    torch.testing.assert_close(got, model(x, sigma, SIZE) @ turn.T, atol=1e-5, rtol=0)


def test_the_size_of_the_window_is_told(model, draw):
    x, sigma = draw(2, 4, 21, 3), torch.full((2,), 0.5)
    assert not torch.allclose(model(x, sigma, SIZE), model(x, sigma, 2 * SIZE), atol=1e-4)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, draw):
    x, sigma = draw(2, 4, 21, 3), torch.tensor([0.2, 1.0])
    whole = model(x, sigma, SIZE)
    for i in range(2):
        pick = slice(i, i + 1)
        torch.testing.assert_close(model(x[pick], sigma[pick], SIZE[pick]), whole[pick])
