"""Evidence of an error that lasts: at a wrong place the hand slides over the object that it holds.

A hand that holds an object stays where it is in the object's frame. An error that is constant in
the world turns there as the object turns, so the hand seems to slide. The network of SpatialDiff
looks at each frame by itself and cannot see this, and made hands slide less than real ones; so the
density is written down: sliding is normal, of a deviation that is not known beforehand. Beside the
shift of a hand the place where it holds is free, so a few frames tell nothing.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.spatial import (
    SPEED_UNIT,
    object_noise_of,
    relative_speeds,
    wrist_noise_of,
)

SLIDING = 0.007
"""Deviation of a hand's place in the object's frame below which hardly any hand keeps, metres."""
LEFT = 0.7
"""Share of the noise of the wrist that may be left after MotionDiff: it looks like sliding."""
INDEPENDENT = 0.1
"""Frames that tell something of their own, in each frame: sliding lasts."""
HELD_SPEED = 0.001
"""By how much the object at the hand must be faster than the hand is over it for a frame to count
as held for certain, metres a frame: an object that passes by is not held."""


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
    def of(
        cls,
        middle: Float[Tensor, "B T 3"],
        rotation: Float[Tensor, "B T Q 3 3"],
        translation: Float[Tensor, "B T Q 3"],
        held: Float[Tensor, "B T Q"],
        track: Float[Tensor, "B 12"],
        own: float = 1.0,
    ) -> "Sliding":
        """Over the part of the object that each hand holds longest, world frame, metres.

        White noise on the object's poses and what MotionDiff leaves of the hand's look like
        sliding, so they raise what tells nothing.

        Args:
            middle: mean of the hand's keypoints: people turn objects about it as they hold them.
            rotation: of the object's parts.
            translation: of the object's parts.
            held: how surely the hand holds each part in each frame, 0 to 1.
            track: how noisy hand and object were (`track_cues`).
            own: share of these frames that count for this hand: those of the B hands overlap.
        """
        each, longest = torch.arange(len(held), device=held.device), held.sum(1).argmax(-1)
        rotation, translation, held = (x[each, :, longest] for x in (rotation, translation, held))
        share = held / held.sum(1, keepdim=True).clamp(min=1e-6)

        def from_mean(values: Float[Tensor, "B T *D"]) -> Float[Tensor, "B T *D"]:
            weights = share.view(*share.shape, *[1] * (values.ndim - 2))
            return values - (weights * values).sum(1, keepdim=True)

        back = rotation.mT
        place = (back @ (middle - translation)[..., None])[..., 0]
        slid, turned = from_mean(place), from_mean(back)
        lever = (share * place.square().sum(-1)).sum(1, keepdim=True)
        turn_noise, shift_noise = object_noise_of(track).square().split(1, dim=-1)
        noise = lever * turn_noise + shift_noise + (LEFT * wrist_noise_of(track)).square()
        return cls(
            square=(share[..., None, None] * turned.mT @ turned).sum(1),
            line=(share[..., None, None] * turned.mT @ slid[..., None]).sum(1)[..., 0],
            still=(share * slid.square().sum(-1)).sum(1, keepdim=True),
            least=SLIDING**2 + noise,
            count=own * (INDEPENDENT * held.sum(1, keepdim=True) - 1).clamp(min=0),
        )

    def log_density(self, shifts: Float[Tensor, "B M 3"]) -> Float[Tensor, "B M"]:
        """Logarithm of the density, up to a constant, at shifts of the whole hand, world, metres.

        It is normal with its deviation integrated out, a Student t: a hand that slides far, as one
        that lets go does, tells little.
        """
        size = ((shifts @ self.square + 2 * self.line[:, None]) * shifts).sum(-1) + self.still
        return -1.5 * self.count * torch.log1p(size.clamp(min=0) / self.least)


def holding(
    joints: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T Q 3 3"],
    translation: Float[Tensor, "B T Q 3"],
) -> Float[Tensor, "B T Q"]:
    """How surely each hand holds each part of an object, 0 to 1: both move, and together."""
    held = []
    for part in zip(rotation.unbind(2), translation.unbind(2), strict=True):
        speeds = SPEED_UNIT * torch.expm1(relative_speeds(joints, *part))
        carried, over = speeds[..., 0], speeds[..., 2]
        held.append(((carried - over) / HELD_SPEED).clamp(0, 1))
    return torch.stack(held, dim=-1)
