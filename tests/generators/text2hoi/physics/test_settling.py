from dataclasses import replace

import pytest
import torch
import trimesh
from draws import seeded
from made_actions import box_actions, on_object

from geneoh.generators.text2hoi.physics import settling
from geneoh.generators.text2hoi.physics.held_hands import HeldHands, frames_of_motion, table_of
from geneoh.generators.text2hoi.physics.settling import moved_out_of, settled, shifts_out, solid_of
from geneoh.generators.text2hoi.physics.standing import stand_on_table
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.spheres import hand_spheres
from geneoh.synthesis.grasping.contact_pads import Obstacles, OtherHands
from geneoh.synthesis.grasping.grasp_types import FINGER_MEAN

RADIUS, HEIGHT = 0.03, 0.16


@pytest.fixture(scope="module")
def rod():
    """A rod that stands on the table."""
    made = trimesh.creation.cylinder(RADIUS, HEIGHT, sections=48)
    return stand_on_table(from_trimesh(made), generator=seeded())


@pytest.fixture(scope="module", autouse=True)
def grid(rod):
    """The rod's grid, which takes longest, made once for all tests."""
    found = solid_of(rod)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settling, "solid_of", lambda _: found)
        yield found


def sunk(rod, side: int):
    """An action whose hand goes around the rod, 12 mm too deep, and rises with it."""
    actions = on_object(box_actions(["lift"], frames=24, hands=(side == 0, side == 1)), rod)
    # the right hand's fingers point along -x and its palm to -y: the rod is below the palm
    place = torch.tensor([0.08, RADIUS + 0.006, 0.09])
    pose = torch.cat([torch.zeros(1, 3), FINGER_MEAN])
    if side == 0:
        place, pose = place * torch.tensor([-1.0, 1, 1]), pose * torch.tensor([1.0, -1, -1])
    wrist = torch.zeros(1, 2, 24, 3)
    wrist[:, side] = place + actions.translation
    poses = torch.zeros(1, 2, 24, 16, 3)
    poses[:, side] = pose
    return replace(actions, wrist=wrist, pose=poses)


def at_rod(actions, side: int):
    """Keypoints of a hand in all frames from where the rod stands, metres."""
    return actions.keypoints()[0, side] - actions.translation[0, :, None]


def depth_of(actions, rod, side: int) -> float:
    """Depth of the deepest keypoint, metres, over all frames; below zero for the nearest gap."""
    verts = rod.mesh.verts @ rod.rotation.T + rod.shift
    field = SurfaceDistance(Mesh(verts, rod.mesh.faces))
    return float(-field.query(at_rod(actions, side).flatten(0, 1)).distance.min())


def test_the_grid_is_the_standing_object(rod, grid):
    solids, middle = grid
    distance = solids.signed_distance((rod.points - middle)[None])
    assert distance.abs().amax() < 1e-3
    assert solids.signed_distance(torch.zeros(1, 1, 3))[0, 0] < -0.02


@pytest.mark.parametrize("side", [0, 1])
def test_a_hand_that_sinks_in_comes_out_and_holds(rod, side):
    before = sunk(rod, side)
    after = settled(before, rod, generator=seeded())
    assert depth_of(before, rod, side) > 0
    assert -0.015 < depth_of(after, rod, side) < 0
    apart = at_rod(after, side)
    held = apart - apart[:1]
    assert held.abs().amax() < 1e-4  # still at rest at the object, as it was drawn


def test_a_hand_that_never_touches_stays_as_it_is_but_out_of_the_table(rod):
    actions = sunk(rod, 1)
    away = replace(actions, wrist=actions.wrist + torch.tensor([0.5, 0.0, 0.0]))
    assert torch.equal(settled(away, rod, generator=seeded()).pose, away.pose)
    low = replace(
        away, wrist=away.wrist - torch.tensor([0.0, 0.0, 0.1]) * away.hands[..., None, None]
    )
    raised = settled(low, rod, generator=seeded())
    assert low.keypoints()[0, 1, :, :, 2].amin() < -0.02
    assert raised.keypoints()[0, 1, :, :, 2].amin() > 0
    assert raised.wrist.isclose(low.wrist, atol=1e-6)[..., :2].all()


@pytest.mark.parametrize("side", [0, 1])
def test_the_table_is_where_the_world_has_it(rod, side):
    actions, middle = sunk(rod, side), torch.tensor([0.1, 0.2, 0.3])
    turn = axis_angle_to_matrix(torch.tensor([[0.3, -0.5, 0.2]])).expand(1, 24, 3, 3)
    actions = replace(actions, rotation=turn)
    hand, table = HeldHands.of(actions, side, middle), table_of(actions, side, middle)
    depth = table.depth(hand.wrist[:, None], torch.zeros(24, 1))[:, 0]
    torch.testing.assert_close(-depth, actions.wrist[0, side, :, 2], atol=1e-6, rtol=1e-4)


