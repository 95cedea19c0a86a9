"""Interpolation between observed frames: linear for points, spherical for rotations."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.bundle import FRAMES, concatenated
from geneoh.errors import numbered
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix as matrices
from geneoh.geometry.rotations import interpolate_rotations, matrix_to_axis_angle
from geneoh.sequence.keypoints import PALM, keypoints_of
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.windows import runs

LARGEST_FIRST_STEP, LARGEST_FIRST_TURN = 0.2, 1.0
"""Step in metres and turn in radians between two frames that are too large for an object that
starts from rest."""


@dataclass(frozen=True)
class FrameInterpolation:
    """N instants, each between two frames of a track; at fraction 0 it is exactly the first one."""

    before: Int[Tensor, " N"]
    after: Int[Tensor, " N"]
    fraction: Float[Tensor, " N"]

    @property
    def nearest(self) -> Int[Tensor, " N"]:
        """The nearer of the two frames; the second one at fraction 0.5."""
        return torch.where(self.fraction >= 0.5, self.after, self.before)

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "N ..."]:
        """Values of each frame, interpolated linearly."""
        start, end = values[self.before], values[self.after]
        fraction = self.fraction.to(values).reshape(-1, *[1] * (values.ndim - 1))
        return start + fraction * (end - start)

    def rotations(self, rotation: Float[Tensor, "T K 3 3"]) -> Float[Tensor, "N K 3 3"]:
        """Rotation matrices, interpolated spherically along the shorter arc."""
        fraction = self.fraction.to(rotation)[:, None]
        turned = interpolate_rotations(rotation[self.before], rotation[self.after], fraction)
        # At fraction 0 the frame itself is taken: the interpolation would round it.
        exact = (fraction == 0)[..., None, None]
        return torch.where(exact, rotation[self.before], turned)

    def pose(self, pose: Float[Tensor, "T K 3"]) -> Float[Tensor, "N K 3"]:
        """Axis-angle vectors, interpolated as rotations."""
        turned = matrix_to_axis_angle(self.rotations(matrices(pose)))
        return torch.where((self.fraction.to(pose) == 0)[:, None, None], pose[self.before], turned)

    def hand(self, hand: HandTrack, valid: Bool[Tensor, " N"]) -> HandTrack:
        """The hand at these instants; `valid` marks those that count as observed."""
        return with_frames(hand, valid, self.points, self.pose)


def with_frames(
    hand: HandTrack,
    valid: Bool[Tensor, " N"],
    points: Callable[[Tensor], Tensor],
    pose: Callable[[Tensor], Tensor],
) -> HandTrack:
    """A track resampled to N frames: axis-angle vectors by `pose`, other numbers by `points`.

    `valid` marks the new frames that count as observed.
    """
    # `valid` is the only field per frame that is no floating point number
    moved = hand.map(lambda old: points(old) if old.is_floating_point() else valid, FRAMES)
    turns = None if hand.pose is None else pose(hand.pose)
    ray = None if moved.camera_ray is None else normalize(moved.camera_ray, dim=-1)
    return replace(moved, pose=turns, camera_ray=ray)


@dataclass(frozen=True)
class Carrier:
    """The motion of an object that carries the hand through its unobserved frames."""

    pose: Rigid  # of T frames, to the world
    share: Float[Tensor, " T"]
    """Confidence, 0 to 1, that it carries the hand, in each frame where the hand is observed."""


def fill_gaps(hand: HandTrack, carrier: Carrier | None = None) -> HandTrack:
    """The same track with finite numbers in every frame; `valid` still says which were observed.

    Across a gap points are interpolated linearly and rotations spherically; before the first and
    after the last observed frame the hand rests. With a carrier, this is done both in the world and
    in the carrier's frame, and blended by `Carrier.share` beside the gap. Observed frames are kept.
    The hand must be observed in at least one frame.
    """
    if bool(hand.valid.all()):
        return hand
    between = observed_around(hand.valid)
    still = between.hand(hand, hand.valid)
    if carrier is None:
        return still
    share = between.points(carrier.share).masked_fill(hand.valid, 0.0)
    if not bool((share > 0).any()):
        return still
    carried = moved(between.hand(moved(hand, carrier.pose.inverse()), hand.valid), carrier.pose)
    both = concatenated([still, carried])
    frames = torch.arange(len(share), device=share.device)
    return FrameInterpolation(frames, frames + len(share), share).hand(both, hand.valid)


def moved(hand: HandTrack, pose: Rigid) -> HandTrack:
    """The hand after a rigid motion in each frame; all but pose, wrist and keypoints is kept."""

    def turned(old: Tensor) -> Tensor:
        whole = matrix_to_axis_angle(pose.rotation @ matrices(old[:, 0]))
        return torch.cat([whole[:, None], old[:, 1:]], dim=1)

    return hand.changed(
        pose=turned, wrist=lambda old: pose.apply(old[:, None])[:, 0], joints=pose.apply
    )


def blendable(hand: HandTrack, carrier: Carrier | None = None) -> HandTrack:
    """The same track with a usable hand in every frame, so that frames may be averaged.

    Frames without any confidence are gaps too, and not `valid`; `carrier` is as for `fill_gaps`. A
    keypoint without confidence is interpolated linearly between the frames in which it has some; a
    keypoint that never has any is kept as it is.
    """
    trusted, seen = hand.trust > 0, hand.observed
    lost = (~trusted[seen]).any(0) & trusted.any(0)
    if hand.joints is not None:
        hand = replace(hand, joints=over_time(hand.joints, trusted, lost))
    return fill_gaps(replace(hand, valid=seen), carrier)


def without_placeholders(hand: HandTrack) -> HandTrack:
    """The track with keypoints that have no confidence in a frame with a hand interpolated over
    time, because their values may be placeholders such as zeros or NaN.

    One that never has any is at the mean of the others. The confidence stays.
    """
    if hand.joints is None or hand.confidence is None:
        return hand
    trusted = hand.trust > 0
    empty = hand.observed[:, None] & ~trusted
    if not bool(empty.any()):
        return hand
    known = trusted.any(0)
    path = over_time(hand.joints, trusted, empty.any(0) & known)
    sums = torch.where(trusted[..., None], path, 0.0).sum(1, keepdim=True)
    middle = sums / trusted.sum(1)[:, None, None]
    path = torch.where(known[:, None], path, middle)
    return replace(hand, joints=torch.where(empty[..., None], path, hand.joints))


def over_time(
    joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"], points: Bool[Tensor, " 21"]
) -> Float[Tensor, "T 21 3"]:
    """Keypoints, some `points` of which are interpolated linearly between the frames in which they
    are trusted; each of these is trusted in some frame."""
    joints = joints.clone()
    for point in torch.nonzero(points)[:, 0].tolist():
        joints[:, point] = observed_around(trusted[:, point]).points(joints[:, point])
    return joints


def filled_keypoints(hand: HandTrack) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a track, metres, world frame; frames without any trusted one are filled."""
    return keypoints_of(fill_gaps(replace(hand, valid=hand.observed)))


