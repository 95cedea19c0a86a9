"""Finger joints brought back inside the limits of a hand.

The networks predict a finger's rotations relative to the wrist. In a fist the last bone is turned
by more than half a turn, so that a prediction between a fist and an open hand may bend the finger
the other way round, through the back of the hand.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import SIDES
from geneoh.generators.sampling import smoothed_clips
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.library import load_hand

ALLOWED = 0.1
"""Tolerance beyond a limit, on one axis, up to which a joint counts as inside, radians."""
FASTEST = math.radians(25)
"""Rotation of a joint from frame to frame, at 30 frames a second, that counts as a leap, radians.
Joints turn by up to 11 degrees where hands snap or clench their fingers, by 30 where they count."""
DEVIATION = 3.0
"""Standard deviation of the Gaussian over time that smooths a corrected joint, frames."""


@dataclass(frozen=True)
class FingerRange(Bundle):
    """Least and largest axis-angle vector of each finger joint, radians on each axis."""

    low: Float[Tensor, "30 3"]
    high: Float[Tensor, "30 3"]

    @staticmethod
    def of_hands() -> "FingerRange":
        """The limits of the left and the right hand model."""
        hands = [load_hand(side) for side in SIDES]
        low, high = ([getattr(h, name)[1:] for h in hands] for name in ("pose_low", "pose_high"))
        return FingerRange(torch.cat(low), torch.cat(high))

    def beyond(self, vectors: Float[Tensor, "*B 30 3"]) -> Float[Tensor, "*B 30"]:
        """How far joints are beyond the range on their worst axis, radians; negative inside."""
        return torch.maximum(self.low - vectors, vectors - self.high).amax(-1)


def within_limits(fingers: Float[Tensor, "T 30 3 3"]) -> Float[Tensor, "T 30 3 3"]:
    """Finger rotations of both hands; joints that exceed their limits, or leap between frames, are
    clamped and smoothed.

    All other joints stay exactly as they are.
    """
    limits, turned = FingerRange.of_hands().to(fingers.device), matrix_to_axis_angle(fingers)
    angle = turned.norm(dim=-1, keepdim=True).clamp(min=1e-6)
    other_way = turned * (1 - 2 * math.pi / angle)
    nearer = limits.beyond(other_way) < limits.beyond(turned)
    held = torch.where(nearer[..., None], other_way, turned).clamp(limits.low, limits.high)
    held = smoothed_clips(held.flatten(1)[None], DEVIATION)[0].reshape_as(held)
    steps = matrix_to_axis_angle(fingers[:-1].mT @ fingers[1:]).norm(dim=-1)
    ill = (limits.beyond(turned) > ALLOWED).any(0) | (steps > FASTEST).any(0)
    return torch.where(ill[:, None, None], axis_angle_to_matrix(held), fingers)
