"""Density of a constant error of the hand's position, from its sliding over the object it holds.

An error that is constant in the world frame rotates in the object frame when the object turns, so
the hand seems to slide. The network of SpatialDiff sees single frames and cannot use this, so the
density is explicit: sliding is normally distributed with unknown standard deviation. The position
on the object is a free parameter beside the shift, so a few frames give no evidence.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.holding import HeldPlace
from geneoh.denoisers.spatial import wrist_noise_of

USUAL_SLIDING = 0.007
"""Standard deviation of a hand's position in the object frame, metres: few hands slide less."""
NOISE_LEFT = 0.7
"""Share of the wrist's noise that may remain after MotionDiff and looks like sliding."""
INDEPENDENT = 0.1
"""Independent samples per frame: sliding is correlated over time."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """Mean square sliding of each of B hands over what it holds, a quadratic form in the shift x of
    the hand (metres, world): x' square x + 2 line' x + still."""

    square: Float[Tensor, "B 3 3"]
    line: Float[Tensor, "B 3"]
    still: Float[Tensor, "B 1"]
    """Mean square sliding at zero shift, m^2."""
    least: Float[Tensor, "B 1"]
    """Expected mean square sliding of a correct hand, m^2; less sliding is no evidence."""
    count: Float[Tensor, "B 1"]
    """Number of independent samples, less one for the unknown position on the object."""

    @classmethod
    def of(cls, held: HeldPlace, track: Float[Tensor, "B 12"], own: float = 1.0) -> "Sliding":
        """The sliding over the part of the object that each hand holds longest.

        White noise on the object's poses and the hand noise that MotionDiff leaves look like
        sliding, so they are added to `least`.

        Args:
            held: position of the centre of each hand on this part.
            track: noise levels of hand and object (`track_cues`).
            own: weight of each frame, below 1 because the frames of the B windows overlap.
        """
        share = held.share

        def from_mean(values: Float[Tensor, "B T *D"]) -> Float[Tensor, "B T *D"]:
            weights = share.view(*share.shape, *[1] * (values.ndim - 2))
            return values - (weights * values).sum(1, keepdim=True)

        slid, turned = from_mean(held.place), from_mean(held.rotation.mT)
        noise = held.object_noise(track) + (NOISE_LEFT * wrist_noise_of(track)).square()
        return cls(
            square=(share[..., None, None] * turned.mT @ turned).sum(1),
            line=(share[..., None, None] * turned.mT @ slid[..., None]).sum(1)[..., 0],
            still=(share * slid.square().sum(-1)).sum(1, keepdim=True),
            least=USUAL_SLIDING**2 + noise,
            count=own * (INDEPENDENT * held.sure.sum(1, keepdim=True) - 1).clamp(min=0),
        )

    def log_density(self, shifts: Float[Tensor, "B M 3"]) -> Float[Tensor, "B M"]:
        """Log density up to a constant at M shifts of the whole hand, world frame, metres.

        A normal density with its standard deviation integrated out, which gives a Student t: far
        sliding, as of a hand that lets go, is weak evidence.
        """
        size = ((shifts @ self.square + 2 * self.line[:, None]) * shifts).sum(-1) + self.still
        return -1.5 * self.count * torch.log1p(size.clamp(min=0) / self.least)
