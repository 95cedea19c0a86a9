from dataclasses import replace

import pytest
import torch

from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.sequence.resample import (
    at_rate,
    averaged,
    hand_over_frames,
    over_frames,
    rotations_over_frames,
    with_hands_earlier,
)
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence


def turn_about_z(angle: torch.Tensor) -> torch.Tensor:
    zero, one = torch.zeros_like(angle), torch.ones_like(angle)
    rows = [angle.cos(), -angle.sin(), zero, angle.sin(), angle.cos(), zero, zero, zero, one]
    return torch.stack(rows, -1).unflatten(-1, (3, 3))


def steady(frames: int, fps: float, seconds: float = 0.0) -> Sequence:
    """A hand and an object that move and turn at constant speed."""
    time = torch.linspace(0, seconds or (frames - 1) / fps, frames)
    place = time[:, None] * torch.tensor([0.1, 0.2, -0.3])
    pose = torch.zeros(frames, 16, 3)
    pose[:, 4, 1] = 2 * time
    hand = HandTrack(
        "right",
        torch.ones(frames, dtype=torch.bool),
        joints=place[:, None].repeat(1, 21, 1),
        pose=pose,
        wrist=place,
    )
    motion = ObjectTrack((), turn_about_z(3 * time)[:, None], place[:, None])
    return Sequence((hand,), motion, fps)


def assert_same_motion(a: Sequence, b: Sequence) -> None:
    for name in ("joints", "pose", "wrist", "valid"):
        torch.testing.assert_close(
            getattr(a.hands[0], name), getattr(b.hands[0], name), rtol=0, atol=2e-6
        )
    torch.testing.assert_close(a.object.rotation, b.object.rotation, rtol=0, atol=2e-6)
    torch.testing.assert_close(a.object.translation, b.object.translation, rtol=0, atol=2e-6)


def test_the_same_rate_is_the_same_sequence():
    sequence = steady(10, 30.0)
    assert at_rate(sequence, 30.0) is sequence
    assert over_frames(sequence, 10) is sequence


@pytest.mark.parametrize(("frames", "fps"), [(13, 25.0), (13, 15.0), (121, 120.0), (2, 120.0)])
def test_steady_motion_stays_steady_at_another_rate_and_back(frames, fps):
    sequence = steady(frames, fps)
    thirty = at_rate(sequence, 30.0)
    seconds = (frames - 1) / fps
    assert (thirty.frames - 1) / thirty.fps == pytest.approx(seconds, rel=1e-6)
    assert_same_motion(thirty, steady(thirty.frames, thirty.fps, seconds))
    back = over_frames(thirty, frames)
    assert back.fps == fps
    assert_same_motion(back, sequence)


def test_the_rate_is_met_up_to_half_a_frame_over_the_whole():
    assert at_rate(steady(61, 25.0), 30.0).fps == 30.0
    assert abs(at_rate(steady(60, 25.0), 30.0).fps - 30.0) * 59 / 25 <= 0.5


def test_twice_the_rate_keeps_every_old_frame():
    generator = torch.Generator().manual_seed(0)
    joints = torch.randn(9, 21, 3, generator=generator)
    hand = HandTrack("left", torch.ones(9, dtype=torch.bool), joints=joints)
    turns = axis_angle_to_matrix(torch.randn(9, 1, 3, generator=generator))
    sequence = Sequence((hand,), replace(steady(9, 15.0).object, rotation=turns), 15.0)
    double = at_rate(sequence, 30.0)
    assert double.frames == 17
    assert torch.equal(double.hands[0].joints[::2], joints)
    assert torch.equal(double.object.rotation[::2], turns)
    assert torch.equal(rotations_over_frames(turns, 17)[::2], turns)
    assert torch.equal(over_frames(double, 9).hands[0].joints, joints)


def test_frames_are_valid_where_the_nearest_old_frame_is_and_gaps_do_not_spread():
    sequence = steady(5, 30.0)
    hand = sequence.hands[0]
    hand.joints[2] = torch.nan
    hand.valid[2] = False
    motion = replace(sequence.object, valid=hand.valid[:, None])
    fine = over_frames(replace(sequence, object=motion), 17)
    assert (~fine.hands[0].valid).nonzero().flatten().tolist() == [6, 7, 8, 9]
    assert torch.equal(fine.object.valid[:, 0], fine.hands[0].valid)
    assert bool(fine.hands[0].joints.isfinite().all())


def test_a_single_frame_has_no_rate():
    sequence = steady(1, 60.0, seconds=1.0)
    assert at_rate(sequence, 30.0) is sequence
    with pytest.raises(InputError, match="got 1 to 5"):
        over_frames(sequence, 5)


