"""Hands that were moved so far to fit their object that hand and object are of different places.

Nothing shows which of them is off. A hand that keeps its place is no worse than its input.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.pipeline.contradictions import FEWEST, lasting_shift

SURE, TOO_FAR = 0.03, 0.042
"""Lasting shift of a palm, metres: up to the first bound the object is relied on, from the second
on it is not. Hands with lasting errors are moved by up to 22 mm in synthetic clips and 17 mm on the
recording, but for those of a camera, whose ray is known; hands beside an object that is 5 to 9 cm
off its place by 50 to 86."""


@dataclass(frozen=True)
class MovedFar:
    """The shift of a hand that was cleaned against the object."""

    shift: float
    """How far the palm was moved for a second or longer, metres."""

    @property
    def evidence(self) -> float:
        """Whether hand and object may be of one place, 1 to 0."""
        return float(np.interp(self.shift, (SURE, TOO_FAR), (1.0, 0.0)))

    def note(self) -> Iterator[str]:
        """A sentence for the user if the object is not fully relied on."""
        if self.evidence < 1:
            mostly = "mostly " if self.evidence > 0 else ""
            yield (
                f"to fit the object, the hand would have to move by {1000 * self.shift:.0f} mm for "
                "a second or longer: the hand, or the poses or the mesh of the object, are off "
                f"their place, so the hand is cleaned {mostly}by the prior of hand motion alone; "
                "--trust-object relies on the object, and --camera tells where depth is uncertain"
            )


def moved_far(
    before: Float[Tensor, "T 3"], after: Float[Tensor, "T 3"], counted: Bool[Tensor, " T"]
) -> MovedFar | None:
    """The shift of a palm from its place in the input, metres, in the frames that are `counted`;
    None if these are too few."""
    if int(counted.sum()) < FEWEST:
        return None
    was, now = (each.double().cpu().numpy() for each in (before, after))
    return MovedFar(lasting_shift(was, now, counted.cpu().numpy()))
