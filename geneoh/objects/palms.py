"""Distinguish motion of an object from noise of its poses: motion is shared by a hand's palm.

A bottle that is shaken moves from frame to frame as much as the pose of a poor estimator. In the
frame of the palm that shakes it, the bottle rests, whereas noise remains. Where hand and object are
both placed by a camera whose own pose is noisy, they jitter alike, each beside noise of its own.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.geometry.rotations import is_rotation
from geneoh.objects.examination import EXACT_ROTATION, EXACT_TRANSLATION
from geneoh.objects.smoothing import (
    LEAST_FRAMES,
    Summary,
    increments,
    noise_level,
    path_of,
    smooth_points,
    smooth_rotations,
)
from geneoh.sequence.gaps import filled_keypoints, palm_points
from geneoh.sequence.keypoints import PALM, palm_axes
from geneoh.sequence.sequence import HandTrack

SHARED_REST = 0.5
"""A palm shares a change of motion if at most this share of it remains in its frame."""
LIMIT_SLACK = 1.01  # ratio of a limit to the largest change that a palm shares
SURELY_SHARED, SURELY_OWN = 3.0, 2.0
"""Standard errors beyond which noise counts as shared by two tracks, and as one's own beside it."""
CARRIED_OVER = 5.0
"""Standard deviation in frames of the Gaussian over the place of an object in a palm, with which
the palm's motion is carried to the object: a palm that turns moves what it holds."""


@dataclass(frozen=True)
class RigidMotion:
    """Rotations and positions of a rigid body, an object part or a palm."""

    turns: Rotation
    places: Float64[np.ndarray, "T 3"]  # of its centre, metres
    seen: Bool[np.ndarray, " T"]  # frames in which it was observed

    def __getitem__(self, frames: slice) -> "RigidMotion":
        """The motion in some frames."""
        turns = self.turns[frames]  # pyright: ignore[reportArgumentType]  # slices lack in its stubs
        return RigidMotion(turns, self.places[frames], self.seen[frames])

    def as_seen_from(self, palm: "RigidMotion") -> "RigidMotion":
        """The same motion in the frame of a palm."""
        back = palm.turns.inv()
        places = back.apply(self.places - palm.places)
        return RigidMotion(back * self.turns, places, self.seen & palm.seen)

    @property
    def is_long(self) -> bool:
        """Whether enough consecutive frames are seen to distinguish noise from motion."""
        if len(self.seen) < LEAST_FRAMES:
            return False
        return bool(sliding_window_view(self.seen, LEAST_FRAMES).all(1).any())

    def turn_noise(self, summary: Summary = np.median) -> float:
        """Standard deviation of the rotation's white noise per axis, radians; see `noise_level`."""
        return noise_level(path_of(self.turns), self.seen, summary)

    def place_noise(self, summary: Summary = np.median) -> float:
        """Standard deviation of the position's white noise per axis, metres; see `noise_level`."""
        return noise_level(self.places, self.seen, summary)

    @cached_property
    def without_noise(self) -> "RigidMotion":
        """The motion without its white noise; the same one if it is seen too briefly."""
        if self.seen.sum() < LEAST_FRAMES:
            return self
        noise = max(self.turn_noise(), EXACT_ROTATION / 4)
        turns, _ = smooth_rotations(self.turns, self.seen, noise)
        noise = max(self.place_noise(), EXACT_TRANSLATION / 4)
        places, _ = smooth_points(self.places, self.seen, noise)
        return replace(self, turns=turns, places=places)

    def turn_changes(self) -> Float64[np.ndarray, " N"]:
        """Change between consecutive rotation increments, radians.

        Beside a step of more than a quarter turn it is the size of the larger step: half a turn and
        back may be two equal vectors or two opposite ones."""
        steps = increments(self.turns)
        changes = np.linalg.norm(np.diff(steps, axis=0), axis=1)
        larger = sliding_window_view(np.linalg.norm(steps, axis=1), 2).max(1)
        return np.where(larger > np.pi / 2, larger, changes)

    def place_changes(self) -> Float64[np.ndarray, " N"]:
        """Change between consecutive displacements, metres."""
        return np.linalg.norm(np.diff(self.places, n=2, axis=0), axis=1)


def world_path(rotations: Rotation) -> Float64[np.ndarray, "T 3"]:
    """Cumulative sum of the rotations from frame to frame in world axes, radians."""
    steps = (rotations[1:] * rotations[:-1].inv()).as_rotvec()
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def palm_of(hand: HandTrack) -> RigidMotion:
    """The palm of a track that is observed in at least one frame."""
    return palm_at(filled_keypoints(hand), hand.trust > 0)


