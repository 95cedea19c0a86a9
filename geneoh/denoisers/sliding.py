"""Evidence of an error that lasts: at a wrong place the hand slides over the object that it holds.

A hand that holds an object stays where it is in the object's frame. An error that is constant in
the world turns there as the object turns, so the hand seems to slide. The network of SpatialDiff
looks at each frame by itself and cannot see this, and made hands slide less than real ones; so the
density is written down: sliding is normal, of a deviation that is not known beforehand.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.denoisers.spatial import (
    SPEED_UNIT,
    SpatialEvidence,
    object_noise_of,
    relative_speeds,
    wrist_noise_of,
)

SLIDING = 0.007
"""Deviation of a hand's place in the object's frame below which hardly any hand keeps, metres."""
LEFT = 0.7
"""Share of the noise of the wrist that may be left after MotionDiff: it looks like sliding."""
INDEPENDENT = 0.1
"""Frames that tell something of their own in each frame: sliding lasts."""
HELD_SPEED = 0.001
"""By how much the object at the hand must be faster than the hand is over it for a frame to count
as held for certain, metres a frame: an object that passes by is not held."""


@dataclass(frozen=True, eq=False)
class Sliding(Bundle):
    """How far each of B hands slides over what it holds: a quadratic of the shift of the hand."""

    square: Float[Tensor, "B 3 3"]
    line: Float[Tensor, "B 3"]
    still: Float[Tensor, "B 1"]
    """Mean square of the sliding without a shift, square metres."""
    least: Float[Tensor, "B 1"]
    """Mean square below which sliding tells nothing, square metres."""
    frames: Float[Tensor, "B 1"]
    """Frames that tell something of their own, less one: where on the object it is held is free."""

    @classmethod
    def of(cls, evidence: SpatialEvidence, relied: Float[Tensor, "B T"]) -> "Sliding":
        """Over the part of the object that each hand holds longest.

        The place of a hand is the mean of its keypoints: people turn objects about it as they hold
        them. `relied`, 0 to 1, is how far the object's poses are relied on. White noise on them and
        what MotionDiff leaves of the hand's look like sliding, so they raise what tells nothing.
        """
        parts = zip(evidence.rotation.unbind(2), evidence.translation.unbind(2), strict=True)
        speeds = [relative_speeds(evidence.joints, *part) for part in parts]
        held = relied[..., None] * torch.stack([holding(part) for part in speeds], dim=-1)
        each, longest = torch.arange(len(held), device=held.device), held.sum(1).argmax(-1)
        rotation, translation, held = (
            x[each, :, longest] for x in (evidence.rotation, evidence.translation, held)
        )
        share = held / held.sum(1, keepdim=True).clamp(min=1e-6)

        def from_mean(values: Float[Tensor, "B T *D"]) -> Float[Tensor, "B T *D"]:
            weights = share.view(*share.shape, *[1] * (values.ndim - 2))
            return values - (weights * values).sum(1, keepdim=True)

        back = rotation.mT
        place = (back @ (evidence.joints.mean(2) - translation)[..., None])[..., 0]
        slid, turned = from_mean(place), from_mean(back)
        lever = (share * place.square().sum(-1)).sum(1, keepdim=True)
        turn_noise, shift_noise = object_noise_of(evidence.track).square().split(1, dim=-1)
        noise = lever * turn_noise + shift_noise + (LEFT * wrist_noise_of(evidence.track)).square()
        return cls(
            square=(share[..., None, None] * turned.mT @ turned).sum(1),
            line=(share[..., None, None] * turned.mT @ slid[..., None]).sum(1)[..., 0],
            still=(share * slid.square().sum(-1)).sum(1, keepdim=True),
            least=SLIDING**2 + noise,
            frames=(INDEPENDENT * held.sum(1, keepdim=True) - 1).clamp(min=0),
        )

    def log_density(self, shifts: Float[Tensor, "B M 3"]) -> Float[Tensor, "B M"]:
        """Logarithm of the density, up to a constant, at shifts of the whole hand, world, metres.

        It is normal with its deviation integrated out, a Student t: a hand that slides far, as one
        that lets go does, tells little.
        """
        size = ((shifts @ self.square + 2 * self.line[:, None]) * shifts).sum(-1) + self.still
        return -1.5 * self.frames * torch.log1p(size.clamp(min=0) / self.least)


def holding(speeds: Float[Tensor, "B T 5"]) -> Float[Tensor, "B T"]:
    """How surely the hand holds what it has these speeds to, 0 to 1: both move, and together."""
    carried, _, over, *_ = (SPEED_UNIT * torch.expm1(speeds)).unbind(-1)
    return ((carried - over) / HELD_SPEED).clamp(0, 1)
