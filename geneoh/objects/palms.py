"""What hands tell of an object's motion: what the object does together with a hand is no noise.

A bottle that is shaken leaps from frame to frame as the pose of a poor estimator does. Seen from
the palm that shakes it, it rests; noise of its poses shakes it there too.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.geometry.rotations import is_rotation
from geneoh.objects.smoothing import LEAST_FRAMES, Summary, increments, noise_level, path_of
from geneoh.sequence.gaps import filled_keypoints, palm_points
from geneoh.sequence.keypoints import PALM, palm_axes
from geneoh.sequence.sequence import HandTrack

SHARED = 0.5  # a palm shares a change of motion if it sees at most this part of the change
SLACK = 1.01  # by how much a limit is above the largest change that a palm shares


@dataclass(frozen=True)
class RigidMotion:
    """How a part of an object or a palm moves, and the frames in which it was seen."""

    turns: Rotation
    places: Float64[np.ndarray, "T 3"]  # of its middle, metres
    seen: Bool[np.ndarray, " T"]

    def as_seen_from(self, palm: "RigidMotion") -> "RigidMotion":
        """The same motion as a palm sees it."""
        back = palm.turns.inv()
        places = back.apply(self.places - palm.places)
        return RigidMotion(back * self.turns, places, self.seen & palm.seen)

    @property
    def is_long(self) -> bool:
        """Whether so many frames in a row are seen that noise is told from motion."""
        return bool(sliding_window_view(self.seen, LEAST_FRAMES).all(1).any())

    def turn_noise(self, summary: Summary = np.median) -> float:
        """Deviation of the white noise of its turns per axis, radians; see `noise_level`."""
        return noise_level(path_of(self.turns), self.seen, summary)

    def place_noise(self, summary: Summary = np.median) -> float:
        """The same of its middle, metres."""
        return noise_level(self.places, self.seen, summary)

    def turn_changes(self) -> Float64[np.ndarray, " N"]:
        """How much each turn to the next frame differs from the one before, radians."""
        return np.linalg.norm(np.diff(increments(self.turns), axis=0), axis=1)

    def place_changes(self) -> Float64[np.ndarray, " N"]:
        """How much each step differs from the one before, metres."""
        return np.linalg.norm(np.diff(self.places, n=2, axis=0), axis=1)


def palm_of(hand: HandTrack) -> RigidMotion:
    """The palm of a track, of which something is seen in some frame."""
    return palm_at(filled_keypoints(hand), hand.trust > 0)


def palm_at(joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"]) -> RigidMotion:
    """The palm of keypoints, metres, world frame; seen where all of its own are trusted. Those that
    never are count as they are; axes that they do not tell are the world's."""
    points, known = palm_points(joints, trusted)
    whole = joints.index_copy(1, torch.tensor(PALM, device=joints.device), points)
    axes = palm_axes(whole[:, None])
    axes = torch.where(is_rotation(axes)[:, None, None], axes, torch.eye(3).to(axes))
    middle = points.mean(1).double().cpu().numpy()
    turns = Rotation.from_matrix(axes.double().cpu().numpy())
    return RigidMotion(turns, middle, known.cpu().numpy())


@dataclass(frozen=True)
class Views:
    """The motion of a part as the world sees it and as palms do."""

    world: RigidMotion
    palms: tuple[RigidMotion, ...]

    @classmethod
    def of(cls, world: RigidMotion, palms: tuple[RigidMotion, ...]) -> "Views":
        """What is seen from those palms that were seen for long enough."""
        return cls(world, tuple(v for palm in palms if (v := world.as_seen_from(palm)).is_long))

    @property
    def every(self) -> tuple[RigidMotion, ...]:
        """All views; the least noise counts, as a hand has noise of its own and adds to it."""
        return self.world, *self.palms

    def limit(
        self, usual: float, changes: Callable[[RigidMotion], Float64[np.ndarray, " N"]]
    ) -> float:
        """How much a step may differ from the one before, radians or metres: more than usual where
        a palm moves so too."""
        world, found = changes(self.world), usual
        if SLACK * world.max(initial=0) <= usual:
            return usual
        for view in self.palms:
            shared = changes(view) < np.maximum(usual, SHARED * world)
            shared &= sliding_window_view(view.seen, 3).all(1)
            found = max(found, float(SLACK * world[shared].max(initial=0)))
        return found
