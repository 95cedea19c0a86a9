"""Meshes that are larger than the object, such as a convex hull or a box of a hollow one.

A hand that holds such an object has its fingers in the mesh. Cleaning against the mesh moves the
hand, but not out of it, and makes it worse.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d
from torch import Tensor

from geneoh.metrics.contact import TOUCH
from geneoh.pipeline.contradictions import FEWEST, SMOOTHED

SURE, TOO_LARGE = 0.0033, 0.004
"""Depth that is left in the object, metres: up to the first bound the mesh is relied on, from the
second on it is not. No hand of `python -m tools.noisy_objects enclosed` stays as deep in a right
mesh."""


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
                "hollow one, or hand or poses are off their place, so the hand is cleaned "
                f"{mostly}by the prior of hand motion alone; give the mesh of the object itself, "
                "or --trust-object to rely on this one"
            )


def depth_left(fingers: Float[Tensor, "T 5"], counted: Bool[Tensor, " T"]) -> DepthLeft | None:
    """The depth of a cleaned hand by the signed distance of its fingers to the object, metres.

    Only frames that are `counted` matter; None if fingers touch in too few of them.
    """
    apart = uniform_filter1d(fingers.cpu().numpy(), SMOOTHED, axis=0)
    apart.sort(axis=1)
    touching = counted.cpu().numpy() & (apart[:, 0] <= TOUCH)
    if touching.sum() < FEWEST:
        return None
    return DepthLeft(-float(np.median(apart[touching, 1])))
