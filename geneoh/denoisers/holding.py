"""Which part of an object a hand holds, and where on it the hand is."""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.spatial import SPEED_UNIT, object_noise_of, relative_speeds

HELD_SPEED = 0.001
"""By how much the object at the hand must be faster than the hand is over it for a frame to count
as held for certain, metres a frame: an object that passes by is not held."""
REACHES, OFF = 0.008, 0.03
"""Speed over the object, metres a frame, and distance from it, metres, that a hand which holds it
does not have both; half of each is no sign. In the view of a camera that moves, the object moves
while the hand reaches for it."""


def holding(
    joints: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T Q 3 3"],
    translation: Float[Tensor, "B T Q 3"],
    apart: Float[Tensor, "B T"] | None = None,
) -> Float[Tensor, "B T Q"]:
    """How surely each hand holds each part of an object, 0 to 1: both move, and together.

    `apart` is how far the nearest keypoint is from the object, metres; None for hands at it.
    """
    off = 0.0 if apart is None else (2 * apart / OFF - 1).clamp(0, 1)
    held = []
    for part in zip(rotation.unbind(2), translation.unbind(2), strict=True):
        speeds = SPEED_UNIT * torch.expm1(relative_speeds(joints, *part))
        carried, over = speeds[..., 0], speeds[..., 2]
        reaches = off * (2 * over / REACHES - 1).clamp(0, 1)
        held.append(((carried - over) / HELD_SPEED).clamp(0, 1) * (1 - reaches))
    return torch.stack(held, dim=-1)


@dataclass(frozen=True, eq=False)
class HeldPlace:
    """Where the middle of each of B hands is on the part of the object that it holds longest."""

    place: Float[Tensor, "B T 3"]  # in the frame of the part, metres
    rotation: Float[Tensor, "B T 3 3"]  # of the part in the world
    sure: Float[Tensor, "B T"]  # how surely it is held, 0 to 1

    @classmethod
    def of(
        cls,
        middle: Float[Tensor, "B T 3"],
        rotation: Float[Tensor, "B T Q 3 3"],
        translation: Float[Tensor, "B T Q 3"],
        held: Float[Tensor, "B T Q"],
    ) -> "HeldPlace":
        """On objects of Q parts, world frame, metres. `middle` is the mean of the hand's keypoints,
        about which people turn what they hold; `held` how surely it holds each part in each frame,
        0 to 1."""
        each, longest = torch.arange(len(held), device=held.device), held.sum(1).argmax(-1)
        rotation, translation, sure = (x[each, :, longest] for x in (rotation, translation, held))
        place = (rotation.mT @ (middle - translation)[..., None])[..., 0]
        return cls(place, rotation, sure)

    @cached_property
    def share(self) -> Float[Tensor, "B T"]:
        """Weight of each frame in means over the frames that are held."""
        return self.sure / self.sure.sum(1, keepdim=True).clamp(min=1e-6)

    def object_noise(self, track: Float[Tensor, "B 12"]) -> Float[Tensor, "B 1"]:
        """Mean square distance in square metres by which white noise on the object's poses moves
        the hand over it; `track` tells how noisy they were (`track_cues`)."""
        lever = (self.share * self.place.square().sum(-1)).sum(1, keepdim=True)
        turn, shift = object_noise_of(track).square().split(1, dim=-1)
        return lever * turn + shift
