"""What hands tell of an object's motion: what the object does together with a hand is no noise.

A bottle that is shaken four times a second leaps from frame to frame as the pose of a poor
estimator does. Seen from the palm that shakes it, it rests; noise of its poses shakes it there too.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.objects.smoothing import LEAST_FRAMES, Summary, increments, noise_level, path_of
from geneoh.sequence.gaps import fill_gaps, palm_points
from geneoh.sequence.keypoints import PALM, keypoints, palm_axes
from geneoh.sequence.sequence import HandTrack

SHARED = 0.5
"""Share of a change that is left as a palm sees it, up to which the palm moves so too."""


@dataclass(frozen=True)
class Palm:
    """Where a palm is in each frame, and whether it was seen there."""

    turn: Rotation
    middle: Float64[np.ndarray, "T 3"]
    seen: Bool[np.ndarray, " T"]

    @classmethod
    def of(cls, hand: HandTrack) -> "Palm":
        """The palm of a track, of which something is seen in some frame."""
        return cls.at(keypoints(fill_gaps(replace(hand, valid=hand.observed))), hand.trust)

    @classmethod
    def at(cls, joints: Float[Tensor, "T 21 3"], trust: Float[Tensor, "T 21"]) -> "Palm":
        """The palm of keypoints, metres, world frame; seen where all of its own are trusted."""
        points, known = palm_points(joints, trust > 0)
        if not bool(known.any()):
            nothing = np.zeros((len(joints), 3))
            return cls(Rotation.from_rotvec(nothing), nothing, known.cpu().numpy())
        whole = joints.index_copy(1, torch.tensor(PALM, device=joints.device), points)
        axes = palm_axes(whole[:, None]).double().cpu().numpy()
        middle = points.mean(1).double().cpu().numpy()
        return cls(Rotation.from_matrix(axes), middle, known.cpu().numpy())


@dataclass(frozen=True)
class View:
    """The turns of a part, and the places of its middle, as something sees them in some frames."""

    turns: Rotation
    middles: Float64[np.ndarray, "T 3"]
    seen: Bool[np.ndarray, " T"]

    @property
    def is_long(self) -> bool:
        """Whether so many frames in a row are seen that noise is told from motion."""
        runs = sliding_window_view(self.seen, min(LEAST_FRAMES, len(self.seen)))
        return bool(runs.all(1).any())

    def of_palm(self, palm: Palm) -> "View":
        """The same part as a palm sees it."""
        back = palm.turn.inv()
        middles = back.apply(self.middles - palm.middle)
        return View(back * self.turns, middles, self.seen & palm.seen)

    def turn_noise(self, summary: Summary = np.median) -> float:
        """Deviation of the white noise of its turns per axis, radians; see `noise_level`."""
        return noise_level(path_of(self.turns), self.seen, summary)

    def place_noise(self, summary: Summary = np.median) -> float:
        """The same of its middle, metres."""
        return noise_level(self.middles, self.seen, summary)

    def turn_changes(self) -> Float64[np.ndarray, " N"]:
        """How much each turn to the next frame differs from the one before, radians."""
        return np.linalg.norm(np.diff(increments(self.turns), axis=0), axis=1)

    def place_changes(self) -> Float64[np.ndarray, " N"]:
        """How much each step differs from the one before, metres."""
        return np.linalg.norm(np.diff(self.middles, n=2, axis=0), axis=1)


@dataclass(frozen=True)
class Views:
    """A part as the world sees it and as palms do."""

    world: View
    palms: tuple[View, ...]

    @classmethod
    def of(cls, world: View, palms: tuple[Palm, ...]) -> "Views":
        """What is seen from those palms that were seen for long enough."""
        return cls(world, tuple(v for palm in palms if (v := world.of_palm(palm)).is_long))

    def least(self, noise: Callable[[View], float]) -> float:
        """The least noise in any view: a hand has noise of its own, and adds to it."""
        return min(noise(view) for view in (self.world, *self.palms))

    def limit(self, usual: float, changes: Callable[[View], Float64[np.ndarray, " N"]]) -> float:
        """How much a step may differ from the one before, radians or metres: more than usual where
        a palm moves so too."""
        world, found = changes(self.world), usual
        for view in self.palms:
            shared = changes(view) < np.maximum(usual, SHARED * world)
            shared &= sliding_window_view(view.seen, 3).all(1)
            found = max(found, float(1.01 * world[shared].max(initial=0)))
        return found