def observed_around(valid: Bool[Tensor, " T"]) -> FrameInterpolation:
    """For each frame the nearest observed frames before and after it, and the fraction between."""
    frames = torch.arange(len(valid), device=valid.device)
    observed = frames[valid]
    assert len(observed), "a hand that was never observed cannot be filled"
    after = torch.searchsorted(observed, frames).clamp(max=len(observed) - 1)
    before = (torch.searchsorted(observed, frames, right=True) - 1).clamp(min=0)
    start, end = observed[before], observed[after]
    # Before the first and after the last observed frame both neighbours are the same frame.
    fraction = torch.where(end > start, (frames - start) / (end - start), 0.0)
    return FrameInterpolation(start, end, fraction)


def palm_points(
    joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"]
) -> tuple[Float[Tensor, "T 5 3"], Bool[Tensor, " T"]]:
    """The wrist and the knuckles, interpolated linearly in frames where one of them is not trusted,
    and a mask of the frames where all are trusted."""
    known, points = trusted[:, PALM].all(-1), joints[:, PALM]
    return (observed_around(known).points(points) if bool(known.any()) else points), known


def fill_object(motion: ObjectTrack, observed: Bool[Tensor, "T Q"] | None = None) -> ObjectTrack:
    """An object's track with finite poses in every frame; its `valid` marks the observed ones.

    Poses that are NaN, `unset`, or not `observed` count as missing and are interpolated, linearly
    and spherically. Poses that are already not `valid` were filled before, and stay so. A part that
    was never observed rests at the origin.
    """
    lost = motion.rotation.isnan().any(-1).any(-1) | motion.translation.isnan().any(-1)
    lost |= unset(motion)
    seen = ~lost if observed is None else ~lost & observed
    if bool(seen.all()):
        return motion
    rotation = torch.eye(3).to(motion.rotation).expand_as(motion.rotation).clone()
    translation = torch.zeros_like(motion.translation)
    for part in torch.nonzero(seen.any(0))[:, 0].tolist():
        between = observed_around(seen[:, part])
        rotation[:, part] = between.rotations(motion.rotation[:, part : part + 1])[:, 0]
        translation[:, part] = between.points(motion.translation[:, part])
    return replace(motion, rotation=rotation, translation=translation, valid=seen & motion.observed)


def unset(motion: ObjectTrack) -> Bool[Tensor, "T Q"]:
    """Mask of poses that are exactly the identity, between leaps: programs often start from arrays
    of identities, which remain where the object was not found."""
    upright = (motion.rotation == torch.eye(3).to(motion.rotation)).flatten(2).all(-1)
    still = upright & (motion.translation == 0).all(-1)
    if not bool(still.any()):
        return still
    middle = torch.zeros_like(motion.translation[0])
    if len(motion.meshes) == len(middle):
        middle = torch.stack([mesh.verts.mean(0) for mesh in motion.meshes]).to(middle)
    places = (motion.rotation @ middle[..., None])[..., 0] + motion.translation
    steps = places.diff(dim=0).norm(dim=-1)
    chords = motion.rotation.diff(dim=0).flatten(2).norm(dim=-1)
    leaps = steps.isfinite() & (steps > LARGEST_FIRST_STEP)
    leaps |= chords > 8**0.5 * math.sin(LARGEST_FIRST_TURN / 2)
    found = torch.zeros_like(still)
    for part in torch.nonzero(~still.all(0))[:, 0].tolist():
        for run in runs(still[:, part].cpu().numpy()):
            around = [step for step in (run.start - 1, run.stop - 1) if 0 <= step < len(leaps)]
            found[run, part] = leaps[around, part].all()
    return found


def filled_poses(motion: ObjectTrack) -> Iterator[str]:
    """Notes for the user about poses that were missing: `fill_object` and cleaning fill them in."""
    for part, count in enumerate((~motion.observed).sum(0).tolist()):
        name = motion.name_of(part)
        if count == len(motion.rotation):
            yield f"{name} was never seen: its poses say nothing, the hand is cleaned without it"
        elif count:
            frames = numbered(count, "frame")
            yield (
                f"{frames} without a pose of {name}, filled from the frames around, and where a "
                "hand moves it by the hand"
            )
