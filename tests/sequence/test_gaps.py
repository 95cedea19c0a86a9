import math
from dataclasses import replace

import pytest
import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.gaps import (
    CURVED,
    LONGEST_CURVE,
    fill_gaps,
    fill_gaps_on_curves,
    observed_around,
)
from geneoh.sequence.sequence import HandTrack

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


def path_of(motion: torch.Tensor, valid: torch.Tensor) -> HandTrack:
    """A hand whose wrist moves along x as given and turns about z by as many radians."""
    wrist = torch.zeros(len(motion), 3)
    wrist[:, 0] = motion
    pose = torch.zeros(len(motion), 16, 3)
    pose[:, 0, 2] = motion
    return HandTrack("right", valid, pose=pose, wrist=wrist)


def test_steady_motion_is_restored_on_curves_too():
    filled = fill_gaps_on_curves(lost(1, 2, 4))
    for got, want in zip(fields(filled), fields(HAND), strict=True):
        torch.testing.assert_close(got, want, rtol=0, atol=1e-5)


def test_a_curve_goes_half_of_the_way_to_the_parabola():
    time = torch.arange(12, dtype=torch.float32)
    motion, valid = 0.01 * (time - 5.5) ** 2, torch.ones(12, dtype=torch.bool)
    valid[4:8] = False
    straight, curve = (fill(path_of(motion, valid)) for fill in (fill_gaps, fill_gaps_on_curves))
    # speeds over two frames are those of a frame before the gap and of one after it: the curve of
    # full speeds is lower than the parabola by one frame's change of speed
    wanted = motion[4:8] - straight.wrist[4:8, 0]
    got = curve.wrist[4:8, 0] - straight.wrist[4:8, 0]
    assert bool((got / wanted > CURVED).all())
    assert bool((got / wanted < 1.6 * CURVED).all())
    turned = axis_angle_to_matrix(curve.pose[4:8, 0])
    want = axis_angle_to_matrix(torch.stack([0 * got, 0 * got, curve.wrist[4:8, 0]], dim=-1))
    torch.testing.assert_close(turned, want, atol=1e-5, rtol=0)


@pytest.mark.parametrize("valid", [[0, 1, 0, 0, 1, 0], [1, 0, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0]])
def test_where_nothing_tells_a_speed_the_line_is_straight(valid):
    valid = torch.tensor(valid, dtype=torch.bool)
    hand = path_of(0.1 * TIME**2, valid)
    straight, curve = fill_gaps(hand), fill_gaps_on_curves(hand)
    torch.testing.assert_close(curve.wrist, straight.wrist, atol=1e-7, rtol=0)
    torch.testing.assert_close(curve.pose, straight.pose, atol=1e-5, rtol=0)


def test_the_bend_of_a_long_gap_stays_that_of_a_short_one():
    def bend(gap: int) -> float:
        valid = torch.ones(gap + 6, dtype=torch.bool)
        valid[3:-3] = False
        motion = 0.01 * torch.arange(gap + 6, dtype=torch.float32)
        motion[-3:] = motion[2] - 0.01 * torch.arange(3, dtype=torch.float32)
        hand = path_of(motion, valid)
        off = fill_gaps_on_curves(hand).wrist - fill_gaps(hand).wrist
        return float(off.abs().max())

    assert bend(5) < bend(9) < bend(LONGEST_CURVE - 1)
    assert bend(60) < 1.1 * bend(LONGEST_CURVE - 1)


def test_curves_leave_observed_frames_and_whole_tracks_alone():
    assert fill_gaps_on_curves(HAND) is HAND
    hand = lost(1, 4)
    filled = fill_gaps_on_curves(hand)
    for got, want in zip(fields(filled), fields(hand), strict=True):
        assert torch.equal(got[hand.valid], want[hand.valid])
