from dataclasses import replace

import pytest
import torch
from draws import seeded
from made_actions import box_actions
from two_parts import DEEP, HIGH, HINGE, box_with_lid

from geneoh.generators.text2hoi.physics import part_holds
from geneoh.generators.text2hoi.physics.held_hands import HeldHands, table_of
from geneoh.generators.text2hoi.physics.jointed import JointedObject, joined
from geneoh.generators.text2hoi.physics.opening import rigid_part
from geneoh.generators.text2hoi.physics.part_grips import PartTask, unmoved
from geneoh.generators.text2hoi.physics.part_holds import (
    GRIP,
    PartShapes,
    held_at_parts,
    hold_frames,
    over_table,
)
from geneoh.generators.text2hoi.physics.standing import stand_on_table
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.joint import Joint
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.geometry.openings import SHEET_THICKNESS
from geneoh.geometry.rigid import Rigid
from geneoh.synthesis.actions.acting import overlap_of_hands
from geneoh.synthesis.grasping.contact_pads import OtherHands
from geneoh.synthesis.grasping.grasp_types import FINGER_MEAN

FRAMES = 60


@pytest.fixture(scope="module")
def lidded():
    """The box with a lid, upright on the table."""
    meshes = box_with_lid(overhang=0.02)
    stood = stand_on_table(joined(meshes), generator=seeded())
    return JointedObject.of(meshes, stood, Joint.read(HINGE), closes=False)[0]


@pytest.fixture(scope="module")
def shapes(lidded):
    """Its grids."""
    return PartShapes.of(lidded.meshes, torch.tensor([0.0, -1.0, 0.0]))


def opening(lidded, hands=(False, True)):
    """An action whose right hand hovers over the front of the lid while it opens by 1 rad.

    The left hand hovers over the mirrored place, 5 mm higher.
    """
    actions = box_actions(["open"], frames=FRAMES, jointed=True)
    still = torch.eye(3).expand(1, FRAMES, 3, 3), torch.zeros(1, FRAMES, 3)
    made = replace(actions, rotation=still[0], translation=still[1], **vars(lidded.objects))
    pose = torch.zeros(1, 2, FRAMES, 16, 3)
    pose[:, 1, :, 1:] = FINGER_MEAN
    wrist = torch.zeros(1, 2, FRAMES, 3)
    # fingers point along -x and the palm down, once the hand's y is the world's z
    pose[:, 1, :, 0] = torch.tensor([torch.pi / 2, 0.0, 0.0])
    wrist[:, 1] = lidded.meshes[1].verts.mean(0) + torch.tensor([0.06, -DEEP / 2, 0.06])
    pose[:, 0], wrist[:, 0] = mirror_axis_angle(pose[:, 1]), mirror_points(wrist[:, 1])
    wrist[..., 2] += torch.tensor([0.005, 0.0])[:, None]
    joint = (torch.linspace(0, 1, FRAMES)[None] * 3 - 1).clamp(0, 1)
    return replace(made, joint=joint, pose=pose, wrist=wrist, hands=torch.tensor([hands]))


def test_what_is_seen_from_a_part_is_the_other_one_where_the_joint_has_it(lidded, shapes):
    states = torch.tensor([0.0, 1.2])
    pose = lidded.joint.pose(states)
    seen = shapes.seen_from(
        1, Rigid(pose.rotation[:, None], pose.translation[:, None]), lidded.joint
    )
    inside = torch.tensor([0.0, 0.0, HIGH / 2]).expand(2, 1, 3)
    there = pose.inverse().apply(inside) - shapes.middles[1]
    assert (seen.signed_distance(there) < -0.02).all()
    assert (seen.signed_distance(torch.zeros(2, 1, 3)) < 0).all()


def test_the_first_part_is_filled_so_that_no_hand_is_shut_in(lidded, shapes):
    pose = Rigid(torch.eye(3)[None, None], torch.zeros(1, 1, 3))
    seen = shapes.seen_from(0, pose, lidded.joint)
    assert seen.signed_distance(torch.zeros(1, 1, 3)) < -0.02


def test_a_flat_first_part_is_as_thick_as_the_wall_of_a_sheet():
    corners = torch.tensor([[0.0, 0, 0], [0.1, 0, 0.1], [0.1, 0.1, 0.1], [0, 0.1, 0]])
    sheet = Mesh(corners, torch.tensor([[0, 1, 2], [0, 2, 3]]))
    filled = part_holds.hull(sheet).verts
    across = filled @ torch.tensor([0.5, 0, -0.5]) * 2**0.5
    assert float(across.max() - across.min()) == pytest.approx(SHEET_THICKNESS, abs=1e-5)


@pytest.mark.parametrize(
    ("rises", "start", "stop"),
    [
        (0.0, 20 - GRIP, 30 + GRIP),
        (1.0, 20 - GRIP, 50),
        (-1.0, 0, 30 + GRIP),
        (0.3, 20 - GRIP, 30 + GRIP),
    ],
)
def test_a_part_that_is_lifted_off_is_held_to_the_end_or_from_the_start(rises, start, stop):
    frames = hold_frames(torch.arange(20, 31), 50, rises)
    assert frames.tolist() == list(range(start, stop + 1))


