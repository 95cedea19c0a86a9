from dataclasses import fields

import pytest
import torch
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import KEYPOINT_PARENTS, forward_kinematics
from geneoh.synthesis.grasps import (
    BONE_RADIUS,
    MEAN_SPAN,
    NATURAL_MEAN,
    NATURAL_STD,
    Checks,
    Grasps,
    curled,
    synthesize_grasps,
)
from geneoh.synthesis.objects import Solids, draw_objects

FAMILIES = ["box", "cylinder", "ellipsoid", "capsule"] * 2


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def offsets(count: int) -> Tensor:
    betas = torch.randn(count, 10, generator=seeded(3)) * 0.5
    return load_hand("right").shaped(betas).offsets


@pytest.fixture(scope="module")
def grasped() -> tuple[Grasps, Solids]:
    solids = draw_objects(FAMILIES, generator=seeded(1))
    return synthesize_grasps(solids, offsets(8), generator=seeded(2), steps=60), solids


def along_bones(grasps: Grasps) -> tuple[Tensor, Tensor]:
    """Ten points along the inner part of each bone (B, 20, 10, 3), and the hand's size."""
    joints, _ = forward_kinematics(axis_angle_to_matrix(grasps.pose), grasps.wrist, grasps.offsets)
    start, end = joints[:, list(KEYPOINT_PARENTS[1:])], joints[:, 1:]
    share = torch.linspace(0.15, 0.9, 10)[:, None]
    size = grasps.offsets[:, [3, 4, 5, 16]].norm(dim=-1).sum(-1) / MEAN_SPAN
    return start[:, :, None] + share * (end - start)[:, :, None], size


def test_a_flat_hand_has_straight_fingers_and_a_fist_has_its_tips_at_the_palm():
    turns = [axis_angle_to_matrix(curled(torch.full((1, 5), c))) for c in (0.0, 1.0, 2.0)]
    wrist = torch.eye(3).expand(1, 1, 3, 3)
    joints = [
        forward_kinematics(torch.cat([wrist, turn], 1), torch.zeros(1, 3), offsets(1))[0][0]
        for turn in turns
    ]
    tips = [8, 12, 16, 20]
    apart = [(hand[tips] - hand[0]).norm(dim=-1) for hand in joints]
    assert bool((apart[0] > apart[1]).all())
    assert bool((apart[1] > apart[2]).all())
    assert float(apart[2].mean()) < 0.12 < float(apart[0].mean())
    between = [(hand[8] - hand[20]).norm() for hand in joints]
    assert between[2] < between[0], "closing fingers converge"


def test_most_grasps_of_simple_objects_are_kept(grasped):
    assert int(grasped[0].kept.sum()) >= 4


def test_kept_grasps_are_hardly_inside_the_object(grasped):
    grasps, solids = grasped
    bones, size = along_bones(grasps)
    distance = solids.signed_distance(bones.flatten(1, 2)).unflatten(1, (20, 10))
    depth = BONE_RADIUS[:, None] * size[:, None, None] - distance
    # between two of the spheres that are checked the bone may be a little deeper
    assert float(depth[grasps.kept].max()) < Checks().depth + 0.002


def test_kept_grasps_touch_with_three_fingers(grasped):
    grasps, solids = grasped
    bones, size = along_bones(grasps)
    distance = solids.signed_distance(bones.flatten(1, 2)).unflatten(1, (5, 4, 10))
    radius = BONE_RADIUS.unflatten(0, (5, 4))[:, :, None] * size[:, None, None, None]
    gap = (distance - radius)[:, :, 1:].amin((2, 3))  # the first bone of each is in the palm
    touching = (gap < Checks().contact + 0.002).sum(-1)
    assert bool((touching[grasps.kept] > Checks().fingers).all())


def test_kept_grasps_are_natural(grasped):
    grasps, _ = grasped
    beyond = ((grasps.pose[:, 1:] - NATURAL_MEAN) / NATURAL_STD).abs()
    assert float(beyond[grasps.kept].max()) < 4


def test_a_grasp_is_a_plain_record_of_the_hand_it_was_asked_for(grasped):
    grasps, _ = grasped
    assert torch.equal(grasps.offsets, offsets(8))
    for field in fields(Grasps):
        values = getattr(grasps, field.name)
        assert not values.requires_grad
        assert bool(values.isfinite().all())


def test_grasps_depend_on_the_generator_alone_and_checks_only_choose():
    solids = draw_objects(["box", "ring"], generator=seeded(4))
    first, second, other = (
        synthesize_grasps(solids, offsets(2), generator=seeded(s), steps=2, checks=checks)
        for s, checks in ((5, None), (5, Checks(fingers=5)), (6, None))
    )
    assert torch.equal(first.pose, second.pose)
    assert torch.equal(first.wrist, second.wrist)
    assert not torch.equal(first.wrist, other.wrist)
    assert not bool(second.kept.any()), "no hand touches with more than five fingers"


def test_everything_passes_checks_that_ask_for_nothing():
    solids = draw_objects(["box", "ring"], generator=seeded(4))
    anything = Checks(depth=1.0, fingers=-1, clearance=-1.0)
    grasps = synthesize_grasps(solids, offsets(2), generator=seeded(), steps=1, checks=anything)
    assert bool(grasps.kept.all())
