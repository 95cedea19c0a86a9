"""What the gestures of synthetic bodies are made of: where a hand goes, how it turns, its shape.

Places and directions are of the right hand and seen from its own shoulder: outward from the middle
of the body, upward, forward; those of left hands are mirrored. Lengths are of an adult's arm of
0.545 m from shoulder to wrist, and follow other arms.
"""

from dataclasses import dataclass
from typing import Literal

from geneoh.synthesis.gestures.shapes import SHAPES

Vector = tuple[float, float, float]
Course = Literal["still", "swing", "strike", "once"]
Fingering = Literal["along", "grasp", "throw", "taps", "ripple", "steps"]


@dataclass(frozen=True)
class HandPose:
    """Where a hand is, where it points and what it looks like."""

    place: Vector  # of the wrist, metres
    along: Vector  # where the fingers of a flat hand point
    palm: Vector  # where the palm looks
    shape: str = "relaxed"

    def __post_init__(self) -> None:
        """Find names of unknown shapes at once."""
        assert self.shape in SHAPES, f"no shape {self.shape}"


@dataclass(frozen=True)
class Gesture:
    """What one hand does; `says` are English verbal phrases for it, the plainest first."""

    says: tuple[str, ...]
    start: HandPose
    end: HandPose | None = None  # the other end of the stroke; None for a hand that stays
    course: Course = "still"
    """Time of the stroke: to the end and back as a wave ("swing"), in short blows ("strike"), or
    once, with a stay at the end."""
    period: tuple[float, float] = (2.0, 3.5)  # seconds of a stroke there and back
    fingers: Fingering = "along"
    """Fingers go from the first shape to the second with the hand ("along"), close around what is
    not there at the end and open after it ("grasp"), or hold and let go ("throw"); or they tap each
    in its own time, ripple from the index to the pinky, or go through `steps`."""
    steps: tuple[str, ...] = ()  # shapes one after the other, a stroke each
    swivel: float = 0.0  # of the elbow outward from its relaxed place, radians


@dataclass(frozen=True)
class PairGesture(Gesture):
    """What both hands do together, told of the right one; `says` is of both."""

    left: Gesture | None = None  # None where the left hand mirrors the right one
    apart: float = 0.0  # of a stroke, by which the left hand is later
    seated: float = 0.3  # share of the people who sit
    cross: float = 0.0  # how far the left hand is lower, metres, where arms cross
    touches: bool = False  # whether the palms meet, as they do in no variant that has them apart


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
    """How often bodies do what, as shares of all clips or of those that are left."""

    together: float = 0.35  # both hands in one gesture
    mirrored: float = 0.07  # both hands in the same gesture of one hand
    both: float = 0.25  # of the clips of none of these three: each hand in a gesture of its own
    idle: float = 0.04  # of the clips that are not together or mirrored: both hands rest
    walking: float = 0.15  # of the people who do not sit
    seated: float = 0.25  # of the people whose gesture does not say
