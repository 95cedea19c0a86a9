"""Means over the time of a frame at a lower rate."""

from dataclasses import replace

import pytest
import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.resample import at_rate, averaged
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

FRAMES, FPS = 60, 120.0


def steady() -> Sequence:
    """A hand and an object that move and turn evenly."""
    time = torch.arange(FRAMES, dtype=torch.float32)[:, None]
    joints = torch.linspace(0, 0.1, 63).view(21, 3) + 0.001 * time[:, None]
    pose = (0.004 * time[:, None] * torch.tensor([1.0, 2.0, -1.0])).expand(-1, 16, 3)
    turn = axis_angle_to_matrix(0.01 * time * torch.tensor([0.0, 0.6, 0.8]))[:, None]
    hand = HandTrack("right", torch.ones(FRAMES).bool(), joints, pose, joints[:, 0])
    return Sequence((hand,), ObjectTrack((), turn, 0.002 * time.expand(-1, 3)[:, None]), FPS)


@pytest.mark.parametrize("fps", [30.0, 50.0, 100.0])
def test_what_moves_evenly_stays_as_it_is_to_the_ends(fps):
    given = steady()
    found = averaged(given, fps)
    for name in ("joints", "pose", "wrist"):
        wanted = getattr(given.hands[0], name)
        torch.testing.assert_close(getattr(found.hands[0], name), wanted, atol=1e-5, rtol=0)
    torch.testing.assert_close(found.object.rotation, given.object.rotation, atol=1e-5, rtol=0)
    torch.testing.assert_close(
        found.object.translation, given.object.translation, atol=1e-6, rtol=0
    )
    assert found.fps == FPS


@pytest.mark.parametrize(("fps", "left"), [(60.0, 0.375**0.5), (30.0, 0.21875**0.5)])
def test_white_noise_falls_as_in_a_mean(fps, left):
    given = steady()
    noise = 0.01 * torch.randn(FRAMES, 21, 3, generator=torch.Generator().manual_seed(0))
    shaken = replace(given.hands[0], joints=given.hands[0].joints + noise)
    found = averaged(replace(given, hands=(shaken,)), fps)
    off = found.hands[0].joints - given.hands[0].joints
    assert float(off[4:-4].std() / noise[4:-4].std()) == pytest.approx(left, rel=0.05)


def test_a_lower_rate_is_left_as_it_is():
    given = steady()
    assert averaged(given, 120.0) is given
    assert averaged(given, 240.0) is given


def test_gaps_stay_marked_and_lend_no_numbers():
    given = steady()
    hand = given.hands[0]
    valid = (torch.arange(FRAMES) < 20) | (torch.arange(FRAMES) > 24)
    holes = replace(hand, valid=valid, joints=hand.joints.masked_fill(~valid[:, None, None], 9.0))
    found = averaged(replace(given, hands=(holes,)), 30.0).hands[0]
    assert torch.equal(found.valid, valid)
    torch.testing.assert_close(found.joints, hand.joints, atol=1e-5, rtol=0)


@pytest.mark.parametrize("first", range(4))
def test_a_hand_that_is_found_in_every_fourth_frame_is_found_at_a_quarter_of_the_rate(first):
    given = steady()
    rare = replace(given.hands[0], valid=torch.arange(FRAMES) % 4 == first)
    slow = at_rate(averaged(replace(given, hands=(rare,)), 30.0), 30.0)
    assert bool(slow.hands[0].valid[1:-1].all())


def test_keypoints_without_confidence_lend_no_numbers():
    given = steady()
    hand = given.hands[0]
    confidence = torch.ones(FRAMES, 21)
    confidence[10:13] = 0.0
    confidence[20::5, 7] = 0.0
    joints = hand.joints.masked_fill((confidence == 0)[..., None], 9.0)
    holes = replace(hand, joints=joints, confidence=confidence)
    slow, wanted = (
        at_rate(averaged(replace(given, hands=(each,)), 30.0), 30.0).hands[0].joints
        for each in (holes, hand)
    )
    torch.testing.assert_close(slow, wanted, atol=1e-5, rtol=0)


def test_frames_without_hand_or_pose_do_not_smooth_those_with_them():
    given, seen = steady(), torch.arange(FRAMES) % 4 == 0
    noise = 0.01 * torch.randn(FRAMES, 21, 3, generator=torch.Generator().manual_seed(0))
    rare = replace(given.hands[0], valid=seen, joints=given.hands[0].joints + noise)
    motion = replace(given.object, translation=noise[:, :1], valid=seen[:, None])
    found = averaged(replace(given, hands=(rare,), object=motion), 30.0)
    torch.testing.assert_close(found.hands[0].joints[seen], rare.joints[seen])
    torch.testing.assert_close(found.object.translation[seen], motion.translation[seen])
