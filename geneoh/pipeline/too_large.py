"""Meshes that are larger than the object, such as a convex hull or a box of a hollow one.

A hand that holds such an object has its fingers in the mesh. Cleaning against the mesh moves the
hand, but not out of it, and makes it worse.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool
from scipy.ndimage import uniform_filter1d
from torch import Tensor

from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import ShapedHand
from geneoh.metrics.contact import TOUCH
from geneoh.pipeline.contradictions import FEWEST, SMOOTHED
from geneoh.pipeline.touch import fingers_apart
from geneoh.sequence.windows import blocks

SURE, TOO_LARGE = 0.0033, 0.004
"""Depth that is left in the object, metres: up to the first bound the mesh is relied on, from the
second on it is not."""


@dataclass(frozen=True)
class DepthLeft:
    """Depth of the fingers in the object that a hand was cleaned against."""

    depth: float
    """Of the second deepest finger, as the deepest may be a wrong one, without jitter: the median
    over the frames of contact, metres."""

    @property
    def evidence(self) -> float:
        """Whether the mesh may have the shape of the object, 1 to 0."""
        return float(np.interp(self.depth, (SURE, TOO_LARGE), (1.0, 0.0)))

    def note(self) -> Iterator[str]:
        """A sentence for the user if the mesh is not fully relied on."""
        if self.evidence < 1:
            mostly = "mostly " if self.evidence > 0 else ""
            yield (
                f"cleaned against the object, fingers stay {1000 * self.depth:.0f} mm deep in it: "
                "its mesh seems to be larger than the object, as a convex hull or a box of a "
                f"hollow object, so the hand is cleaned {mostly}by the prior of hand motion alone; "
                "give the mesh of the object itself, or --trust-object to rely on this one"
            )


def depth_left(
    state: HandState, shaped: ShapedHand, surface: MovingSurface, counted: Bool[Tensor, " T"]
) -> DepthLeft:
    """The depth of a cleaned hand; only frames that are `counted` matter, and too few of them tell
    nothing."""
    parts = [
        fingers_apart(state[some].verts(shaped)[0], surface.at(some), shaped.model)
        for some in blocks(len(counted))
    ]
    fingers = uniform_filter1d(torch.cat(parts).cpu().numpy(), SMOOTHED, axis=0)
    fingers.sort(axis=1)
    touching = counted.cpu().numpy() & (fingers[:, 0] <= TOUCH)
    if touching.sum() < FEWEST:
        return DepthLeft(0.0)
    return DepthLeft(-float(np.median(fingers[touching, 1])))
