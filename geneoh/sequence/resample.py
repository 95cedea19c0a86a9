"""Resampling of sequences and tracks to other frame rates."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import max_pool1d

from geneoh.errors import InputError
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    matrix_to_axis_angle,
    nearest_rotations,
)
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.sequence.gaps import FrameInterpolation, blendable, with_frames
from geneoh.sequence.sequence import HandTrack, Sequence

MOST_FRAMES = 108_000
"""Most frames that resampling makes: an hour at 30 frames a second."""

FPS_DIGITS = 6
"""Decimals of a frame rate, so that resampling back gives exactly the original rate."""

OF_THE_POSE = 0.005
"""Largest mean distance of joints from those of their pose, metres: others are of another hand."""


def nearest_frames(before: int, after: int) -> Int[Tensor, " N"]:
    """For each of `after` frames, the nearest of `before` frames that span the same time."""
    return torch.linspace(0, before - 1, after, dtype=torch.float64).round().long()


def at_rate(sequence: Sequence, fps: float) -> Sequence:
    """The same motion at `fps` frames a second; the sequence itself when it has that rate.

    The first and the last frame keep their times, so the number of frames is rounded, and
    `Sequence.fps` of the result is the exact rate. A clip shorter than a frame of the new rate
    keeps its first and last frame. `InputError` for more than `MOST_FRAMES` frames.
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


def evenly(before: int, after: int, device: torch.device) -> FrameInterpolation:
    """`after` instants, two or more, spread evenly over the time of `before` frames."""
    # In float64 and with one division, so that instants on a frame have exactly fraction 0.
    place = torch.arange(after, dtype=torch.float64, device=device) * (before - 1) / (after - 1)
    return instants(place, before)


def instants(time: Float[Tensor, " N"], frames: int) -> FrameInterpolation:
    """Instants of a track of `frames` frames at times in frames from its start."""
    start = time.floor().long().clamp(0, frames - 1)
    return FrameInterpolation(start, (start + 1).clamp(max=frames - 1), time - start)


def over_frames(sequence: Sequence, frames: int) -> Sequence:
    """The same motion over the same time, in another number of frames.

    Gaps are filled first; then points are interpolated linearly and rotations spherically. A new
    frame is valid where the nearest old one is and has some confidence. With the original number
    of frames it undoes `at_rate`.
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
    """A clean hand over the same time in another number of frames; both numbers are two or more.

    Positions and rotations follow cubic curves, because the corners of linear interpolation are
    visible at 60 frames a second or more. Other fields are interpolated linearly; `valid` is as in
    `over_frames`.
    """
    if frames == hand.frames:
        return hand
    between = evenly(hand.frames, frames, hand.valid.device)
    valid = seen_at(hand.valid, between)
    filled = blendable(hand)
    curved = CurvedInterpolation(**vars(between)).hand(filled, valid)
    straight = between.hand(filled, valid)
    return replace(straight, pose=curved.pose, wrist=curved.wrist, joints=curved.joints)


def rotations_over_frames(
    rotation: Float[Tensor, "T K 3 3"], frames: int
) -> Float[Tensor, "N K 3 3"]:
    """Rotations over the same time in another number of frames, on cubic curves."""
    if frames == len(rotation):
        return rotation
    between = evenly(len(rotation), frames, rotation.device)
    return CurvedInterpolation(**vars(between)).rotations(rotation)


def poses_over_frames(poses: Rigid, frames: int) -> Rigid:
    """A pose of each of T frames, over the same time in another number of frames; cubic curves."""
    if frames == len(poses.rotation):
        return poses
    between = CurvedInterpolation(
        **vars(evenly(len(poses.rotation), frames, poses.rotation.device))
    )
    rotation = between.rotations(poses.rotation[:, None])[:, 0]
    return Rigid(rotation, between.points(poses.translation))


@dataclass(frozen=True)
class CurvedInterpolation(FrameInterpolation):
    """Catmull-Rom interpolation of a track of two or more frames: cubic curves whose velocity at
    each frame is the central difference of its neighbours."""

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "N ..."]:
        """Values of each frame, interpolated; the first and last step are extrapolated linearly."""
        first, last = 2 * values[:1] - values[1:2], 2 * values[-1:] - values[-2:-1]
        wide = torch.cat([first, values, last])
        f = self.fraction.to(values).reshape(-1, *[1] * (values.ndim - 1))
        weights = (
            f * (f * (2 - f) - 1) / 2,
            (f * f * (3 * f - 5) + 2) / 2,
            f * (f * (4 - 3 * f) + 1) / 2,
            f * f * (f - 1) / 2,
        )
        # beyond the last frame the index is clamped; the weight there is zero
        around = [(self.before + step).clamp(max=len(wide) - 1) for step in range(4)]
        total = torch.zeros_like(wide[around[0]])
        for weight, frame in zip(weights, around, strict=True):
            total += weight * wide[frame]
        return total

    def rotations(self, rotation: Float[Tensor, "T K 3 3"]) -> Float[Tensor, "N K 3 3"]:
        """The rotations nearest to interpolated matrices."""
        exact = (self.fraction == 0)[:, None, None, None]
        return torch.where(exact, rotation[self.before], nearest_rotations(self.points(rotation)))


def at_times(sequence: Sequence, time: Float[Tensor, " N"]) -> Sequence:
    """The same motion at N times, in frames from its start; one frame of the result for each."""
    return _interpolated(sequence, instants(time, sequence.frames))


def with_hands_earlier(sequence: Sequence, delay: float | int) -> Sequence:
    """The sequence with hands shifted `delay` frames earlier, or later where it is negative.

    Frames without a hand after the shift are not valid; `InputError` where no valid one remains.
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
    """One hand shifted `delay` frames earlier; it may then be valid in no frame."""
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
        between.hand(hand, seen_at(hand.valid, between)) for hand in map(blendable, sequence.hands)
    )
    camera = sequence.camera_to_world
    if camera is not None:
        turns = between.rotations(camera[:, None, :3, :3])[:, 0]
        camera = Rigid(turns, between.points(camera[:, :3, 3])).matrices()
    return replace(sequence, hands=hands, object=motion, camera_to_world=camera)


