"""Shapes of a hand: how far each finger is closed, spread and opposed, as finger poses."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.synthesis.grasping.pose_prior import curled

_MANO_FROM_NAMED = (1, 2, 4, 3, 0)  # thumb, index, middle, ring, pinky to MANO's order
_APART = (1.0, 0.25, -1.0, -0.45)
"""How far each finger goes to its side in a spread hand: index, middle, pinky, ring."""


@dataclass(frozen=True)
class HandShape:
    """A right hand's shape; `fingers` makes a pose of it."""

    curl: tuple[float, float, float, float, float]
    """Thumb, index, middle, ring, pinky: 0 straight, 1 half closed, 2 a fist."""
    spread: float = 0.03  # of the index and the pinky to their sides, radians
    oppose: float = 0.5  # of the thumb's base: 0 beside the palm, 1 opposite to the fingers
    thumb_out: float = 0.0  # of the thumb away from the index in the palm's plane, radians

    def fingers(self) -> Float[Tensor, "15 3"]:
        """Axis-angle of the joints in MANO order, right hand, radians."""
        curl = torch.tensor([[self.curl[i] for i in _MANO_FROM_NAMED]])
        pose = curled(curl)[0]
        pose[[0, 3, 6, 9], 1] += self.spread * torch.tensor(_APART)
        pose[12] = self.oppose * pose[12] + torch.tensor([0.0, self.thumb_out, 0.0])
        return pose


SHAPES = {
    "relaxed": HandShape((0.4, 0.35, 0.45, 0.55, 0.6)),
    "loose": HandShape((0.2, 0.15, 0.2, 0.3, 0.35), spread=0.08, oppose=0.3),
    "flat": HandShape((0.0, 0.0, 0.0, 0.0, 0.0), spread=0.0, oppose=0.1),
    "open": HandShape((0.0, 0.0, 0.0, 0.0, 0.0), spread=0.2, oppose=0.0, thumb_out=0.25),
    "fist": HandShape((1.3, 2.1, 2.1, 2.1, 2.1), spread=0.0, oppose=1.1),
    "one": HandShape((1.2, 0.0, 2.0, 2.1, 2.1), spread=0.0, oppose=1.1),
    "two": HandShape((1.2, 0.0, 0.0, 2.0, 2.1), spread=0.14, oppose=1.2),
    "three": HandShape((1.1, 0.0, 0.0, 0.05, 1.9), spread=0.12, oppose=1.3),
    "four": HandShape((1.2, 0.0, 0.0, 0.0, 0.0), spread=0.14, oppose=1.3),
    "thumb": HandShape((0.0, 2.1, 2.1, 2.1, 2.1), spread=0.0, oppose=0.0, thumb_out=0.5),
    "ring": HandShape((0.9, 1.25, 0.25, 0.15, 0.1), spread=0.1, oppose=1.15),
    "pinch": HandShape((0.8, 1.2, 1.15, 1.2, 1.3), oppose=1.15),
    "grip": HandShape((0.5, 0.85, 0.85, 0.85, 0.85), oppose=1.1),
    "cup": HandShape((0.3, 0.5, 0.5, 0.5, 0.5), spread=0.1, oppose=0.9),
    "claw": HandShape((0.5, 0.8, 0.8, 0.8, 0.8), spread=0.12, oppose=0.5),
    "keys": HandShape((0.15, 0.5, 0.5, 0.5, 0.5), spread=0.08, oppose=0.3),
    "pen": HandShape((0.9, 1.0, 1.15, 1.5, 1.6), spread=0.0, oppose=1.1),
    "phone": HandShape((0.0, 2.0, 2.1, 2.0, 0.1), spread=0.1, oppose=0.0, thumb_out=0.5),
    "horns": HandShape((1.2, 0.0, 2.1, 2.1, 0.0), spread=0.1, oppose=1.2),
    "bent": HandShape((0.3, 1.4, 1.4, 1.4, 1.4), spread=0.0, oppose=0.4),
    "wrapped": HandShape((0.8, 1.6, 1.6, 1.6, 1.6), spread=0.0, oppose=1.0),
    "snapped": HandShape((0.9, 0.6, 1.9, 1.9, 1.9), oppose=1.0),
    "snapping": HandShape((0.7, 0.7, 1.0, 1.7, 1.8), oppose=1.2),
}
"""Shapes by name."""
