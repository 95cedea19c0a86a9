"""What the denoisers share: rates of the object, and scales of their data."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rotations import matrix_to_axis_angle

HAND_SCALE = 0.08
"""Deviation of canonical keypoints around the contact points, metres: the unit of what networks
read of them. It is fixed: each window's own, as in the paper, would lose bone lengths."""
NOISE_SCALE = 0.02  # how far a clean keypoint typically is from its observation, metres
POINTS = 32  # contact points K the networks are trained with
SELECT_EVERY = 4  # contact points are chosen from every fourth frame


def object_rates(
    move: Float[Tensor, "B N 3"], turn: Float[Tensor, "B N 3 3"], axes: Float[Tensor, "B 3 3"]
) -> Float[Tensor, "B N+1 6"]:
    """Steps (m) and turns of the object to the next frame as features, in the given axes.

    They are in 3 mm and 0.03 rad, at most ten of these, and zero in the last frame.
    """
    rates = torch.cat([move @ axes / 0.003, matrix_to_axis_angle(turn) @ axes / 0.03], dim=-1)
    return torch.nn.functional.pad(rates, (0, 0, 0, 1)).clamp(-10, 10)