@pytest.mark.parametrize(("given", "asked"), [(0.0333, 30.0), (1e-40, 30.0), (1.0, 1e300)])
def test_more_frames_than_an_hour_has_are_refused_before_they_are_made(given, asked):
    sequence = steady(146, given, seconds=1.0)
    with pytest.raises(InputError, match="at most 108000 frames"):
        at_rate(sequence, asked)


@pytest.mark.parametrize("delay", [3, -3, 2.5])
def test_hands_that_come_earlier_are_those_of_later_frames(delay):
    sequence = steady(20, 30.0)
    earlier = with_hands_earlier(sequence, delay).hands[0]
    time = torch.arange(20) + delay
    inside = (time >= 0) & (time <= 19)
    assert torch.equal(earlier.valid, inside)
    place = time[inside, None] / 30 * torch.tensor([0.1, 0.2, -0.3])
    torch.testing.assert_close(earlier.wrist[inside], place, rtol=0, atol=2e-6)
    torch.testing.assert_close(earlier.pose[inside, 4, 1], 2 * time[inside] / 30)
    assert with_hands_earlier(sequence, 0.0) is sequence


def test_keypoints_without_confidence_do_not_spread_over_frames_between():
    sequence = steady(20, 25.0)
    hand, trust = sequence.hands[0], torch.ones(20, 21)
    trust[4], trust[9, 3] = 0.0, 0.0
    joints = hand.joints.masked_fill((trust == 0)[..., None], 9.0)
    holes = replace(sequence, hands=(replace(hand, joints=joints, confidence=trust),))
    for change in (lambda s: at_rate(s, 30.0), lambda s: with_hands_earlier(s, 0.5)):
        found, wanted = (change(each).hands[0].joints for each in (holes, sequence))
        torch.testing.assert_close(found, wanted, rtol=0, atol=2e-6)


@pytest.mark.parametrize("lost", [8, 9])
def test_a_lost_frame_is_one_lost_frame_under_a_delay_of_half_a_frame(lost):
    sequence = steady(20, 30.0)
    valid = torch.arange(20) != lost
    holes = replace(sequence, hands=(replace(sequence.hands[0], valid=valid),))
    earlier = with_hands_earlier(holes, 0.5).hands[0]
    assert torch.nonzero(~earlier.valid)[:, 0].tolist() == [lost - 1, 19]


@pytest.mark.parametrize("delay", [20, -40.0, float("nan")])
def test_a_delay_that_leaves_no_hand_is_refused(delay):
    with pytest.raises(InputError, match="leaves no frame of 20 with a hand"):
        with_hands_earlier(steady(20, 30.0), delay)


@pytest.mark.parametrize(("seen", "kept"), [([14], [3]), ([13, 14, 15, 16, 17], [4])])
def test_a_hand_in_a_single_frame_is_not_lost_at_a_lower_rate(seen, kept):
    joints = torch.arange(30.0)[:, None, None].expand(30, 21, 3)
    valid = torch.isin(torch.arange(30), torch.tensor(seen))
    hand = HandTrack("right", valid, joints=joints)
    fine = Sequence((hand,), ObjectTrack.resting((), 30), 120.0)
    for coarse in (at_rate(fine, 30.0).hands[0], hand_over_frames(hand, 8)):
        assert coarse.valid.nonzero()[:, 0].tolist() == kept


def test_a_hand_with_noisy_rotations_keeps_its_size():
    pose = 0.4 * torch.randn(120, 16, 3, generator=torch.Generator().manual_seed(0))
    shaped = load_hand("right").shaped(torch.zeros(10))
    joints = shaped.joints_from_rotations(axis_angle_to_matrix(pose), torch.zeros(120, 3))
    valid = torch.ones(120, dtype=torch.bool)
    hand = HandTrack("right", valid, joints=joints, pose=pose, wrist=torch.zeros(120, 3))
    other = replace(hand, joints=joints.flip(0))  # not of the pose
    alone = ObjectTrack((), torch.zeros(120, 0, 3, 3), torch.zeros(120, 0, 3))

    def length(hand: HandTrack) -> float:
        assert hand.joints is not None
        return float((hand.joints[:, 9] - hand.joints[:, 0]).norm(dim=-1).mean())

    found, left = (
        averaged(Sequence((track,), alone, 120.0), 30.0).hands[0] for track in (hand, other)
    )
    assert length(found) == pytest.approx(length(hand), rel=1e-4)
    assert length(left) < 0.97 * length(other)
