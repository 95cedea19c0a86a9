"""Frames between observed ones: on straight lines and shorter arcs, or on curves."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.bundle import FRAMES
from geneoh.geometry.rotations import axis_angle_to_matrix as matrices
from geneoh.geometry.rotations import interpolate_rotations, matrix_to_axis_angle
from geneoh.sequence.sequence import HandTrack, ObjectTrack

CURVED = 0.5
"""Share of the bend that the speeds around a gap ask for."""
SPEED_FRAMES = 2
"""Frames over which these speeds are taken."""
LONGEST_CURVE = 12
"""Frames of a gap up to which it bends as they ask: what a hand does later they do not tell."""


@dataclass(frozen=True)
class FrameInterpolation:
    """N instants, each between two frames of a track; fraction 0 is exactly the first of them."""

    before: Int[Tensor, " N"]
    after: Int[Tensor, " N"]
    fraction: Float[Tensor, " N"]

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "N ..."]:
        """Values of each frame, interpolated on a straight line."""
        start, end = values[self.before], values[self.after]
        fraction = self.fraction.to(values).reshape(-1, *[1] * (values.ndim - 1))
        return start + fraction * (end - start)

    def rotations(self, rotation: Float[Tensor, "T K 3 3"]) -> Float[Tensor, "N K 3 3"]:
        """Rotation matrices, interpolated on the shorter arc."""
        fraction = self.fraction.to(rotation)[:, None]
        turned = interpolate_rotations(rotation[self.before], rotation[self.after], fraction)
        # At fraction 0 the frame itself is taken: the interpolation would round it.
        exact = (fraction == 0)[..., None, None]
        return torch.where(exact, rotation[self.before], turned)

    def pose(self, pose: Float[Tensor, "T K 3"]) -> Float[Tensor, "N K 3"]:
        """Axis-angle vectors, interpolated as rotations."""
        turned = matrix_to_axis_angle(self.rotations(matrices(pose)))
        return torch.where((self.fraction == 0)[:, None, None], pose[self.before], turned)

    def hand(self, hand: HandTrack, valid: Bool[Tensor, " N"]) -> HandTrack:
        """The hand at these instants; `valid` marks those that count as observed."""
        moved = hand.map(
            lambda values: (
                self.points(values) if values.is_floating_point() else values[self.before]
            ),
            FRAMES,
        )
        pose = None if hand.pose is None else self.pose(hand.pose)
        ray = None if moved.camera_ray is None else normalize(moved.camera_ray, dim=-1)
        return replace(moved, valid=valid, pose=pose, camera_ray=ray)


def fill_gaps(hand: HandTrack) -> HandTrack:
    """The same track with finite numbers in every frame; `valid` still says which were observed.

    Points run on a straight line across a gap and rotations on the shorter arc; before the first
    observed frame and after the last one the hand is held still. Observed frames are not touched.
    The hand must be observed in at least one frame.
    """
    if bool(hand.valid.all()):
        return hand
    return observed_around(hand.valid).hand(hand, hand.valid)


def fill_gaps_on_curves(hand: HandTrack) -> HandTrack:
    """`fill_gaps` on curves that leave and reach a gap as the hand moves around it.

    A hand goes on as it went: on straight lines it would stop and start at once. The curves are
    cubic, and halfway between the straight line and the one with the speeds of the two frames
    before and after the gap, because these are as noisy as the track.
    """
    filled = fill_gaps(hand)
    if filled is hand:
        return hand
    between = observed_around(hand.valid)
    inside = ~hand.valid & (between.after > between.before)
    gap = FrameInterpolation(
        between.before[inside], between.after[inside], between.fraction[inside]
    )
    own, curves = _SpeedsAround.of(gap, hand.valid), {}
    for name in ("joints", "wrist"):
        values = getattr(filled, name)
        if values is not None:
            curves[name] = values.clone()
            curves[name][inside] += own.bend(values)
    if filled.pose is not None:
        start = matrices(filled.pose)[gap.before]
        curves["pose"] = filled.pose.clone()
        curves["pose"][inside] = own.turned(start, matrices(filled.pose))
    return replace(filled, **curves)


@dataclass(frozen=True)
class _SpeedsAround:
    """Frames that tell how a hand moves before and after each of N lost frames."""

    gap: FrameInterpolation
    earlier: Int[Tensor, " N"]  # observed frame up to two before the gap's first neighbour
    later: Int[Tensor, " N"]  # the same after its last neighbour

    @classmethod
    def of(cls, gap: FrameInterpolation, valid: Bool[Tensor, " T"]) -> "_SpeedsAround":
        """Neighbours at most `SPEED_FRAMES` away without a lost frame between; or the ends."""
        earlier, later, last = gap.before, gap.after, len(valid) - 1
        for _ in range(SPEED_FRAMES):
            one, two = (earlier - 1).clamp(min=0), (later + 1).clamp(max=last)
            earlier = torch.where(valid[one], one, earlier)
            later = torch.where(valid[two], two, later)
        return cls(gap, earlier, later)

    def bend(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "N ..."]:
        """How far the curve is off the straight line in each lost frame."""
        before, after = self.gap.before, self.gap.after
        return self._bend(*(values[at] for at in (self.earlier, before, after, self.later)))

    def turned(
        self, start: Float[Tensor, "N K 3 3"], rotation: Float[Tensor, "T K 3 3"]
    ) -> Float[Tensor, "N K 3"]:
        """Axis-angle of rotations on the curve, by their turns from the last one before the gap."""
        frames = (self.earlier, self.gap.before, self.gap.after, self.later)
        turns = [matrix_to_axis_angle(start.mT @ rotation[at]) for at in frames]
        turn = self.gap.fraction[:, None, None] * turns[2] + self._bend(*turns)
        return matrix_to_axis_angle(start @ matrices(turn))

    def _bend(
        self,
        earlier: Float[Tensor, "N ..."],
        start: Float[Tensor, "N ..."],
        end: Float[Tensor, "N ..."],
        later: Float[Tensor, "N ..."],
    ) -> Float[Tensor, "N ..."]:
        before, after = self.gap.before, self.gap.after

        def each(numbers: Tensor) -> Tensor:
            return numbers.to(start).reshape(-1, *[1] * (start.ndim - 1))

        def speed(first: Tensor, last: Tensor, frames: Tensor) -> Tensor:
            # without a second frame that of the straight line, which bends nothing
            known = (last - first) / each(frames.clamp(min=1))
            return torch.where(each(frames) > 0, known, straight)

        straight = (end - start) / each(after - before)
        away = speed(earlier, start, before - self.earlier) - straight
        there = speed(end, later, self.later - after) - straight
        share, length = self.gap.fraction, (after - before).clamp(max=LONGEST_CURVE)
        leaving, reaching = share * (1 - share) ** 2, share**2 * (share - 1)
        return CURVED * each(length) * (each(leaving) * away + each(reaching) * there)


def observed_around(valid: Bool[Tensor, " T"]) -> FrameInterpolation:
    """For each frame the nearest observed frames before and after it, and its place between."""
    frames = torch.arange(len(valid), device=valid.device)
    observed = frames[valid]
    assert len(observed), "a hand that was never observed cannot be filled"
    after = torch.searchsorted(observed, frames).clamp(max=len(observed) - 1)
    before = (torch.searchsorted(observed, frames, right=True) - 1).clamp(min=0)
    start, end = observed[before], observed[after]
    # Before the first and after the last observation both neighbours are the same frame.
    fraction = torch.where(end > start, (frames - start) / (end - start), 0.0)
    return FrameInterpolation(start, end, fraction)


def fill_object(motion: ObjectTrack, observed: Bool[Tensor, "T Q"] | None = None) -> ObjectTrack:
    """An object's track with finite poses in every frame; its `valid` says which were observed.

    Poses that are NaN, or not `observed`, were not. They run between the observed ones on straight
    lines and shorter arcs; a part that was never observed stands still at the origin.
    """
    lost = motion.rotation.isnan().any(-1).any(-1) | motion.translation.isnan().any(-1)
    seen = ~lost if observed is None else ~lost & observed
    if bool(seen.all()):
        return motion
    rotation = torch.eye(3).to(motion.rotation).expand_as(motion.rotation).clone()
    translation = torch.zeros_like(motion.translation)
    for part in torch.nonzero(seen.any(0))[:, 0].tolist():
        between = observed_around(seen[:, part])
        rotation[:, part] = between.rotations(motion.rotation[:, part : part + 1])[:, 0]
        translation[:, part] = between.points(motion.translation[:, part])
    return replace(motion, rotation=rotation, translation=translation, valid=seen)
