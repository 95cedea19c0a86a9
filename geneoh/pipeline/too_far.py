"""Hands that were moved so far to fit their object that hand and object are of different places.

Nothing shows which of them is off. A hand that keeps its place is no worse than its input.
"""

from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.pipeline.contradictions import FEWEST, lasting_shift
from geneoh.pipeline.misfit import Misfit

SURE, TOO_FAR = 0.03, 0.042
"""Lasting shift of a palm, metres: up to the first bound the object is relied on, from the second
on it is not. Hands with lasting errors are moved by up to 22 mm in synthetic clips and 17 mm on the
recording, but for those of a camera, whose ray is known; hands beside an object that is 5 to 9 cm
off its place by 50 to 86."""


class MovedFar(Misfit):
    """How far the palm of a hand was moved for a second or longer, to fit the object."""

    bounds = SURE, TOO_FAR

    def sentence(self, consequence: str) -> str:
        """See `Misfit.sentence`."""
        return (
            f"to fit the object, the hand would have to move by {1000 * self.size:.0f} mm for "
            "a second or longer: the hand, or the poses or the mesh of the object, are off "
            f"their place, so {consequence}; --trust-object relies on the object, and --camera "
            "tells where depth is uncertain"
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
