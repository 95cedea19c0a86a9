from dataclasses import fields, replace
from itertools import chain

import pytest
import torch
from draws import normal, seeded
from made_grasps import ANY_GRASP
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import KEYPOINT_PARENTS, forward_kinematics
from geneoh.hand.spheres import BONE_RADIUS, hand_scale
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.contact_pads import contact_pads
from geneoh.synthesis.grasping.grasp_energy import GraspChecks
from geneoh.synthesis.grasping.grasp_types import FINGER_MEAN, FINGER_STD, GRASP_TYPES, curled
from geneoh.synthesis.grasping.grasps import (
    GraspConfig,
    Grasps,
    random_attempts,
    shifted_grips,
    synthesize_grasps,
)
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.solids import Solids

FAMILIES = ["box", "cylinder", "ellipsoid", "capsule", "ring", "pen", "mug", "knife"] * 20
COUNT = len(FAMILIES)
QUICK = GraspConfig(steps=90)
CHECKS = GraspChecks()
INDEX, MIDDLE, PINKY, RING, THUMB = ((n, n + 1, n + 2) for n in range(0, 15, 3))
SIDE, PALM = (15, 16), (17, 18)
FINGERS = (INDEX, MIDDLE, PINKY, RING)
PADS = {
    "power": (*FINGERS, THUMB, PALM),
    "lateral": (SIDE, THUMB[2:]),
    "hook": FINGERS,
    "support": (*FINGERS, PALM),
} | {
    f"precision {count}": tuple(pads[1:] for pads in (THUMB, INDEX, MIDDLE, RING, PINKY)[:count])
    for count in range(2, 6)
}
"""The pads that each kind of grasp may hold with, digit by digit."""


def offsets(count: int) -> Tensor:
    betas = torch.randn(count, 10, generator=seeded(3)) * 0.5
    return load_hand("right").shaped(betas).offsets


@pytest.fixture(scope="module")
def grasped() -> tuple[Grasps, Solids]:
    solids = draw_objects(FAMILIES, generator=seeded(1))
    return synthesize_grasps(solids, offsets(COUNT), QUICK, generator=seeded(2)), solids


def along_bones(grasps: Grasps) -> tuple[Tensor, Tensor]:
    """Ten points along the inner part of each bone (B, 20, 10, 3), and the hand's size."""
    joints, _ = grasps.posed()
    start, end = joints[:, list(KEYPOINT_PARENTS[1:])], joints[:, 1:]
    share = torch.linspace(0.15, 0.9, 10)[:, None]
    return start[:, :, None] + share * (end - start)[:, :, None], hand_scale(grasps.offsets)


def contacts(grasps: Grasps, solids: Solids, index: int) -> tuple[Tensor, Tensor, Tensor]:
    """Of one kind of kept grasp: touching digits (G,), touching pads (G, P), their normals."""
    mine = grasps.kept & (grasps.types == index)
    grasps, solids = grasps.take(mine, "B"), solids.take(mine, "B")
    pads, _ = contact_pads(*grasps.posed(), hand_scale(grasps.offsets))
    digits = PADS[GRASP_TYPES[index].name]
    distance, normal = solids.distance_and_normal(pads[:, list(chain(*digits))])
    touching = distance.abs() < GraspChecks().contact + 1e-6
    parts = touching.split(list(map(len, digits)), dim=1)
    return torch.stack([part.any(1) for part in parts], dim=1).sum(1), touching, normal


def indices(*names: str) -> list[int]:
    return [i for i, kind in enumerate(GRASP_TYPES) if kind.name.split()[0] in names]


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


def test_pads_lie_on_the_skin_and_face_away_from_it():
    hands = load_hand("right").shaped(0.5 * normal(6, 10))
    pose = torch.cat([normal(6, 1, 3, seed=1), curled(torch.linspace(0, 0.5, 30).view(6, 5))], 1)
    wrist = torch.zeros(6, 3)
    skin = hands.posed(pose, wrist).verts
    joints, turns = forward_kinematics(axis_angle_to_matrix(pose), wrist, hands.offsets)
    pads, facing = contact_pads(joints, turns, hand_scale(hands.offsets))
    assert float(torch.cdist(pads, skin).amin(-1).max()) < 0.007
    off = torch.cdist(pads + 0.01 * facing, skin).amin(-1)
    assert float(off.min()) > 0.005


def test_kinds_are_drawn_by_their_shares():
    shares = torch.tensor([kind.share for kind in GRASP_TYPES])
    torch.testing.assert_close(shares.sum(), torch.tensor(1.0))
    tried, _ = random_attempts(offsets(600), GraspConfig(), Draws(600, seeded(1)))
    found = torch.bincount(tried.types, minlength=len(GRASP_TYPES)) / 600
    assert float((found - shares).abs().max()) < 0.06
    assert float(found.min()) > 0.02


def test_more_than_half_of_the_grasps_are_kept_and_some_of_every_kind(grasped):
    grasps, _ = grasped
    assert float(grasps.kept.float().mean()) > 0.5
    for index, kind in enumerate(GRASP_TYPES):
        mine = grasps.kept[grasps.types == index].float()
        assert float(mine.mean()) > 0.2, kind.name


def test_kept_grasps_are_hardly_inside_the_object(grasped):
    grasps, solids = grasped
    bones, size = along_bones(grasps)
    distance = solids.signed_distance(bones.flatten(1, 2)).unflatten(1, (20, 10))
    depth = BONE_RADIUS[:, None] * size[..., None] - distance
    # between two of the spheres that are checked the bone may be a little deeper
    assert float(depth[grasps.kept].max()) < GraspChecks().depth + 0.002


