"""Evidence of an error that lasts: at a wrong place the hand slides over the object that it holds.

An error that is constant in the world turns in the object's frame as the object turns, so the hand
seems to slide. The network of SpatialDiff looks at each frame by itself and cannot see this; so the
density is written down: sliding is normal, of a deviation that is not known beforehand. Beside the
shift of a hand the place where it holds is free, so a few frames tell nothing.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.holding import HeldPlace
from geneoh.denoisers.spatial import wrist_noise_of

SLIDING = 0.007
"""Deviation of a hand's place in the object's frame below which hardly any hand keeps, metres."""
LEFT = 0.7
"""Share of the noise of the wrist that may be left after MotionDiff: it looks like sliding."""
INDEPENDENT = 0.1
"""Frames that tell something of their own, in each frame: sliding lasts."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """How far each of B hands slides over what it holds: a quadratic of the shift of the hand."""

    square: Float[Tensor, "B 3 3"]
    line: Float[Tensor, "B 3"]
    still: Float[Tensor, "B 1"]
    """Mean square of the sliding without a shift, square metres."""
    least: Float[Tensor, "B 1"]
    """Mean square below which sliding tells nothing, square metres."""
    count: Float[Tensor, "B 1"]
    """Frames that tell something of their own, less one: where on the object it is held is free."""

    @classmethod
    def of(cls, held: HeldPlace, track: Float[Tensor, "B 12"], own: float = 1.0) -> "Sliding":
        """Over the part of the object that each hand holds longest.

        White noise on the object's poses and what MotionDiff leaves of the hand's look like
        sliding, so they raise what tells nothing.

        Args:
            held: where the middle of each hand is on it.
            track: how noisy hand and object were (`track_cues`).
            own: share of these frames that count for this hand: those of the B hands overlap.
        """
        share = held.share

        def from_mean(values: Float[Tensor, "B T *D"]) -> Float[Tensor, "B T *D"]:
            weights = share.view(*share.shape, *[1] * (values.ndim - 2))
            return values - (weights * values).sum(1, keepdim=True)

        slid, turned = from_mean(held.place), from_mean(held.rotation.mT)
        noise = held.object_noise(track) + (LEFT * wrist_noise_of(track)).square()
        return cls(
            square=(share[..., None, None] * turned.mT @ turned).sum(1),
            line=(share[..., None, None] * turned.mT @ slid[..., None]).sum(1)[..., 0],
            still=(share * slid.square().sum(-1)).sum(1, keepdim=True),
            least=SLIDING**2 + noise,
            count=own * (INDEPENDENT * held.sure.sum(1, keepdim=True) - 1).clamp(min=0),
        )

    def log_density(self, shifts: Float[Tensor, "B M 3"]) -> Float[Tensor, "B M"]:
        """Logarithm of the density, up to a constant, at shifts of the whole hand, world, metres.

        Normal with its deviation integrated out, a Student t: a hand that slides far, as one that
        lets go does, tells little.
        """
        size = ((shifts @ self.square + 2 * self.line[:, None]) * shifts).sum(-1) + self.still
        return -1.5 * self.count * torch.log1p(size.clamp(min=0) / self.least)
