from dataclasses import replace

import pytest
import torch
from torch import Tensor

from geneoh.denoisers.relations import (
    CONTACT_SCALE,
    RelationConfig,
    RelationDenoiser,
    contact_features,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.spatial import SpatialRelations
from geneoh.representation.window_scale import WindowScale

TINY = RelationConfig(width=16, depth=1, heads=2, point_width=8)
K = 5
NAMES = tuple(SpatialRelations.__dataclass_fields__)


def each(relations: SpatialRelations, change) -> SpatialRelations:
    """The same function on all tensors of the relations."""
    return SpatialRelations(*(change(getattr(relations, name)) for name in NAMES))


@pytest.fixture(scope="module")
def model(wake):
    return wake(RelationDenoiser(TINY))


@pytest.fixture(scope="module")
def case(draw):
    """Noisy relations, noise levels and units of a batch of two clips."""

    def make(frames: int = 3) -> tuple[SpatialRelations, Tensor, WindowScale]:
        normals = torch.nn.functional.normalize(draw(2, frames, K, 3, seed=3), dim=-1)
        points = 0.03 * draw(2, frames, K, 3, seed=2)
        hands = 0.1 * draw(2, frames, K, 21, 3)
        noisy = SpatialRelations(points, normals, hands)
        return noisy, torch.tensor([0.2, 1.0]), WindowScale.of(hands)

    return make


@pytest.mark.parametrize("frames", [1, 2, 6])
def test_every_contact_point_gets_a_hand(model, case, frames):
    noisy, sigma, scale = case(frames)
    got = model(noisy, sigma, scale)
    assert got.hands.shape == noisy.hands.shape
    assert bool(got.hands.isfinite().all())
    assert torch.equal(got.points, noisy.points)
    assert torch.equal(got.normals, noisy.normals)


def test_an_untrained_network_is_the_skip_path(case):
    noisy, sigma, scale = case()
    with torch.no_grad():
        got = RelationDenoiser(TINY)(noisy, sigma, scale)
    keep = (1 / (1 + sigma**2))[:, None, None, None, None]
    torch.testing.assert_close(got.hands, scale.mean + keep * (noisy.hands - scale.mean))


def test_an_almost_clean_hand_comes_back(model, case):
    noisy, _, scale = case()
    got = model(noisy, torch.full((2,), 1e-6), scale)
    torch.testing.assert_close(got.hands, noisy.hands, atol=1e-4, rtol=0)


def test_a_hand_is_denoised_the_same_however_it_is_turned(model, case):
    noisy, sigma, scale = case()
    turn = axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    turned = each(noisy, lambda values: values @ turn.T)
    got = model(turned, sigma, WindowScale.of(turned.hands)).hands
    want = model(noisy, sigma, scale).hands @ turn.T
    torch.testing.assert_close(got, want, atol=1e-5, rtol=0)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, case):
    noisy, sigma, scale = case()
    whole = model(noisy, sigma, scale).hands
    for i in range(2):
        pick = slice(i, i + 1)
        one = each(noisy, lambda values, pick=pick: values[pick])
        alone = model(one, sigma[pick], WindowScale.of(one.hands))
        torch.testing.assert_close(alone.hands, whole[pick])


def test_the_order_of_contact_points_does_not_matter(model, case):
    noisy, sigma, scale = case()
    order = torch.tensor([3, 0, 4, 2, 1])
    plain = model(noisy, sigma, scale).hands
    shuffled = model(each(noisy, lambda values: values[:, :, order]), sigma, scale).hands
    torch.testing.assert_close(shuffled, plain[:, :, order], atol=1e-5, rtol=1e-5)


def test_contact_points_tell_each_other_what_they_see(model, case):
    noisy, sigma, scale = case()
    moved = noisy.points.clone()
    moved[:, :, 0] += 0.05
    plain, changed = (
        model(one, sigma, scale).hands for one in (noisy, replace(noisy, points=moved))
    )
    assert float((plain - changed)[:, :, 1:].abs().max()) > 1e-5


@pytest.mark.parametrize("change", ["normals", "deviation"])
def test_normals_and_the_size_of_the_window_are_used(model, case, change):
    noisy, sigma, scale = case()
    plain = model(noisy, sigma, scale).hands
    if change == "normals":
        other = model(replace(noisy, normals=-noisy.normals), sigma, scale).hands
    else:
        twice = WindowScale(2 * scale.mean, 2 * scale.deviation)
        large = SpatialRelations(2 * noisy.points, noisy.normals, 2 * noisy.hands)
        other = 0.5 * model(large, sigma, twice).hands
    assert not torch.allclose(other, plain, atol=1e-5)


def test_height_is_signed_and_counts_near_the_point_only():
    point, normal = torch.zeros(1, 1, 1, 3), torch.tensor([0.0, 0, 1]).expand(1, 1, 1, 3)
    hand = torch.zeros(1, 1, 1, 21, 3)
    hand[..., 0, 2], hand[..., 1, 2], hand[..., 2, 2] = 0.005, -0.005, 1.0
    features = contact_features(SpatialRelations(point, normal, hand))
    near, height = features.unflatten(-1, (2, 21)).unbind(-2)
    decay = torch.exp(torch.tensor(-0.005 / CONTACT_SCALE))
    torch.testing.assert_close(near[0, 0, 0, :2], decay.expand(2))
    torch.testing.assert_close(height[0, 0, 0, :2], 0.5 * decay * torch.tensor([1.0, -1.0]))
    assert float(near[0, 0, 0, 2]) < 1e-6
    assert float(height[0, 0, 0, 2].abs()) < 1e-6
