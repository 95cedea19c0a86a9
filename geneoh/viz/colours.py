"""What the colours on a hand mean: three measures, their scales with units, and their ramps."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from typing_extensions import assert_never

from geneoh.choices import Colouring
from geneoh.metrics.contact import TOUCH

SKIN = (0.86, 0.69, 0.59)
OBJECT = (0.55, 0.63, 0.73)
DEEPEST = 0.006
"""Penetration in metres at which its ramp ends."""
WIDEST = 0.02
"""Expected error in metres at which its ramp ends."""


@dataclass(frozen=True)
class Scale:
    """How one measure becomes a colour; 0 on the ramp keeps the skin's colour."""

    title: str
    ramp: tuple[tuple[float, float, float], ...]
    """Colours at even steps from 0 to 1."""
    ends: tuple[str, str]
    """What 0 and 1 on the ramp are, with the unit."""

    def colours(self, value: Float[np.ndarray, "*B"]) -> Float[np.ndarray, "*B 3"]:
        """The colour of each value on the ramp, 0 to 1."""
        stops = np.array(self.ramp)
        at = np.linspace(0, 1, len(stops))
        return np.stack([np.interp(value, at, stops[:, i]) for i in range(3)], -1).astype(
            np.float32
        )


SCALES: dict[Colouring, Scale] = {
    "penetration": Scale(
        "penetration depth",
        (SKIN, (0.98, 0.70, 0.16), (0.93, 0.32, 0.13), (0.78, 0.06, 0.22), (0.45, 0.0, 0.30)),
        ("0", f"{1000 * DEEPEST:.0f} mm"),
    ),
    "contact": Scale(
        "distance to the object",
        (SKIN, (0.62, 0.78, 0.52), (0.10, 0.62, 0.47), (0.0, 0.45, 0.55)),
        (f"{1000 * TOUCH:.0f} mm", "touches"),
    ),
    "spread": Scale(
        "expected error",
        (SKIN, (0.74, 0.55, 0.78), (0.48, 0.33, 0.78), (0.20, 0.12, 0.62)),
        ("0", f"{1000 * WIDEST:.0f} mm"),
    ),
}


def on_ramp(
    colouring: Colouring,
    distance: Float[Tensor, "*B V"],
    spread: Float[Tensor, "*B V"] | None,
) -> Float[Tensor, "*B V"]:
    """Where each vertex stands on the ramp of a measure, 0 to 1.

    Args:
        colouring: the measure.
        distance: to the object, metres, negative inside.
        spread: expected error (`HandTrack.joint_spread`) of each vertex, metres, where it is known.
    """
    match colouring:
        case "plain":
            return torch.zeros_like(distance)
        case "penetration":
            return (-distance / DEEPEST).clamp(0, 1)
        case "contact":
            return (1 - distance.clamp(min=0) / TOUCH).clamp(0, 1)
        case "spread":
            return torch.zeros_like(distance) if spread is None else (spread / WIDEST).clamp(0, 1)
        case _:
            assert_never(colouring)


def ramp_colours(colouring: Colouring, told: Float[np.ndarray, "*B"]) -> Float[np.ndarray, "*B 3"]:
    """Red, green and blue, 0 to 1, for places on the ramp of a measure."""
    return SCALES.get(colouring, SCALES["penetration"]).colours(told)
