import pytest
import torch
from draws import normal
from torch import Tensor

from geneoh.fitting.align import (
    PLACE_STD,
    STEP_STD,
    AlignConfig,
    align_to_relations,
    align_to_steps,
)
from geneoh.representation.region import ContactRegion
from geneoh.representation.temporal import PairStatistics, TemporalRelations, encode_temporal

FPS, FRAMES, POINTS = 30.0, 6, 5


@pytest.fixture(scope="module")
def scene() -> tuple[Tensor, ContactRegion]:
    """Two clips of a hand that rests on an object carried along a line."""
    way = 0.005 * torch.arange(FRAMES)[:, None, None] * torch.tensor([1.0, 0.5, 0.0])
    normals = torch.nn.functional.normalize(normal(2, 1, POINTS, 3), dim=-1)
    points = 0.03 * normals + way
    region = ContactRegion(
        points,
        normals.expand_as(points),
        torch.eye(3).expand(2, FRAMES, 3, 3),
        points.mean(2),
    )
    around = torch.nn.functional.normalize(normal(2, 1, 21, 3, seed=1), dim=-1)
    return 0.04 * around + way, region


def relations_of(joints: Tensor, region: ContactRegion) -> TemporalRelations:
    return encode_temporal(joints, region, FPS)


def disagreement(joints: Tensor, region: ContactRegion, target: PairStatistics) -> float:
    """Mean miss of near pairs in speed, m/s."""
    near = torch.exp(-100 * target.distance)
    miss = (relations_of(joints, region).velocity - target.velocity).norm(dim=-1)
    return float((near * miss).sum() / near.sum())


@pytest.mark.parametrize("config", [AlignConfig(steps=20), AlignConfig(steps=10, rate=2e-3)])
@pytest.mark.parametrize("away", [0.0, 0.1])
def test_keypoints_that_agree_hardly_move(scene, config, away):
    """Not in contact, and not where no pair weighs anything: rounding is no reason to step."""
    joints, region = scene
    joints = joints + torch.tensor([away, 0.0, 0.0])
    target = relations_of(joints, region)
    moved = align_to_relations(joints, region, target, FPS, config=config)
    apart = (moved - joints).norm(dim=-1)
    assert float(apart.mean()) < 1e-4
    assert float(apart.max()) < 5e-4


def test_keypoints_that_disagree_come_nearer_to_agreement_and_to_the_truth(scene):
    joints, region = scene
    target = relations_of(joints, region)
    noisy = joints + 0.003 * normal(2, FRAMES, 21, 3, seed=2)
    moved = align_to_relations(noisy, region, target, FPS, config=AlignConfig(steps=20))
    assert disagreement(moved, region, target) < 0.6 * disagreement(noisy, region, target)
    before, after = ((x - joints).norm(dim=-1).mean() for x in (noisy, moved))
    assert float(after) < 0.9 * float(before)
    assert float((moved - noisy).norm(dim=-1).mean()) < 0.01


def test_windows_do_not_see_the_batch_they_came_in(scene):
    joints, region = scene
    noisy = joints + 0.003 * normal(2, FRAMES, 21, 3, seed=2)
    config = AlignConfig(steps=5)

    def aligned(pick: slice) -> Tensor:
        part = ContactRegion(
            region.points[pick], region.normals[pick], region.rotation[pick], region.center[pick]
        )
        target = relations_of(joints[pick], part)
        return align_to_relations(noisy[pick], part, target, FPS, config=config)

    torch.testing.assert_close(aligned(slice(1, 2)), aligned(slice(2))[1:], atol=1e-6, rtol=0)


def test_no_step_is_no_motion(scene):
    joints, region = scene
    target = relations_of(joints, region)
    left = align_to_relations(joints, region, target, FPS, config=AlignConfig(steps=0))
    torch.testing.assert_close(left, joints, atol=1e-6, rtol=0)


def test_far_pairs_weigh_next_to_nothing(scene):
    """A target that is wrong only about a contact point far away moves no keypoint."""
    joints, region = scene
    far = region.points.clone()
    far[:, :, 0] += 0.5
    region = ContactRegion(far, region.normals, region.rotation, region.center)
    target = relations_of(joints, region)
    velocity = target.velocity.clone()
    velocity[:, :, 0] += 1.0
    wrong = PairStatistics(target.distance, velocity, target.tangential, target.normal)
    moved = align_to_relations(joints, region, wrong, FPS, config=AlignConfig(steps=20))
    assert float((moved - joints).norm(dim=-1).max()) < 1e-3


def test_aligned_steps_are_the_least_squares_of_steps_and_places():
    change, steps, places = normal(7, 21, 3), normal(7, 21, seed=1), normal(7, 21, seed=2)
    change, steps, places = change.double(), steps.double(), places.double()
    shift = align_to_steps(change, steps, places).requires_grad_()
    miss = (shift.diff(dim=0) - change[:-1]) / STEP_STD
    energy = (steps[:-1].exp() * miss.square().sum(-1)).sum()
    energy = energy + (places.exp() * (shift / PLACE_STD).square().sum(-1)).sum()
    (slope,) = torch.autograd.grad(energy, shift)
    one_term = 2 * places.exp() * shift.detach().abs().amax(-1) / PLACE_STD**2
    assert float(slope.abs().max()) < 1e-9 * float(one_term.max())
    assert float(shift.detach().abs().max()) > 0.01


def test_steps_that_are_not_to_change_leave_every_place():
    weights = normal(2, 7, 21, seed=1)
    shift = align_to_steps(torch.zeros(2, 7, 21, 3), weights, -weights)
    assert torch.equal(shift, torch.zeros(2, 7, 21, 3))


def test_a_long_track_is_aligned_some_keypoints_at_a_time(monkeypatch):
    given = normal(7, 21, 3), normal(7, 21, seed=1), normal(7, 21, seed=2)
    whole = align_to_steps(*given)
    monkeypatch.setattr("geneoh.fitting.align.MOST_POSITIONS", 28)
    assert torch.equal(align_to_steps(*given), whole)