def palm_at(joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"]) -> RigidMotion:
    """The palm of keypoints, metres, world frame; seen where all palm keypoints are trusted.

    Keypoints that are never trusted are used all the same; if they do not determine the palm's
    axes, the world axes are used."""
    points, known = palm_points(joints, trusted)
    whole = joints.index_copy(1, torch.tensor(PALM, device=joints.device), points)
    axes = palm_axes(whole[:, None])
    axes = torch.where(is_rotation(axes)[:, None, None], axes, torch.eye(3).to(axes))
    middle = points.mean(1).double().cpu().numpy()
    turns = Rotation.from_matrix(axes.double().cpu().numpy())
    return RigidMotion(turns, middle, known.cpu().numpy())


def own_noise(
    track: Float64[np.ndarray, "T 3"],
    other: Float64[np.ndarray, "T 3"],
    seen: Bool[np.ndarray, " T"],
    summary: Summary,
) -> float:
    """Standard deviation per axis of the white noise of a track that another one does not share.

    The correlation is a quarter of the difference between the variances of the sum and of the
    difference of the tracks in units of their noise (Gnanadesikan and Kettenring 1972), which
    `noise_level` estimates robustly. What may be chance does not count: neither noise as shared,
    nor the rest as noise of the track.
    """
    whole, others = noise_level(track, seen, summary), noise_level(other, seen, summary)
    if whole * others == 0:
        return whole
    units = track / whole, other / others
    alike, unlike = (
        noise_level(each, seen, summary) for each in (units[0] + units[1], units[0] - units[1])
    )
    correlation, chance = (alike**2 - unlike**2) / 4, 1 / np.sqrt(max(seen.sum(), 1))
    if correlation <= SURELY_SHARED * chance:
        return whole
    shared = correlation * whole * others
    rest = whole**2 - shared
    doubt = chance * np.sqrt(shared * max(others**2 - shared, 0))
    return float(np.sqrt(rest)) if rest > SURELY_OWN * doubt else 0.0


@dataclass(frozen=True)
class Views:
    """The motion of a part in the world frame, the palms from which it is seen, and its motion in
    the frame of each."""

    world: RigidMotion
    palms: tuple[RigidMotion, ...]
    from_palms: tuple[RigidMotion, ...]

    @classmethod
    def of(cls, world: RigidMotion, palms: tuple[RigidMotion, ...]) -> "Views":
        """The views of a motion in the world and from palms that are seen long enough."""
        views = [(palm, world.as_seen_from(palm)) for palm in palms]
        long = [(palm, view) for palm, view in views if view.is_long]
        return cls(world, tuple(palm for palm, _ in long), tuple(view for _, view in long))

    def from_calm_palms(self) -> Iterator[tuple[RigidMotion, RigidMotion]]:
        """Each palm without its white noise, and the motion in its frame."""
        for palm in self.palms:
            calm = palm.without_noise
            yield calm, self.world.as_seen_from(calm)

    def windows(self, frames: int) -> Iterator[tuple[float, "Views"]]:
        """Overlapping windows of so many frames, with their middle frames; without those in which
        noise cannot be distinguished from motion."""
        for start in range(0, max(1, len(self.world.seen) - frames + 1), frames // 4):
            span = slice(start, start + frames)
            if self.world[span].is_long:
                palms = tuple(palm[span] for palm in self.palms)
                yield start + (frames - 1) / 2, Views.of(self.world[span], palms)

    def turn_noise(self, summary: Summary = np.median) -> float:
        """Standard deviation per axis of the part's own rotational white noise, radians: the least
        over all views, since a palm's view adds the hand's noise."""
        path = world_path(self.world.turns)
        found = [self.world.turn_noise(summary)]
        for palm, view in zip(self.palms, self.from_palms, strict=True):
            own = own_noise(path, world_path(palm.turns), view.seen, summary)
            found += [view.turn_noise(summary), own]
        return min(found)

    def place_noise(self, summary: Summary = np.median) -> float:
        """The same of the position, metres."""
        found = [self.world.place_noise(summary)]
        for palm, view in zip(self.palms, self.from_palms, strict=True):
            held = gaussian_filter1d(view.places, CARRIED_OVER, axis=0, mode="nearest")
            carried = palm.places + palm.turns.apply(held)
            own = own_noise(self.world.places, carried, view.seen, summary)
            found += [view.place_noise(summary), own]
        return min(found)

    def limit(
        self, usual: float, changes: Callable[[RigidMotion], Float64[np.ndarray, " N"]]
    ) -> float:
        """Limit of the change between consecutive steps, radians or metres: `usual`, or more if a
        palm shares larger changes."""
        world, found = changes(self.world), usual
        if LIMIT_SLACK * world.max(initial=0) <= usual:
            return usual
        for view in self.from_palms:
            shared = changes(view) < np.maximum(usual, SHARED_REST * world)
            shared &= sliding_window_view(view.seen, 3).all(1)
            found = max(found, float(LIMIT_SLACK * world[shared].max(initial=0)))
        return found
