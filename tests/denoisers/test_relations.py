from dataclasses import replace

import pytest
import torch
from torch import Tensor

from geneoh.denoisers.base import HAND_SCALE, NOISE_SCALE
from geneoh.denoisers.relations import (
    CONTACT_SCALE,
    RelationConfig,
    RelationDenoiser,
    contact_features,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.spatial import SpatialRelations

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
    """Noisy relations and noise levels of a batch of two clips."""

    def make(frames: int = 3) -> tuple[SpatialRelations, Tensor]:
        normals = torch.nn.functional.normalize(draw(2, frames, K, 3, seed=3), dim=-1)
        points = 0.03 * draw(2, frames, K, 3, seed=2)
        hands = 0.1 * draw(2, frames, K, 21, 3)
        return SpatialRelations(points, normals, hands), torch.tensor([0.02, 0.1])

    return make


@pytest.mark.parametrize("frames", [1, 2, 6])
def test_every_contact_point_gets_a_hand(model, case, make_observation, frames):
    noisy, sigma = case(frames)
    got = model(noisy, sigma, make_observation(frames=frames))
    assert got.hands.shape == noisy.hands.shape
    assert bool(got.hands.isfinite().all())
    assert torch.equal(got.points, noisy.points)
    assert torch.equal(got.normals, noisy.normals)


@pytest.mark.parametrize(("given", "scale"), [(1.0, NOISE_SCALE), (0.0, HAND_SCALE)])
def test_an_untrained_network_is_the_skip_path(case, make_observation, given, scale):
    seen = make_observation(frames=3, given=given)
    noisy, sigma = case()
    with torch.no_grad():
        got = RelationDenoiser(TINY)(noisy, sigma, seen)
    keep = (scale**2 / (scale**2 + sigma**2))[:, None, None, None, None]
    anchor = given * seen.joints[:, :, None]
    torch.testing.assert_close(got.hands, anchor + keep * (noisy.hands - anchor))


def test_an_almost_clean_hand_comes_back(model, case, make_observation):
    noisy, _ = case()
    got = model(noisy, torch.full((2,), 1e-6), make_observation(frames=3))
    torch.testing.assert_close(got.hands, noisy.hands, atol=1e-4, rtol=0)


def test_a_withheld_observation_does_not_matter(model, case, make_observation):
    def answers(given: float) -> list[Tensor]:
        seen = (make_observation(frames=3, seed=i, given=given) for i in (1, 2))
        return [model(*case(), one).hands for one in seen]

    first, second = answers(given=1.0)
    assert not torch.allclose(first, second, atol=1e-4)
    first, second = answers(given=0.0)
    assert torch.equal(first, second)


def test_an_observed_hand_is_denoised_the_same_however_it_is_turned(model, case, make_observation):
    noisy, sigma = case()
    seen, turn = make_observation(frames=3), axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    turned = replace(seen, joints=seen.joints @ turn.T)
    got = model(each(noisy, lambda values: values @ turn.T), sigma, turned).hands
    want = model(noisy, sigma, seen).hands @ turn.T
    torch.testing.assert_close(got, want, atol=1e-5, rtol=0)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, case, make_observation):
    seen, (noisy, sigma) = make_observation(frames=3), case()
    whole = model(noisy, sigma, seen).hands
    for i in range(2):
        pick = slice(i, i + 1)
        one = replace(
            seen, joints=seen.joints[pick], trust=seen.trust[pick], given=seen.given[pick]
        )
        alone = model(each(noisy, lambda values, pick=pick: values[pick]), sigma[pick], one)
        torch.testing.assert_close(alone.hands, whole[pick])


def test_the_order_of_contact_points_does_not_matter(model, case, make_observation):
    noisy, sigma = case()
    order, seen = torch.tensor([3, 0, 4, 2, 1]), make_observation(frames=3)
    plain = model(noisy, sigma, seen).hands
    shuffled = model(each(noisy, lambda values: values[:, :, order]), sigma, seen).hands
    torch.testing.assert_close(shuffled, plain[:, :, order], atol=1e-5, rtol=1e-5)


def test_contact_points_tell_each_other_what_they_see(model, case, make_observation):
    noisy, sigma = case()
    seen, moved = make_observation(frames=3), noisy.points.clone()
    moved[:, :, 0] += 0.05
    other = replace(noisy, points=moved)
    plain, changed = (model(one, sigma, seen).hands for one in (noisy, other))
    assert float((plain - changed)[:, :, 1:].abs().max()) > 1e-5


def test_the_normal_of_a_contact_point_is_used(model, case, make_observation):
    noisy, sigma = case()
    seen = make_observation(frames=3)
    plain = model(noisy, sigma, seen).hands
    other = model(replace(noisy, normals=-noisy.normals), sigma, seen).hands
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
