"""Fingers brought back inside the limits of a hand.

The networks tell a finger's rotations from the wrist, where the last bone of a fist is turned by
more than half a turn. An answer between a fist and an open hand may then take it the other way
round, through the back of the hand.
"""

import math

import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from geneoh.choices import SIDES
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.library import load_hand

ALLOWED = 0.1
"""Radians beyond a limit, on each axis, from which on a joint is brought back."""
DEVIATION = 3.0
"""Of the Gaussian over time, in frames, that a joint is smoothed by which is brought back."""


def within_limits(fingers: Float[Tensor, "T 30 3 3"]) -> Float[Tensor, "T 30 3 3"]:
    """The rotations of the joints of both hands, of which none is beyond the limits for long.

    Joints that always are inside the limits stay exactly as they are.
    """
    low, high = (
        torch.cat([getattr(load_hand(side), name)[1:] for side in SIDES]).to(fingers)
        for name in ("pose_low", "pose_high")
    )

    def beyond(vectors: Tensor) -> Tensor:
        return torch.maximum(low - vectors, vectors - high).amax(-1, keepdim=True)

    turned = matrix_to_axis_angle(fingers)
    angle = turned.norm(dim=-1, keepdim=True).clamp(min=1e-6)
    other_way = turned * (1 - 2 * math.pi / angle)
    held = torch.where(beyond(other_way) < beyond(turned), other_way, turned)
    held = held.clamp(low, high)
    smooth = gaussian_filter1d(held.cpu().numpy(), DEVIATION, axis=0, mode="nearest")
    mended = axis_angle_to_matrix(torch.from_numpy(smooth).to(fingers))
    ill = (beyond(turned) > ALLOWED).any(0)[..., None]
    return torch.where(ill, mended, fingers)