def test_a_hand_that_reaches_through_the_table_holds_the_object_over_it(rod):
    side = 0
    before = sunk(rod, side)
    down = torch.tensor([0.0, 0.0, -0.06]) * before.hands[:, :, None, None]
    before = replace(before, wrist=before.wrist + down)
    after = settled(before, rod, generator=seeded())
    assert before.keypoints()[0, side, :, :, 2].amin() < -0.02
    assert after.keypoints()[0, side, :, :, 2].amin() > 0
    assert depth_of(after, rod, side) < 0
    assert (at_rod(after, side)[..., :2].norm(dim=-1) - RADIUS).amin() < 0.015


def test_a_hand_that_slides_on_what_it_carries_keeps_its_place(rod):
    side = 1
    before = sunk(rod, side)
    slide = torch.linspace(-0.02, 0.02, 24)[:, None] * torch.tensor([0.0, 0, 1])
    before = replace(before, wrist=before.wrist + slide * before.hands[:, :, None, None])
    after = settled(before, rod, generator=seeded())
    apart = at_rod(after, side)
    assert (apart - apart[12]).abs().amax() < 1e-4
    assert depth_of(after, rod, side) < 0


def test_a_hand_at_an_object_goes_back_to_where_it_was(rod):
    actions, middle = sunk(rod, 0), torch.tensor([0.1, 0.2, 0.3])
    turn = axis_angle_to_matrix(torch.tensor([[0.3, -0.5, 0.2]])).expand(1, 24, 3, 3)
    actions = replace(actions, rotation=turn)
    back = HeldHands.of(actions, 0, middle).into(actions, 0, middle)
    torch.testing.assert_close(back.pose, actions.pose, atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(back.wrist, actions.wrist, atol=1e-6, rtol=1e-4)


def test_an_object_moves_before_and_after_its_steps_and_turns():
    actions = box_actions(["lift"], frames=10)
    shift, turn = torch.zeros(1, 10, 3), torch.zeros(10, 3)
    shift[:, 3:], turn[7:, 2] = 0.01, 0.1
    still = replace(actions, translation=shift, rotation=axis_angle_to_matrix(turn)[None])
    assert torch.nonzero(frames_of_motion(still))[:, 0].tolist() == [2, 3, 6, 7]


def flat_hands(*places: tuple[float, float, float]) -> HeldHands:
    return HeldHands(torch.zeros(len(places), 16, 3), torch.tensor(places))


def test_a_hand_in_another_one_makes_way_by_no_more_than_it_needs():
    hands = flat_hands((0.0, 0.012, 0.0), (0.0, 0.5, 0.0))
    other = OtherHands(*flat_hands((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)).spheres)
    assert other.depth(*hands.spheres)[0].max() > 0.01
    found = moved_out_of(hands, other)
    assert other.depth(*found.spheres).max() < 0.002
    assert (found.wrist[0] - hands.wrist[0]).norm() < 0.06
    assert found.wrist[1].equal(hands.wrist[1])


def test_the_way_out_is_as_long_as_the_hand_is_deep_and_nothing_outside(rod, grid):
    solids, middle = grid
    table = table_of(sunk(rod, 1), 1, middle)
    inside = HeldHands.of(sunk(rod, 1), 1, middle)
    far = replace(inside, wrist=inside.wrist + torch.tensor([0.0, 0.3, 0.0]))
    assert not shifts_out(solids, far, Obstacles(table)).any()
    found = replace(inside, wrist=inside.wrist + shifts_out(solids, inside, Obstacles(table)))
    assert depth_in(solids, inside) > 0.01
    assert depth_in(solids, found) < 0.004


def depth_in(solids, hands: HeldHands) -> float:
    """How deep the spheres of hands are in an object, metres."""
    centers, radii = hands.spheres
    distance = solids.signed_distance(centers.flatten(0, 1)[None]).view(radii.shape)
    return float((radii - distance).max())


def test_the_other_hand_is_of_the_other_side():
    hand, left = flat_hands((0.05, 0.02, 0.01)), load_hand("left").shaped(torch.zeros(10))
    joints = left.posed(mirror_axis_angle(hand.pose), mirror_points(hand.wrist)).joints
    centers, _ = hand_spheres(joints, torch.ones(1, 1))
    found = hand.mirrored_spheres.centers[:, : centers.shape[1]]  # then come those of the wrist
    torch.testing.assert_close(found, centers, atol=1e-5, rtol=0)
