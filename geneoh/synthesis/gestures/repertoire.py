"""Building blocks of the gestures of synthetic bodies: places, orientations and shapes of a hand.

Places and directions are those of a right hand, relative to its shoulder: outward from the middle
of the body, upward, forward; left hands are mirrored. Lengths are for an adult's arm of 0.545 m
from shoulder to wrist, and are scaled to other arms.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.synthesis.grasping.grasp_types import curled

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


Vector = tuple[float, float, float]
Course = Literal["still", "swing", "strike", "once"]
Fingering = Literal["along", "grasp", "throw", "taps", "ripple", "steps"]


@dataclass(frozen=True)
class HandPose:
    """Place, orientation and finger shape of a hand."""

    place: Vector  # of the wrist, metres
    along: Vector  # direction of the fingers of a flat hand
    palm: Vector  # direction that the palm faces
    shape: str = "relaxed"

    def __post_init__(self) -> None:
        """Refuse unknown shapes when the table is read, not when the gesture is drawn."""
        assert self.shape in SHAPES, f"no shape {self.shape}"


@dataclass(frozen=True)
class Strokes:
    """The time course of a gesture's strokes."""

    course: Course
    """To the end and back as a sine ("swing"), in short blows ("strike"), or once, with a pause at
    the end ("once"); "still" for a hand that stays."""
    shortest: float = 2.0  # range of the duration of a stroke there and back, seconds
    longest: float = 3.5


@dataclass(frozen=True)
class Gesture:
    """A gesture of one hand; `says` are English verb phrases for it, the plainest first."""

    says: tuple[str, ...]
    start: HandPose
    end: HandPose | None = None  # the other end of the stroke; None for a hand that stays
    strokes: Strokes = Strokes("still")
    fingers: Fingering = "along"
    """Time course of the fingers: from the start's shape to the end's with the stroke ("along"),
    closing around an imagined object and opening again ("grasp"), letting go ("throw"), tapping
    ("taps"), tapping in turn from pinky to index ("ripple"), or through `steps` ("steps")."""
    steps: tuple[str, ...] = ()  # shapes one after the other, one per stroke
    swivel: float = 0.0  # of the elbow outward from its relaxed place, radians


@dataclass(frozen=True)
class PairGesture(Gesture):
    """A gesture of both hands, given for the right hand; `says` describes both."""

    left: Gesture | None = None  # None where the left hand mirrors the right one
    apart: float = 0.0  # phase of the left hand minus that of the right one, in strokes
    seated: float = 0.3  # share of the people who sit
    cross: float = 0.0  # how much lower the left hand is, metres, so that arms cross
    touches: bool = False  # whether the palms meet; variations then leave them together


UP, FORWARD = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN, INWARD = (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0)
READY = HandPose((0.05, -0.32, 0.28), (-0.2, 0.1, 1.0), (-0.7, -0.7, 0.0), "loose")
"""A hand before the body that is about to do something."""

RESTS = {
    "side": HandPose((0.07, -0.52, 0.03), (0.0, -1.0, 0.1), INWARD),
    "belly": HandPose((-0.06, -0.36, 0.2), (-1.0, 0.05, 0.15), (0.0, 0.0, -1.0)),
    "hip": HandPose((0.08, -0.36, -0.02), (-0.5, -0.45, 0.7), (-0.8, -0.2, -0.5)),
    "lap": HandPose((0.0, -0.36, 0.3), (-0.2, -0.2, 1.0), DOWN),
}
"""Where hands rest: at the side, on the belly or the hip; those of people who sit, in the lap."""
REST_SAYS = (
    "rest",
    "stay still",
    "do nothing",
    "relax",
    "stay at rest",
    "keep still",
    "hang loose",
)


@dataclass(frozen=True)
class GestureShares:
    """Probabilities of what bodies do."""

    together: float = 0.35  # both hands in one gesture
    mirrored: float = 0.07  # both hands in the same gesture of one hand
    both: float = 0.25  # of the other clips that are not idle: each hand makes its own gesture
    idle: float = 0.04  # of the clips that are neither together nor mirrored: both hands rest
    walking: float = 0.15  # of the people who do not sit
    seated: float = 0.25  # of the people who make no `PairGesture`, which has a share of its own
