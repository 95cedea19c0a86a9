"""Confidence that a hand holds a part of an object, and the hand's position on that part."""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.spatial import SPEED_UNIT, object_noise_of, relative_speeds

HELD_SPEED = 0.001
"""Confidence is 1 where the object's speed at the hand exceeds the hand's speed relative to the
object by this much, metres per frame: an object that passes by is not held."""
REACHES, OFF = 0.008, 0.03
"""A hand with at least this relative speed, metres per frame, at this distance from the object,
metres, certainly does not hold it; at half of either there is no effect. This matters with a moving
camera, where the object moves in the camera frame while the hand still reaches for it."""


def holding(
    joints: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T Q 3 3"],
    translation: Float[Tensor, "B T Q 3"],
    apart: Float[Tensor, "B T"] | None = None,
) -> Float[Tensor, "B T Q"]:
    """Confidence, 0 to 1, that each hand holds each part of an object: both move, and together.

    `apart` is the distance of the nearest keypoint to the object, metres; None stands for zero.
    """
    away = 0.0 if apart is None else (2 * apart / OFF - 1).clamp(0, 1)
    held = []
    for part in zip(rotation.unbind(2), translation.unbind(2), strict=True):
        speeds = SPEED_UNIT * torch.expm1(relative_speeds(joints, *part))
        carried, over = speeds[..., 0], speeds[..., 2]
        reaches = away * (2 * over / REACHES - 1).clamp(0, 1)
        held.append(((carried - over) / HELD_SPEED).clamp(0, 1) * (1 - reaches))
    return torch.stack(held, dim=-1)


@dataclass(frozen=True, eq=False)
class HeldPlace:
    """Position of the centre of each of B hands on the object part that it holds longest."""

    place: Float[Tensor, "B T 3"]  # centre of the hand in the frame of the part, metres
    rotation: Float[Tensor, "B T 3 3"]  # rotation of the part, part frame to world
    sure: Float[Tensor, "B T"]  # confidence that the part is held, 0 to 1

    @classmethod
    def of(
        cls,
        middle: Float[Tensor, "B T 3"],
        rotation: Float[Tensor, "B T Q 3 3"],
        translation: Float[Tensor, "B T Q 3"],
        held: Float[Tensor, "B T Q"],
    ) -> "HeldPlace":
        """Select the longest held of Q parts and express the hand's centre in its frame.

        Inputs are in the world frame, metres. `middle` is the mean of the hand's keypoints, about
        which people turn what they hold; `held` is the result of `holding`."""
        each, longest = torch.arange(len(held), device=held.device), held.sum(1).argmax(-1)
        rotation, translation, sure = (x[each, :, longest] for x in (rotation, translation, held))
        place = (rotation.mT @ (middle - translation)[..., None])[..., 0]
        return cls(place, rotation, sure)

    @cached_property
    def share(self) -> Float[Tensor, "B T"]:
        """Weight of each frame in means over held frames; sums to 1."""
        return self.sure / self.sure.sum(1, keepdim=True).clamp(min=1e-6)

    def object_noise(self, track: Float[Tensor, "B 12"]) -> Float[Tensor, "B 1"]:
        """Mean square displacement, m^2, of the hand in the part frame that white noise on the
        object's poses causes; the noise is read from `track` (`track_cues`)."""
        lever = (self.share * self.place.square().sum(-1)).sum(1, keepdim=True)
        turn, shift = object_noise_of(track).square().split(1, dim=-1)
        return lever * turn + shift