@pytest.mark.parametrize("index", range(len(GRASP_TYPES)), ids=[kind.name for kind in GRASP_TYPES])
def test_kept_grasps_touch_with_the_digits_of_their_kind(grasped, index):
    count, _, _ = contacts(*grasped, index)
    assert len(count) > 0
    needed = {"power": 4, "precision 2": 2, "precision 3": 3, "precision 4": 3, "precision 5": 4}
    needed |= {"lateral": 2, "hook": 3, "support": 3}
    assert int(count.min()) >= needed[GRASP_TYPES[index].name]


@pytest.mark.parametrize("index", indices("power", "precision", "lateral"))
def test_kept_grips_have_surfaces_that_oppose(grasped, index):
    _, touching, normal = contacts(*grasped, index)
    for holds, normals in zip(touching, normal, strict=True):
        cosines = normals[holds] @ normals[holds].T
        assert float(cosines.min()) < GraspChecks().opposing + 1e-4


@pytest.mark.parametrize("index", indices("hook", "support"))
def test_what_hooks_and_palms_carry_can_be_lifted(grasped, index):
    grasps, solids = grasped
    mine = grasps.kept & (grasps.types == index)
    turn = axis_angle_to_matrix(grasps.pose[mine, 0])
    # the weight bears towards the fingertips of a hook, and down on an upturned palm
    down = turn @ torch.tensor(
        {"hook": [-1.0, 0.0, 0.0], "support": [0.0, 1.0, 0.0]}[GRASP_TYPES[index].name]
    )
    _, touching, normal = contacts(grasps, solids, index)
    for holds, normals, bears in zip(touching, normal, down, strict=True):
        along = normals[holds] @ bears
        assert float(along.max()) > GraspChecks().bearing - 1e-4
        assert float(along.min()) > -CHECKS.bearing - 1e-4


def test_kept_grasps_bend_no_joint_beyond_its_limits(grasped):
    grasps, _ = grasped
    closed = curled(torch.full((1, 5), 1.5))[0]
    low, high = FINGER_MEAN.minimum(closed), FINGER_MEAN.maximum(closed)
    fingers, slack = grasps.pose[grasps.kept, 1:], GraspChecks().deviations * FINGER_STD + 1e-5
    assert bool((fingers > low - slack).all())
    assert bool((fingers < high + slack).all())


@pytest.mark.parametrize(
    "strict",
    [
        GraspChecks(depth=0.0),
        GraspChecks(clearance=0.1),
        GraspChecks(deviations=0.1),
        GraspChecks(opposing=-2.0, bearing=1.1),
        GraspChecks(contact=0.0),
        GraspChecks(unheld=-1.0, bearing=1.1),
    ],
)
def test_every_check_can_refuse(strict):
    solids = draw_objects(FAMILIES[:8], generator=seeded(1))
    config = GraspConfig(steps=20, checks=strict)
    tried = synthesize_grasps(solids, offsets(8), config, generator=seeded(2))
    assert not bool(tried.kept.any())


def test_hands_may_have_no_other_grips(grasped):
    grasps, solids = grasped
    grips = shifted_grips(solids, grasps, GraspConfig(grips=0), generator=seeded(6))
    assert grips.pose.shape == (len(grasps.pose), 0, 16, 3)


def test_hands_shift_to_grips_that_pass_the_checks_too(grasped):
    grasps, solids = grasped
    grasps, solids = grasps.take(grasps.kept, "B"), solids.take(grasps.kept, "B")
    grips = shifted_grips(solids, grasps, GraspConfig(grips=2), generator=seeded(6))
    assert grips.pose.shape == (len(grasps.pose), 2, 16, 3)
    moved = (grips.wrist - grasps.wrist[:, None]).norm(dim=-1)
    assert float((moved > 0.001).float().mean()) > 0.3, "the others are the grasp itself"
    assert float(moved.max()) < 0.06
    for k in range(2):
        found = replace(grasps, pose=grips.pose[:, k], wrist=grips.wrist[:, k])
        for index in range(len(GRASP_TYPES)):
            before, after = (contacts(each, solids, index)[0] for each in (grasps, found))
            assert len(before) == len(after)
            assert int(after.min()) >= 2
        bones, size = along_bones(found)
        distance = solids.signed_distance(bones.flatten(1, 2)).unflatten(1, (20, 10))
        depth = BONE_RADIUS[:, None] * size[..., None] - distance
        assert float(depth.max()) < GraspChecks().depth + 0.002


def test_a_grasp_is_a_plain_record_of_the_hand_it_was_asked_for(grasped):
    grasps, _ = grasped
    assert torch.equal(grasps.offsets, offsets(COUNT))
    for field in fields(Grasps):
        values = getattr(grasps, field.name)
        assert not values.requires_grad
        assert bool(values.isfinite().all())


def test_grasps_depend_on_the_generator_alone_and_checks_only_choose():
    solids = draw_objects(["box", "ring"], generator=seeded(4))
    first, second, other = (
        synthesize_grasps(
            solids, offsets(2), GraspConfig(steps=2, checks=checks), generator=seeded(s)
        )
        for s, checks in ((5, CHECKS), (5, GraspChecks(fingers=5)), (6, CHECKS))
    )
    assert torch.equal(first.pose, second.pose)
    assert torch.equal(first.wrist, second.wrist)
    assert torch.equal(first.types, second.types)
    assert not torch.equal(first.wrist, other.wrist)
    assert not bool(second.kept.any()), "no hand touches with more than five fingers"


def test_everything_passes_checks_that_ask_for_nothing():
    solids = draw_objects(["box", "ring"], generator=seeded(4))
    grasps = synthesize_grasps(solids, offsets(2), ANY_GRASP, generator=seeded())
    assert bool(grasps.kept.all())
