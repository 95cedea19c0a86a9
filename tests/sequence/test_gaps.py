import math
from dataclasses import replace

import torch

from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.gaps import (
    Carrier,
    blendable,
    fill_gaps,
    fill_object,
    filled_poses,
    moved,
    observed_around,
    without_placeholders,
)
from geneoh.sequence.sequence import HandTrack, ObjectTrack

T = 6
TIME = torch.arange(T, dtype=torch.float32)
TURNING = torch.zeros(T, 16, 3)
TURNING[:, 0, 2] = 0.3 * TIME
MOVING = TIME[:, None] * torch.tensor([1.0, 2, 3])
HAND = HandTrack(
    "right",
    torch.ones(T, dtype=torch.bool),
    joints=MOVING[:, None].repeat(1, 21, 1),
    pose=TURNING,
    wrist=MOVING,
    confidence=torch.ones(T, 21),
)


def lost(*frames: int) -> HandTrack:
    valid = torch.ones(T, dtype=torch.bool)
    valid[list(frames)] = False
    blank = [torch.where(valid.reshape(-1, *[1] * (x.ndim - 1)), x, math.nan) for x in fields(HAND)]
    joints, pose, wrist, confidence = blank
    return replace(HAND, valid=valid, joints=joints, pose=pose, wrist=wrist, confidence=confidence)


def fields(hand: HandTrack) -> list[torch.Tensor]:
    found = [hand.joints, hand.pose, hand.wrist, hand.confidence]
    return [value for value in found if value is not None]


def test_steady_motion_is_restored_inside_a_gap():
    hand = lost(1, 2, 4)
    filled = fill_gaps(hand)
    for got, want in zip(fields(filled), fields(HAND), strict=True):
        torch.testing.assert_close(got, want, rtol=0, atol=1e-6)
    assert torch.equal(filled.valid, hand.valid)


def test_the_hand_is_held_before_the_first_and_after_the_last_observation():
    filled = fill_gaps(lost(0, 1, 5))
    for got, want in zip(fields(filled), fields(HAND), strict=True):
        assert torch.equal(got[:3], want[[2, 2, 2]])
        assert torch.equal(got[5], want[4])


def test_observed_frames_are_not_touched():
    generator = torch.Generator().manual_seed(0)
    pose = torch.randn(T, 16, 3, generator=generator) * 4  # far beyond half a turn
    hand = replace(HAND, pose=pose, valid=torch.tensor([True, False, True, True, False, True]))
    filled = fill_gaps(hand)
    assert filled.pose is not None
    assert torch.equal(filled.pose[hand.valid], pose[hand.valid])


def test_rotations_go_the_shorter_way():
    pose = torch.zeros(3, 16, 3)
    pose[0, 0, 0], pose[2, 0, 0] = 3.0, -3.0  # 0.28 apart through pi, 6 the other way
    hand = HandTrack("left", torch.tensor([True, False, True]), pose=pose, wrist=torch.zeros(3, 3))
    filled = fill_gaps(hand)
    assert filled.pose is not None
    torch.testing.assert_close(filled.pose[1, 0, 0].abs(), torch.tensor(math.pi), atol=1e-4, rtol=0)


def test_one_observation_is_held_everywhere():
    around = observed_around(torch.tensor([False, False, True, False]))
    assert around.before.tolist() == around.after.tolist() == [2, 2, 2, 2]
    assert around.fraction.tolist() == [0, 0, 0, 0]


def test_a_track_without_gaps_is_returned_as_it_is():
    assert fill_gaps(HAND) is HAND


def test_what_has_no_confidence_is_mixed_with_nothing():
    trust = torch.ones(T, 21)
    trust[2], trust[3, 5], trust[:, 9], trust[0, 7] = 0.0, 0.0, 0.0, 0.0
    joints = HAND.joints.masked_fill((trust == 0)[..., None], 9.0)
    found = blendable(replace(HAND, joints=joints, confidence=trust))
    wanted = HAND.joints.clone()
    wanted[:, 9], wanted[0, 7] = 9.0, wanted[1, 7]  # what is nowhere known, and what is held
    torch.testing.assert_close(found.joints, wanted)
    assert found.valid.tolist() == [True, True, False, True, True, True]
    assert torch.equal(found.confidence[3:], trust[3:])


def test_filled_poses_are_told_part_by_part():
    turn = torch.eye(3).expand(5, 3, 3, 3)
    seen = torch.tensor([[1, 1, 0], [0, 1, 0], [0, 1, 0], [1, 1, 0], [1, 1, 0]]).bool()
    ball = Mesh(torch.eye(3), torch.tensor([[0, 1, 2]]))
    motion = fill_object(ObjectTrack((ball,) * 3, turn, torch.zeros(5, 3, 3)), seen)
    assert list(filled_poses(motion)) == [
        "2 frames without a pose of part 1 of the object, filled from the frames around, and where "
        "a hand moves it by the hand",
        "part 3 of the object was never seen: its poses say nothing, the hand is cleaned without "
        "it",
    ]


