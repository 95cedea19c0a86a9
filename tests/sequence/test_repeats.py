"""Poses of an object that a slower sensor or video repeats."""

from dataclasses import replace

import pytest
import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.repeats import repeated_poses, without_repeats
from geneoh.sequence.sequence import ObjectTrack

FRAMES = 60


def swing() -> ObjectTrack:
    """An object that moves and turns all the while."""
    angle = torch.linspace(0, 3, FRAMES)[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
    time = torch.linspace(0, 0.4, FRAMES)[:, None]
    place = torch.stack([time, time.square(), 0 * time], dim=-1)
    return ObjectTrack((), axis_angle_to_matrix(angle), place)


def nearest(motion: ObjectTrack, rate: int) -> ObjectTrack:
    """The track at some frames a second, brought to 30 by the last pose that there is."""
    at = torch.arange(FRAMES) * rate // 30 * 30 // rate
    return replace(motion, rotation=motion.rotation[at], translation=motion.translation[at])


def rested(motion: ObjectTrack, start: int, length: int) -> ObjectTrack:
    """The track with a rest of some frames after the frame `start`, from which it goes on."""
    at = torch.arange(FRAMES)
    at[start + 1 :] = (at[start + 1 :] - length).clamp(min=start)
    return replace(motion, rotation=motion.rotation[at], translation=motion.translation[at])


def beside(first: ObjectTrack, second: ObjectTrack) -> ObjectTrack:
    """Both as the parts of one object."""
    rotation = torch.cat([first.rotation, second.rotation], dim=1)
    translation = torch.cat([first.translation, second.translation], dim=1)
    return ObjectTrack((), rotation, translation)


def test_poses_of_a_slower_video_are_those_between():
    moves = swing()
    motion = beside(moves, moves)
    for rate, count in ((15, 28), (10, 36)):
        slow = beside(nearest(moves, rate), moves)
        filled, told = without_repeats(slow)
        assert int((~filled.valid).sum()) == count
        off, before = (
            (each.translation - motion.translation)[4:-6].norm(dim=-1).max()
            for each in (filled, slow)
        )
        assert off < 0.05 * before  # the last pose stays until the end, as at rest
    assert len(told) == 1
    assert told[0].endswith("in 36 frames: taken as missing")


def test_an_object_that_starts_and_stops_follows_a_curve_between_its_poses():
    phase = 2 * torch.pi * torch.arange(FRAMES) / FRAMES
    place = torch.stack([0.1 * phase, -0.1 * phase.cos(), 0 * phase], dim=-1)
    motion = replace(swing(), translation=place[:, None])
    filled, _ = without_repeats(nearest(motion, 5))
    off = (filled.translation - motion.translation)[6:-12].norm(dim=-1)
    assert off.max() < 0.001  # 0.005 on straight lines


def test_three_stops_are_enough_where_they_are_brief():
    """Such as those of a short carry whose poses come ten times a second; rests last longer."""
    for length, expected in ((2, 6), (10, 0)):
        slow = swing()
        for start in (40, 25, 10):
            slow = rested(slow, start, length)
        assert int(repeated_poses(slow).sum()) == expected


def test_rests_and_single_repeats_are_motion():
    motion = swing()
    assert without_repeats(motion)[0] is motion
    halting = rested(rested(motion, 30, 9), 10, 9)
    assert without_repeats(halting)[0] is halting
    slow = rested(nearest(motion, 15), 40, 9)
    assert not repeated_poses(slow)[42:49].any()
    steps = torch.tensor([0.02, 0.02, 0.0, 0.0, 0.001, 0.001]).repeat(FRAMES // 6)
    halts = replace(motion, translation=steps.cumsum(0)[:, None, None].repeat(1, 1, 3))
    halts = replace(halts, rotation=torch.eye(3).repeat(FRAMES, 1, 1, 1))
    assert without_repeats(halts)[0] is halts  # and goes on slowly


@pytest.mark.parametrize("length", [1, 3, 12])
def test_a_single_stop_that_the_next_leap_makes_up_for_is_filled(length):
    """As after a duplicated frame of a video and a dropped one."""
    motion, held = swing(), torch.arange(FRAMES)
    held[20 : 21 + length] = 20
    stutters = replace(motion, rotation=motion.rotation[held], translation=motion.translation[held])
    filled, told = without_repeats(stutters)
    assert torch.nonzero(~filled.valid)[:, 0].tolist() == list(range(21, 21 + length))
    off, before = (
        (each.translation - motion.translation).norm(dim=-1).max() for each in (filled, stutters)
    )
    assert off < 0.06 * before
    assert len(told) == 1


@pytest.mark.parametrize("length", [1, 3, 8])
def test_a_single_stop_after_which_the_object_goes_on_as_before_is_motion(length):
    halting = rested(swing(), 20, length)
    assert without_repeats(halting)[0] is halting


def test_what_turns_back_stands_still_for_a_moment():
    to_and_fro = 0.02 * torch.tensor([0.0, 1.0, 1.0, 0.0, -1.0, -1.0]).repeat(FRAMES // 6)
    place = to_and_fro[:, None, None] * torch.tensor([1.0, 0.0, 0.5])
    hammer = replace(swing(), rotation=torch.eye(3).repeat(FRAMES, 1, 1, 1), translation=place)
    assert without_repeats(hammer)[0] is hammer


@pytest.mark.parametrize("each", [6, 2])
def test_what_turns_back_between_two_repeated_poses_goes_on(each):
    along = torch.tensor([0.0, 1.0, -1.0, 1.0, 0.0, 1.0, 0.0, -1.0, 1.0, 0.0])
    along = along.repeat_interleave(each)[:, None, None]
    stirs = ObjectTrack(
        (), torch.eye(3).repeat(len(along), 1, 1, 1), 0.02 * along * torch.tensor([1.0, 0.0, 0.5])
    )
    found = int(repeated_poses(stirs).sum())
    assert found == 8 * (each - 1)  # not in the first and the last stop
