from dataclasses import replace

import pytest
import torch
import trimesh
from draws import seeded

from geneoh.generators.text2hoi.physics.held_hands import HeldHands, new_grasps
from geneoh.generators.text2hoi.physics.settling import DEEP_ON_WAY, depths, solid_of, withdrawn
from geneoh.generators.text2hoi.physics.standing import stand_on_table
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.synthesis.grasping.contact_pads import Obstacles, OtherHands, Table
from geneoh.synthesis.grasping.grasp_types import FINGER_MEAN

FRAMES, HOLD, BESIDE = 90, torch.arange(40, 50), 0.045
TABLE = Table(torch.tensor([[0.0, 0, 1]]).expand(FRAMES, 3), torch.full((FRAMES,), 1.0))
"""A metre below the object."""


@pytest.fixture(scope="module")
def plate():
    """A plate of 4 mm that stands on its edge, in the plane y = 0, as a grid."""
    made = trimesh.creation.box((0.16, 0.004, 0.16))
    return solid_of(stand_on_table(from_trimesh(made), generator=seeded()))[0]


def beside(before: float, after: float) -> HeldHands:
    """A flat hand beside the edge of the plate, y > 0, while it holds; it comes there straight from
    another y in metres within 20 frames, and goes to another one."""
    frames = torch.arange(FRAMES)
    coming = ((HOLD[0] - frames) / 20).clamp(0, 1) * (before - BESIDE)
    going = ((frames - HOLD[-1]) / 20).clamp(0, 1) * (after - BESIDE)
    wrist = torch.stack(
        [torch.full((FRAMES,), 0.15), BESIDE + coming + going, torch.zeros(FRAMES)], 1
    )
    pose = torch.cat([torch.zeros(1, 3), 0.2 * FINGER_MEAN]).expand(FRAMES, 16, 3)
    return HeldHands(pose, wrist)


def deepest(hand: HeldHands, plate, other=None) -> float:
    """Depth of a hand in the plate or the other hand, most of all frames, metres."""
    return float(depths(hand, torch.arange(FRAMES), plate, Obstacles(TABLE, other)).amax())


@pytest.mark.parametrize(("before", "after"), [(-0.2, 0.2), (0.2, -0.2), (-0.2, -0.2)])
def test_a_hand_goes_around_a_wall_and_not_through_it(plate, before, after):
    drawn = beside(before, after)
    found = withdrawn(drawn, HOLD, plate, Obstacles(TABLE))
    assert deepest(drawn, plate) > 2 * DEEP_ON_WAY
    assert deepest(found, plate) < DEEP_ON_WAY
    for frames in (HOLD, torch.tensor([0, FRAMES - 1])):
        torch.testing.assert_close(found.take(frames, "N").wrist, drawn.take(frames, "N").wrist)
    steps = found.wrist.diff(dim=0).norm(dim=-1)
    assert float(steps.amax()) < 0.02


def test_a_hand_whose_ways_are_free_keeps_them(plate):
    drawn = beside(0.2, 0.3)
    assert withdrawn(drawn, HOLD, plate, Obstacles(TABLE)) == drawn


def test_a_hand_that_starts_or_ends_in_its_hold_has_no_way(plate):
    drawn = beside(-0.2, -0.2)
    assert withdrawn(drawn, torch.arange(FRAMES), plate, Obstacles(TABLE)) == drawn


def test_a_hand_goes_around_another_one(plate):
    drawn = beside(0.3, 0.2)
    there = replace(
        drawn, wrist=drawn.wrist[:1].expand_as(drawn.wrist) - torch.tensor([0, 0.22, 0.06])
    )
    other = OtherHands(*there.spheres)
    found = withdrawn(drawn, HOLD, plate, Obstacles(TABLE, other))
    assert deepest(drawn, plate, other) > 2 * DEEP_ON_WAY
    assert deepest(found, plate, other) < DEEP_ON_WAY


@pytest.fixture(scope="module")
def pole():
    """An upright pole of 24 mm as a grid, and twelve hands that hold it or try to."""
    made = trimesh.creation.cylinder(0.012, 0.6, sections=32)
    solids = solid_of(stand_on_table(from_trimesh(made), generator=seeded()))[0]
    toward, beside = torch.tensor([[0.0, 1, 0]]).expand(12, 3), Obstacles(TABLE.take([0] * 12, "B"))
    return solids, new_grasps(solids, toward, beside, seeded())[0]


@pytest.mark.parametrize("number", [1, 2, 10])
def test_fingers_around_a_pole_open_before_the_hand_leaves(pole, number):
    solids, grasps = pole
    held = grasps.take([number], "N")
    far = torch.maximum(HOLD[0] - torch.arange(FRAMES), torch.arange(FRAMES) - HOLD[-1])
    side = torch.nn.functional.normalize(held.wrist * torch.tensor([1.0, 1, 0]), dim=-1)
    wrist = held.wrist + 0.01 * far.clamp(0, 20)[:, None] * side
    drawn = HeldHands(held.pose.expand(FRAMES, -1, -1), wrist)
    found = withdrawn(drawn, HOLD, solids, Obstacles(TABLE))
    assert deepest(drawn, solids) > 0.01
    assert deepest(found, solids) < DEEP_ON_WAY
    torch.testing.assert_close(found.take(HOLD, "N").pose, drawn.take(HOLD, "N").pose)
    steps = found.spheres[0].diff(dim=0).norm(dim=-1)
    assert float(steps.amax()) < 0.04
