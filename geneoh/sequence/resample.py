"""The same motion at other frame rates."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import max_pool1d

from geneoh.errors import InputError
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    matrix_to_axis_angle,
    nearest_rotations,
)
from geneoh.sequence.gaps import FrameInterpolation, blendable, with_frames
from geneoh.sequence.sequence import HandTrack, Sequence

MOST_FRAMES = 108_000
"""Frames that resampling makes at most: an hour at 30 frames a second."""

FPS_DIGITS = 6
"""Decimals kept of a frame rate, so that going back lands on the rate one came from."""


def nearest_frames(before: int, after: int) -> Int[Tensor, " N"]:
    """For each of `after` frames the nearest in time of `before` frames over the same time."""
    return torch.linspace(0, before - 1, after, dtype=torch.float64).round().long()


def at_rate(sequence: Sequence, fps: float) -> Sequence:
    """The same motion at `fps` frames a second; the sequence itself when it has that rate.

    The first and the last moment stay frames, so the rate is met up to half a frame over the whole
    length; `Sequence.fps` of the result is the exact one. A clip that lasts less than a frame of
    the new rate keeps both of its ends. `InputError` for more than `MOST_FRAMES` frames.
    """
    if fps == sequence.fps or sequence.frames == 1:
        return sequence
    steps = (sequence.frames - 1) * fps / sequence.fps
    if not steps < MOST_FRAMES:
        raise InputError(
            f"{sequence.source or 'the sequence'}: must last at most {MOST_FRAMES} frames at "
            f"{fps:g} frames a second, got {steps:.6g} from {sequence.frames} at "
            f"{sequence.fps:g}; correct 'fps' or --fps, or cut it into shorter ones"
        )
    return over_frames(sequence, max(1, round(steps)) + 1)


def evenly(before: int, after: int, device: torch.device | str = "cpu") -> FrameInterpolation:
    """`after` instants, two or more, spread evenly over the time of `before` frames."""
    # In float64 and by one division, so that instants which fall on a frame do so exactly.
    place = torch.arange(after, dtype=torch.float64, device=device) * (before - 1) / (after - 1)
    return instants(place, before)


def instants(time: Float[Tensor, " N"], frames: int) -> FrameInterpolation:
    """Times in frames from the start of a track of so many frames."""
    start = time.floor().long().clamp(0, frames - 1)
    return FrameInterpolation(start, (start + 1).clamp(max=frames - 1), time - start)


def over_frames(sequence: Sequence, frames: int) -> Sequence:
    """The same motion, over the same time, in another number of frames.

    Points are interpolated linearly and rotations on the shorter arc, with gaps filled before; a
    new frame is valid where the nearest old one is and has some confidence. With the old number of
    frames it is the inverse of `at_rate`.
    """
    if frames == sequence.frames:
        return sequence
    if min(frames, sequence.frames) < 2:
        raise InputError(
            f"{sequence.source or 'the sequence'}: resampling needs two frames or more on both "
            f"sides, got {sequence.frames} to {frames}; keep the single frame as it is"
        )
    between = evenly(sequence.frames, frames, sequence.object.rotation.device)
    fps = round(sequence.fps * (frames - 1) / (sequence.frames - 1), FPS_DIGITS)
    return replace(_interpolated(sequence, between), fps=fps)


def hand_over_frames(hand: HandTrack, frames: int) -> HandTrack:
    """A clean hand over the same time in another number of frames, two or more on both sides.

    It moves on curves through the old frames, because straight lines between them have a corner at
    each, which is seen at 60 frames a second or more. What is no place or rotation is interpolated
    linearly; `valid` is as in `over_frames`.
    """
    if frames == hand.frames:
        return hand
    between = evenly(hand.frames, frames, hand.valid.device)
    valid = without_short_gaps(hand.valid, between)[between.nearest]
    filled = blendable(hand)
    curved = CurvedInterpolation(**vars(between)).hand(filled, valid)
    straight = between.hand(filled, valid)
    return replace(straight, pose=curved.pose, wrist=curved.wrist, joints=curved.joints)


def rotations_over_frames(
    rotation: Float[Tensor, "T K 3 3"], frames: int
) -> Float[Tensor, "N K 3 3"]:
    """Rotations over the same time in another number of frames, on curves as `hand_over_frames`."""
    if frames == len(rotation):
        return rotation
    between = evenly(len(rotation), frames, rotation.device)
    return CurvedInterpolation(**vars(between)).rotations(rotation)


@dataclass(frozen=True)
class CurvedInterpolation(FrameInterpolation):
    """Instants of a track of two or more frames, on cubic curves whose velocity at each frame is
    that between its neighbours (Catmull-Rom)."""

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "N ..."]:
        """Values of each frame, interpolated; the first and the last step go on beyond the ends."""
        first, last = 2 * values[:1] - values[1:2], 2 * values[-1:] - values[-2:-1]
        wide = torch.cat([first, values, last])
        f = self.fraction.to(values).reshape(-1, *[1] * (values.ndim - 1))
        weights = (
            f * (f * (2 - f) - 1) / 2,
            (f * f * (3 * f - 5) + 2) / 2,
            f * (f * (4 - 3 * f) + 1) / 2,
            f * f * (f - 1) / 2,
        )
        # the last frame has no second one behind it, and the weight of that is zero
        around = [(self.before + step).clamp(max=len(wide) - 1) for step in range(4)]
        total = torch.zeros_like(wide[around[0]])
        for weight, frame in zip(weights, around, strict=True):
            total += weight * wide[frame]
        return total

    def rotations(self, rotation: Float[Tensor, "T K 3 3"]) -> Float[Tensor, "N K 3 3"]:
        """The rotations that are nearest to interpolated matrices."""
        exact = (self.fraction == 0)[:, None, None, None]
        return torch.where(exact, rotation[self.before], nearest_rotations(self.points(rotation)))


def at_times(sequence: Sequence, time: Float[Tensor, " N"]) -> Sequence:
    """The same motion at times in frames from its start, one for each frame of the result."""
    return _interpolated(sequence, instants(time, sequence.frames))


def with_hands_earlier(sequence: Sequence, delay: float | int) -> Sequence:
    """The sequence with hands that come `delay` frames earlier, or later where it is negative.

    Frames for which there is no hand then count as missing. `InputError` where all of them do.
    """
    if delay == 0:
        return sequence
    hands = tuple(hand_earlier(hand, delay) for hand in sequence.hands)
    if not all(bool(hand.valid.any()) for hand in hands):
        raise InputError(
            f"{sequence.source or 'the sequence'}: a 'hand_delay' of {delay:g} leaves no frame of "
            f"{sequence.frames} with a hand; correct it (--hand-delay)"
        )
    return replace(sequence, hands=hands)


def hand_earlier(hand: HandTrack, delay: float | int) -> HandTrack:
    """The same of one hand, which may then be in no frame."""
    last = hand.frames - 1
    wanted = torch.arange(last + 1, dtype=torch.float64, device=hand.valid.device) + delay
    time = wanted.nan_to_num().clamp(0, last)
    between = instants(time, hand.frames)
    return between.hand(blendable(hand), (time == wanted) & hand.valid[between.nearest])


def _interpolated(sequence: Sequence, between: FrameInterpolation) -> Sequence:
    """A sequence at instants between its frames; see `over_frames`."""
    nearest = between.nearest
    motion = replace(
        sequence.object,
        rotation=between.rotations(sequence.object.rotation),
        translation=between.points(sequence.object.translation),
        valid=None if sequence.object.valid is None else sequence.object.valid[nearest],
    )
    hands = tuple(
        between.hand(hand, without_short_gaps(hand.valid, between)[nearest])
        for hand in map(blendable, sequence.hands)
    )
    return replace(sequence, hands=hands, object=motion)


def without_short_gaps(
    valid: Bool[Tensor, " T"], between: FrameInterpolation
) -> Bool[Tensor, " T"]:
    """The valid frames and those of gaps that are shorter than the time between two instants.

    Else a hand that is found in every fourth frame may be in none of a quarter of the frames.
    """
    apart = (len(valid) - 1) / max(len(between.before) - 1, 1)
    reach = int(apart / 2 + 0.25)  # 59.94 frames a second count as 60
    near = max_pool1d(valid[None].float(), 2 * reach + 1, 1, reach)
    return valid | (max_pool1d(-near, 2 * reach + 1, 1, reach)[0] < 0)


def averaged(sequence: Sequence, fps: float) -> Sequence:
    """The sequence with every frame the mean over 1 / `fps` seconds around it, gaps filled before.

    White noise of q frames a frame of the lower rate falls by the root of q. The sequence itself
    where it has no higher rate. Towards both ends means are over less, as much to either side.
    """
    if sequence.fps <= fps:
        return sequence
    mean = FrameMean(sequence.frames, sequence.fps / fps)
    motion = replace(
        sequence.object,
        rotation=mean.rotations(sequence.object.rotation),
        translation=mean.points(sequence.object.translation),
    )
    hands = tuple(
        with_frames(hand, hand.valid, mean.points, mean.pose)
        for hand in map(blendable, sequence.hands)
    )
    return replace(sequence, hands=hands, object=motion)


@dataclass(frozen=True)
class FrameMean:
    """Means over a time of `width` frames, more than one, around each of some frames."""

    frames: int
    width: float

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "T ..."]:
        """The means of values."""
        frames = torch.arange(self.frames, device=values.device)
        to_ends = torch.minimum(frames, frames.flip(0)) + 0.5
        half = to_ends.clamp(max=self.width / 2)
        total = torch.zeros_like(values)
        reach = int(self.width / 2 + 0.5)
        for offset in range(-reach, reach + 1):
            share = (half - abs(offset) + 0.5).clamp(0, 1) / (2 * half)
            there = values[(frames + offset).clamp(0, self.frames - 1)]
            total += share.to(values).view(-1, *[1] * (values.ndim - 1)) * there
        return total

    def rotations(self, rotation: Float[Tensor, "T *N 3 3"]) -> Float[Tensor, "T *N 3 3"]:
        """The rotations that are nearest to the means of matrices."""
        return nearest_rotations(self.points(rotation))

    def pose(self, pose: Float[Tensor, "T K 3"]) -> Float[Tensor, "T K 3"]:
        """The means of axis-angle vectors, as rotations."""
        return matrix_to_axis_angle(self.rotations(axis_angle_to_matrix(pose)))
