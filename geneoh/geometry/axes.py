"""Which axis of a world points up, and the turn from one choice to another."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import AXES, Axis

TURNS = {
    "x": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "y": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "z": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "-x": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)),
    "-y": ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
    "-z": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
}
"""Rotations by which each axis comes to point along z."""


def turn_up(up: Axis, to: Axis = "z") -> Float[Tensor, "3 3"]:
    """The rotation of a world whose axis `up` points up into one in which `to` does."""
    return torch.tensor(TURNS[to]).T @ torch.tensor(TURNS[up])


def nearest_axis(direction: Float[Tensor, " 3"]) -> Axis:
    """The signed axis to which a direction is nearest."""
    index = int(direction.abs().argmax())
    return AXES[index + 3 * bool(direction[index] < 0)]
