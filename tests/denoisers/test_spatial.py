from dataclasses import replace

import pytest
import torch
from torch import Tensor

from geneoh.denoisers.base import HAND_SCALE, NOISE_SCALE
from geneoh.denoisers.spatial import CONTACT_SCALE, SpatialConfig, SpatialDenoiser, contact_features
from geneoh.geometry.rotations import axis_angle_to_matrix

TINY = SpatialConfig(width=16, depth=1, heads=2, point_width=8)
K = 5


@pytest.fixture(scope="module")
def model(wake):
    return wake(SpatialDenoiser(TINY))


@pytest.fixture(scope="module")
def case(draw):
    """Noisy hands, noise levels, contact points and normals of a batch of two clips."""

    def make(frames: int = 3) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        normals = torch.nn.functional.normalize(draw(2, frames, K, 3, seed=3), dim=-1)
        points = 0.03 * draw(2, frames, K, 3, seed=2)
        return 0.1 * draw(2, frames, K, 21, 3), torch.tensor([0.02, 0.1]), points, normals

    return make


@pytest.mark.parametrize("frames", [1, 2, 6])
def test_every_contact_point_gets_a_hand(model, case, make_observation, frames):
    x, *rest = case(frames)
    got = model(x, *rest, make_observation(frames=frames))
    assert got.shape == x.shape
    assert bool(got.isfinite().all())


@pytest.mark.parametrize(("given", "scale"), [(1.0, NOISE_SCALE), (0.0, HAND_SCALE)])
def test_an_untrained_network_is_the_skip_path(case, make_observation, given, scale):
    seen = make_observation(frames=3, given=given)
    x, sigma, *rest = case()
    with torch.no_grad():
        got = SpatialDenoiser(TINY)(x, sigma, *rest, seen)
    keep = (scale**2 / (scale**2 + sigma**2))[:, None, None, None, None]
    anchor = given * seen.joints[:, :, None]
    torch.testing.assert_close(got, anchor + keep * (x - anchor))


def test_an_almost_clean_hand_comes_back(model, case, make_observation):
    x, _, points, normals = case()
    got = model(x, torch.full((2,), 1e-6), points, normals, make_observation(frames=3))
    torch.testing.assert_close(got, x, atol=1e-4, rtol=0)


def test_a_withheld_observation_does_not_matter(model, case, make_observation):
    first, second = (make_observation(frames=3, seed=i) for i in (1, 2))
    assert not torch.allclose(model(*case(), first), model(*case(), second), atol=1e-4)
    assert torch.equal(model(*case(), first.without()), model(*case(), second.without()))


def test_an_observed_hand_is_denoised_the_same_however_it_is_turned(model, case, make_observation):
    x, sigma, points, normals = case()
    seen, turn = make_observation(frames=3), axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    turned = replace(seen, joints=seen.joints @ turn.T)
    got = model(x @ turn.T, sigma, points @ turn.T, normals @ turn.T, turned)
    want = model(x, sigma, points, normals, seen) @ turn.T
    torch.testing.assert_close(got, want, atol=1e-5, rtol=0)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, case, make_observation):
    seen = make_observation(frames=3)
    whole = model(*case(), seen)
    for i in range(2):
        pick = slice(i, i + 1)
        one = replace(
            seen, joints=seen.joints[pick], trust=seen.trust[pick], given=seen.given[pick]
        )
        torch.testing.assert_close(model(*(v[pick] for v in case()), one), whole[pick])


def test_the_order_of_contact_points_does_not_matter(model, case, make_observation):
    x, sigma, points, normals = case()
    order, seen = torch.tensor([3, 0, 4, 2, 1]), make_observation(frames=3)
    plain = model(x, sigma, points, normals, seen)
    shuffled = model(x[:, :, order], sigma, points[:, :, order], normals[:, :, order], seen)
    torch.testing.assert_close(shuffled, plain[:, :, order], atol=1e-5, rtol=1e-5)


def test_contact_points_tell_each_other_what_they_see(model, case, make_observation):
    x, sigma, points, normals = case()
    seen, moved = make_observation(frames=3), points.clone()
    moved[:, :, 0] += 0.05
    plain, other = (model(x, sigma, p, normals, seen) for p in (points, moved))
    assert float((plain - other)[:, :, 1:].abs().max()) > 1e-5


def test_position_and_normal_of_a_contact_point_are_used(model, case, make_observation):
    x, sigma, points, normals = case()
    seen = make_observation(frames=3)
    plain = model(x, sigma, points, normals, seen)
    assert not torch.allclose(model(x, sigma, points, -normals, seen), plain, atol=1e-5)


def test_height_is_signed_and_counts_near_the_point_only():
    point, normal = torch.zeros(1, 1, 1, 3), torch.tensor([0.0, 0, 1]).expand(1, 1, 1, 3)
    hand = torch.zeros(1, 1, 1, 21, 3)
    hand[..., 0, 2], hand[..., 1, 2], hand[..., 2, 2] = 0.005, -0.005, 1.0
    near, height = contact_features(hand, point, normal).unflatten(-1, (2, 21)).unbind(-2)
    decay = torch.exp(torch.tensor(-0.005 / CONTACT_SCALE))
    torch.testing.assert_close(near[0, 0, 0, :2], decay.expand(2))
    torch.testing.assert_close(height[0, 0, 0, :2], 0.5 * decay * torch.tensor([1.0, -1.0]))
    assert float(near[0, 0, 0, 2]) < 1e-6
    assert float(height[0, 0, 0, 2].abs()) < 1e-6
