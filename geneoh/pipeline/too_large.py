"""Meshes that are larger than the object, such as a convex hull or a box of a hollow one.

A hand that holds such an object has its fingers in the mesh. Cleaning against the mesh moves the
hand, but not out of it, and makes it worse.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d
from torch import Tensor

from geneoh.metrics.contact import TOUCH
from geneoh.pipeline.contradictions import FEWEST, SMOOTHED
from geneoh.pipeline.misfit import Misfit

SURE, TOO_LARGE = 0.0033, 0.004
"""Depth that is left in the object, metres: up to the first bound the mesh is relied on, from the
second on it is not. No hand of `python -m tools.noisy_objects enclosed` stays as deep in a right
mesh."""


class DepthLeft(Misfit):
    """Depth of the fingers in the object that a hand was cleaned against.

    It is that of the second deepest finger, as the deepest may be a wrong one, without jitter: the
    median over the frames of contact."""

    bounds = SURE, TOO_LARGE

    def sentence(self, consequence: str) -> str:
        """See `Misfit.sentence`."""
        return (
            f"cleaned against the object, fingers stay {1000 * self.size:.0f} mm deep in it: "
            "its mesh seems to be larger than the object, as a convex hull or a box of a hollow "
            f"one, or hand or poses are off their place, so {consequence}; give the mesh of the "
            "object itself, or --trust-object to rely on this one"
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