@pytest.mark.parametrize("part", [0, 1])
def test_places_to_grasp_are_of_the_part_that_is_held(lidded, shapes, part):
    pose = Rigid(torch.eye(3)[None, None], torch.zeros(1, 1, 3))
    seen = shapes.seen_from(part, pose, lidded.joint)
    points, _ = seen.surface_points(50, generator=seeded(), to_grasp=True)
    assert seen.take([0], "S").signed_distance(points).abs().max() < 0.002


def test_lids_are_grasped_at_the_edge_that_reaches_over_the_box(lidded, shapes):
    points, front = shapes.scans.points[1] + shapes.middles[1], shapes.middles[0][1] - DEEP / 2
    likely = shapes.scans.grasped[1] == 1
    assert 20 < likely.sum() < len(likely) / 4
    assert (points[likely, 1] < front).all()
    below = (points[:, 2] < HIGH + 0.0009) & (points[:, 1] > front)
    assert (shapes.scans.grasped[1, below] < 1e-3).all()


@pytest.fixture(scope="module")
def opened(lidded):
    """Both hands: the right one, which was drawn flat on the lid, has a hold by which it opens it.

    The left one avoids it.
    """
    return held_at_parts(opening(lidded, (True, True)), lidded.meshes, generator=seeded())


def test_the_hand_is_at_the_lid_and_stays_in_its_place_while_the_lid_moves(opened):
    lid = rigid_part(opened, 1)
    moves = slice(FRAMES // 3, 2 * FRAMES // 3)
    pose = Rigid(lid.rotation[0], lid.translation[0]).inverse()
    at_lid = pose.apply(opened.keypoints()[0, 1])[moves]
    assert (at_lid - at_lid[:1]).norm(dim=-1).max() < 1e-4
    gap = torch.cdist(at_lid[0], lid.points[0]).amin()
    assert gap < 0.02


def test_a_hand_that_lies_flat_on_a_lid_takes_its_edge_to_open_it(lidded, opened):
    lid = HeldHands.of(rigid_part(opened, 1), 1, torch.zeros(3)).take([FRAMES // 2], "N")
    query = SurfaceDistance(lidded.meshes[1]).query(lid.pads)
    touching = query.distance.abs() < 0.004
    motion = lidded.joint.axis.cross(torch.tensor([0.0, -DEEP, 0.0]), dim=0)[None]
    assert unmoved(query.normal, touching, torch.nn.functional.normalize(motion)) < 0.3


def test_a_hold_where_the_other_hand_is_counts_as_deep(lidded, shapes):
    pose = lidded.joint.pose(torch.tensor([0.0, 0.5, 1.0]))
    states = Rigid(pose.rotation[None], pose.translation[None])
    around, middle = shapes.seen_from(1, states, lidded.joint), shapes.middles[1]
    hand = HeldHands.of(opening(lidded), 1, middle).take([0], "N")
    table, out = table_of(opening(lidded), 1, middle), torch.tensor([0.0, -1.0, 0.0])
    alone, met = (
        PartTask(around, table, out, 1.0, other) for other in (None, OtherHands(*hand.spheres))
    )
    assert met.depth(hand) > alone.depth(hand) + 0.01


def test_of_two_hands_one_opens_and_the_other_holds_the_box_beside_it(lidded, opened):
    moving = opened.at_frames(torch.arange(FRAMES // 3, 2 * FRAMES // 3)[None])
    assert overlap_of_hands(moving) < 0.006
    joints = moving.keypoints()[0, 0]
    gaps = SurfaceDistance(lidded.meshes[0]).query(joints).distance.amin(1)
    assert (gaps < 0.025).all()


def test_where_one_hand_is_alone_no_other_one_comes(lidded, monkeypatch):
    monkeypatch.setattr(part_holds, "_hold", lambda task, drawn, _: drawn.take([0], "N"))
    alone = opening(lidded)
    found = held_at_parts(alone, lidded.meshes, generator=seeded())
    assert torch.equal(found.wrist[:, 0], alone.wrist[:, 0])
    assert not torch.equal(found.wrist[:, 1], alone.wrist[:, 1])


def test_a_joint_that_rests_changes_no_hand(lidded):
    still = replace(opening(lidded), joint=torch.zeros(1, FRAMES))
    found = held_at_parts(still, lidded.meshes, generator=seeded())
    assert torch.equal(found.wrist, still.wrist)


def test_hands_are_lifted_out_of_the_table_but_in_their_hold(lidded):
    low = opening(lidded)
    low = replace(low, wrist=low.wrist - torch.tensor([0.0, 0.0, HIGH + 0.1]))
    middle = torch.zeros(3)
    hand = HeldHands.of(low, 1, middle)
    table, hold = table_of(low, 1, middle), torch.arange(20, 40)
    after = over_table(hand, table, hold)
    assert torch.equal(after.wrist[hold], hand.wrist[hold])
    away = torch.cat([torch.arange(10), torch.arange(50, FRAMES)])
    assert (table.depth(*after.spheres).amax(1)[away] < 1e-3).all()