def seen_at(valid: Bool[Tensor, " T"], between: FrameInterpolation) -> Bool[Tensor, " N"]:
    """Instants whose nearest frame is valid or in a short gap; if there is none, those nearest to
    the valid frames, so that a hand in a single frame is not lost."""
    found = without_short_gaps(valid, between)[between.nearest]
    if bool(valid.any()) and not bool(found.any()):
        time, seen = between.before + between.fraction, torch.nonzero(valid)
        found[(time - seen).abs().argmin(1)] = True
    return found


def without_short_gaps(
    valid: Bool[Tensor, " T"], between: FrameInterpolation
) -> Bool[Tensor, " T"]:
    """The valid frames, and the frames of gaps that are shorter than the time between two instants.

    Otherwise a hand found in every fourth frame could be lost in all frames of a quarter rate.
    """
    apart = (len(valid) - 1) / max(len(between.before) - 1, 1)
    reach = int(apart / 2 + 0.25)  # 59.94 frames a second count as 60
    near = max_pool1d(valid[None].float(), 2 * reach + 1, 1, reach)
    return valid | (max_pool1d(-near, 2 * reach + 1, 1, reach)[0] < 0)


def averaged(sequence: Sequence, fps: float) -> Sequence:
    """The sequence with every frame averaged over 1 / `fps` seconds around it, after filling gaps.

    With q frames per frame of the lower rate, white noise falls by the square root of q. A sequence
    of no higher rate is returned as it is. Towards both ends the averaging window shrinks, and
    stays symmetric. Frames without a hand, or without a pose of a part, do not count.
    """
    if sequence.fps <= fps:
        return sequence
    width, motion = sequence.fps / fps, sequence.object
    of_parts = FrameMean(motion.observed, width)
    motion = replace(
        motion,
        rotation=of_parts.rotations(motion.rotation),
        translation=of_parts.points(motion.translation),
    )
    hands = list[HandTrack]()
    for hand in map(blendable, sequence.hands):
        mean = FrameMean(hand.valid, width)
        found = with_frames(hand, hand.valid, mean.points, mean.pose)
        hands.append(posed_alike(found, hand))
    return replace(sequence, hands=tuple(hands), object=motion)


def posed_alike(mean: HandTrack, hand: HandTrack) -> HandTrack:
    """An averaged track with the joints of its averaged pose, if those of the track are of its
    pose: means of joints are those of a smaller hand where the rotations are noisy."""
    if hand.pose is None or hand.joints is None or mean.pose is None or mean.joints is None:
        return mean
    turns, trust = axis_angle_to_matrix(hand.pose), hand.trust
    skeleton = rest_offsets(turns, hand.joints, trust)
    posed, _ = forward_kinematics(turns, hand.joints[:, 0], skeleton)
    misfit = (trust * (posed - hand.joints).norm(dim=-1)).sum() / trust.sum().clamp(min=1e-9)
    if misfit > OF_THE_POSE:
        return mean
    turns = axis_angle_to_matrix(mean.pose)
    joints, _ = forward_kinematics(turns, mean.joints[:, 0], skeleton)
    return replace(mean, joints=joints)


@dataclass(frozen=True)
class FrameMean:
    """Moving average with a window of `width` frames, more than one, centred on each frame."""

    seen: Bool[Tensor, "T ..."]
    """Frames that count. Two at the same distance before and after count together or not at all,
    because one alone would shift the mean in time. Where none counts, the frame stays as it is."""
    width: float

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "T ..."]:
        """The moving average of values."""
        seen, frames = self.seen, torch.arange(len(values), device=values.device)
        to_ends = torch.minimum(frames, frames.flip(0)) + 0.5
        half = to_ends.clamp(max=self.width / 2).to(values).view(-1, *[1] * (seen.ndim - 1))
        total, weight = torch.zeros_like(values), torch.zeros_like(seen, dtype=values.dtype)
        behind = [1] * (values.ndim - seen.ndim)
        reach = int(self.width / 2 + 0.5)
        for offset in range(-reach, reach + 1):
            there, opposite = ((frames + o).clamp(0, len(values) - 1) for o in (offset, -offset))
            share = (half - abs(offset) + 0.5).clamp(0, 1) * (seen[there] & seen[opposite])
            total += share.view(*seen.shape, *behind) * values[there]
            weight += share
        weight = weight.view(*seen.shape, *behind)
        return torch.where(weight > 0, total / weight, values)

    def rotations(self, rotation: Float[Tensor, "T *N 3 3"]) -> Float[Tensor, "T *N 3 3"]:
        """The rotations nearest to the moving average of matrices."""
        return nearest_rotations(self.points(rotation))

    def pose(self, pose: Float[Tensor, "T K 3"]) -> Float[Tensor, "T K 3"]:
        """The moving average of axis-angle vectors, taken over their rotations."""
        return matrix_to_axis_angle(self.rotations(axis_angle_to_matrix(pose)))
