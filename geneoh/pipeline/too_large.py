"""Meshes that are larger than the object, such as a convex hull or a box of a hollow one.

A hand that holds such an object has its fingers in the mesh. Cleaning against the mesh moves the
hand, but not out of it, and makes it worse.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d
from torch import Tensor

from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import ShapedHand
from geneoh.metrics.contact import TOUCH
from geneoh.pipeline.contradictions import FEWEST, SMOOTHED
from geneoh.pipeline.touch import fingers_apart
from geneoh.sequence.keypoints import KNUCKLES
from geneoh.sequence.windows import blocks

OF_FINGERS = [point for point in range(2, 21) if point not in KNUCKLES]
"""Keypoints beyond the base of the thumb and of each finger."""
SURE, TOO_LARGE = 0.008, 0.011
"""Sum of both depths, metres: up to the first bound the mesh is relied on, from the second on it is
not."""


@dataclass(frozen=True)
class DepthLeft:
    """Depth of a hand in the object that it was cleaned against, metres.

    Both are medians over the frames of contact, without jitter, of the second deepest finger or
    keypoint, as the deepest may be a wrong one.
    """

    bones: float  # of the keypoints of fingers before the fit; negative outside, as bones should be
    skin: float  # of the fingers' skin after the fit

    @property
    def evidence(self) -> float:
        """Whether the mesh may have the shape of the object, 1 to 0."""
        return float(np.interp(self.bones + self.skin, (SURE, TOO_LARGE), (1.0, 0.0)))

    def note(self) -> Iterator[str]:
        """A sentence for the user if the mesh is not fully relied on."""
        if self.evidence < 1:
            mostly = "mostly " if self.evidence > 0 else ""
            yield (
                f"cleaned against the object, the fingers stay {1000 * self.skin:.0f} mm deep in "
                "it: its mesh seems to be larger than the object, as a convex hull or a box of a "
                f"hollow object, so the hand is cleaned {mostly}by the prior of hand motion alone; "
                "give the mesh of the object itself, or --trust-object to rely on this one"
            )


def depth_left(
    target: Float[Tensor, "T 21 3"],
    state: HandState,
    shaped: ShapedHand,
    surface: MovingSurface,
    counted: Bool[Tensor, " T"],
) -> DepthLeft:
    """The depth of a hand whose keypoints are `target` before and `state` after the fit; only
    frames that are `counted` matter, and too few of them tell nothing."""
    skin, bones = [], []
    for some in blocks(len(target)):
        verts, there = state[some].verts(shaped)[0], surface.at(some)
        skin.append(fingers_apart(verts, there, shaped.model))
        bones.append(there.query(target[some][:, OF_FINGERS]).distance)
    fingers, points = (smoothed_and_sorted(torch.cat(each)) for each in (skin, bones))
    touching = counted.cpu().numpy() & (fingers[:, 0] <= TOUCH)
    if touching.sum() < FEWEST:
        return DepthLeft(0.0, 0.0)
    return DepthLeft(*(float(-np.median(each[touching, 1])) for each in (points, fingers)))


def smoothed_and_sorted(distance: Float[Tensor, "T P"]) -> Float[np.ndarray, "T P"]:
    """Signed distances without jitter, the least of each frame first."""
    return np.sort(uniform_filter1d(distance.cpu().numpy(), SMOOTHED, axis=0), axis=1)