def test_poses_that_were_filled_before_keep_their_mark_beside_ones_that_are_nan():
    place = torch.arange(1.0, 6.0)[:, None, None].expand(5, 1, 3).clone()
    place[3] = math.nan
    valid = torch.tensor([[True], [False], [True], [True], [True]])
    turn = torch.eye(3).expand(5, 1, 3, 3)
    found = fill_object(ObjectTrack((), turn, place, valid))
    assert found.valid[:, 0].tolist() == [True, False, True, False, True]
    assert found.translation[:, 0, 0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_poses_that_stayed_the_identity_were_not_observed():
    turn, place = torch.eye(3).repeat(6, 3, 1, 1), torch.full((6, 3, 3), 0.5)
    place[2:4] = 0  # the first part leaps to the origin and back, the second begins there
    place[:, 1] = 0.01 * torch.arange(6.0)[:, None]
    place[4:, 2] = 0  # and the third ends there
    found = fill_object(ObjectTrack((), turn, place))
    assert found.valid[:, 0].tolist() == [True, True, False, False, True, True]
    assert bool(found.valid[:, 1].all())
    assert found.valid[:, 2].tolist() == [True, True, False, False, False, False]
    assert torch.equal(found.translation[:, [0, 2]], place[:1, [0, 2]].expand(6, 2, 3))


def test_poses_that_stayed_the_identity_near_the_origin_are_told_by_the_turn_after_them():
    turn, place = torch.eye(3).repeat(6, 1, 1, 1), torch.zeros(6, 1, 3)
    turn[3:] = axis_angle_to_matrix(torch.tensor([0.0, 1.2, 0.0]))
    place[3:] = 0.1
    found = fill_object(ObjectTrack((), turn, place))
    assert found.valid[:, 0].tolist() == [False, False, False, True, True, True]
    assert torch.equal(found.translation, place[3:4].expand(6, 1, 3))


def test_an_object_whose_poses_begin_with_the_identity_rests_there():
    """Poses that are relative to the first frame turn a mesh about the origin of the world."""
    verts = torch.tensor([[2.0, 0, 0], [2.1, 0, 0], [2, 0.1, 0]])
    mesh = Mesh(verts, torch.tensor([[0, 1, 2]]))
    turn, middle = torch.eye(3).repeat(6, 1, 1, 1), verts.mean(0)
    turn[2:] = axis_angle_to_matrix(torch.tensor([0.0, 0.0, 0.5]))
    place = (middle - turn @ middle).reshape(6, 1, 3)
    assert fill_object(ObjectTrack((mesh,), turn, place)).valid is None


def carried(share: list[float]) -> Carrier:
    """What moves and turns as the hand does not, and carries it so surely in each frame."""
    turn = axis_angle_to_matrix(0.4 * TIME[:, None] * torch.tensor([0.0, 0.0, 1.0]))
    return Carrier(Rigid(turn, 0.2 * MOVING**2), torch.tensor(share).float())


def test_a_hand_that_is_carried_stays_where_it_is_on_its_carrier():
    carrier = carried([0, 1, 0, 1, 0, 0])
    rest = replace(HAND, joints=torch.ones(T, 21, 3), wrist=torch.ones(T, 3), pose=0 * TURNING)
    whole = moved(rest, carrier.pose)
    valid = torch.tensor([True, True, False, True, False, False])
    found = fill_gaps(replace(whole, valid=valid), carrier)
    for got, want in zip(fields(found), fields(whole), strict=True):
        torch.testing.assert_close(got, want, rtol=0, atol=1e-5)
    assert torch.equal(found.joints[valid], whole.joints[valid])
    confidence = torch.ones(T, 21)
    confidence[0, 5] = 0.0  # a keypoint that another frame lacks is carried like the others
    found = blendable(replace(whole, valid=valid, confidence=confidence), carrier)
    torch.testing.assert_close(found.joints[1:], whole.joints[1:], rtol=0, atol=1e-5)


def test_a_hand_that_is_carried_at_one_end_of_a_gap_alone_leaves_its_carrier():
    hand = lost(2, 3)
    still = fill_gaps(hand)
    found, whole = (fill_gaps(hand, carried([0, end, 0, 0, 1, 0])) for end in (0, 1))
    expected = still.joints + (whole.joints - still.joints) / 3
    torch.testing.assert_close(found.joints[2], expected[2], rtol=0, atol=1e-6)
    assert fill_gaps(hand, carried([0.0] * T)).joints.equal(still.joints)


def test_placeholders_are_interpolated_and_never_seen_keypoints_are_amid_the_others():
    joints = torch.arange(5.0)[:, None, None].expand(5, 21, 3).clone()
    joints[:, 1] += 10.0
    confidence = torch.ones(5, 21)
    confidence[1:3, 4], confidence[:, 8], confidence[4] = 0.0, 0.0, 0.0
    spoilt = joints.masked_fill(confidence[..., None] == 0, torch.nan)
    valid = torch.ones(5, dtype=torch.bool)
    found = without_placeholders(HandTrack("right", valid, joints=spoilt, confidence=confidence))
    torch.testing.assert_close(found.joints[:4, 4], joints[:4, 4])
    torch.testing.assert_close(
        found.joints[0, 8], joints[0, [p for p in range(21) if p != 8]].mean(0)
    )
    assert bool(found.joints[4].isnan().all())  # a frame without a hand
    assert torch.equal(found.confidence, confidence)


def test_a_track_without_placeholders_stays_as_it_is():
    joints, valid = torch.zeros(3, 21, 3), torch.ones(3, dtype=torch.bool)
    for confidence in (None, torch.ones(3, 21)):
        hand = HandTrack("right", valid, joints=joints, confidence=confidence)
        assert without_placeholders(hand) is hand
