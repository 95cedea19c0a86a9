"""Hands that do not fit their object even after they were cleaned against it."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d
from torch import Tensor

from geneoh.metrics.contact import TOUCH
from geneoh.pipeline.contradictions import FEWEST, SMOOTHED, lasting_shift


@dataclass(frozen=True)
class Misfit(ABC):
    """How badly a hand fits the object that it was cleaned against."""

    size: float
    """Metres."""
    bounds: ClassVar[tuple[float, float]]
    """Sizes in metres: up to the first the object is relied on, from the second on it is not."""

    @property
    def evidence(self) -> float:
        """Whether the object may be relied on, 1 to 0."""
        return float(np.interp(self.size, self.bounds, (1.0, 0.0)))

    def note(self) -> Iterator[str]:
        """A sentence for the user if the object is not fully relied on."""
        if self.evidence < 1:
            mostly = "mostly " if self.evidence > 0 else ""
            yield self.sentence(f"the hand is cleaned {mostly}by the prior of hand motion alone")

    @abstractmethod
    def sentence(self, consequence: str) -> str:
        """What does not fit, with its consequence and the remedy."""


class DepthLeft(Misfit):
    """Depth of the fingers in the object that a hand was cleaned against.

    It is that of the second deepest finger, as the deepest may be a wrong one, without jitter: the
    median over the frames of contact. Where it is large, so is the mesh, such as a convex hull or a
    box of a hollow object: cleaning moves the hand, but not out of it, and makes it worse. No hand
    of `python -m tools.noisy_objects enclosed` stays as deep in a right mesh."""

    bounds = 0.0033, 0.004

    def sentence(self, consequence: str) -> str:
        """See `Misfit.sentence`."""
        return (
            f"cleaned against the object, fingers stay {1000 * self.size:.0f} mm deep in it: "
            "its mesh seems to be larger than the object, as a convex hull or a box of a hollow "
            f"one, or hand or poses are off their place, so {consequence}; give the mesh of the "
            "object itself, or --trust-object to rely on this one"
        )


class MovedFar(Misfit):
    """How far the palm of a hand was moved for a second or longer, to fit the object.

    Nothing shows which of them is off, but a hand that keeps its place is no worse than its input.
    Hands with lasting errors are moved by up to 22 mm in synthetic clips and 17 mm on the
    recording, but for those of a camera, whose ray is known; hands beside an object that is 5 to 9
    cm off its place by 50 to 86."""

    bounds = 0.03, 0.042

    def sentence(self, consequence: str) -> str:
        """See `Misfit.sentence`."""
        return (
            f"to fit the object, the hand would have to move by {1000 * self.size:.0f} mm for "
            "a second or longer: the hand, or the poses or the mesh of the object, are off "
            f"their place, so {consequence}; --trust-object relies on the object, and --camera "
            "tells where depth is uncertain"
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


def moved_far(
    before: Float[Tensor, "T 3"], after: Float[Tensor, "T 3"], counted: Bool[Tensor, " T"]
) -> MovedFar | None:
    """The shift of a palm from its place in the input, metres, in the frames that are `counted`;
    None if these are too few."""
    if int(counted.sum()) < FEWEST:
        return None
    was, now = (each.double().cpu().numpy() for each in (before, after))
    return MovedFar(lasting_shift(was, now, counted.cpu().numpy()))
