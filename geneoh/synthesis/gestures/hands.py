"""What a hand does over time in a gesture: its place, its rotation and its fingers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.body.arms import forearm
from geneoh.body.skeleton import embedded_skeleton
from geneoh.bundle import Bundle
from geneoh.geometry.rotations import axis_angle_to_matrix, interpolate_rotations
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.gestures.repertoire import SHAPES, Gesture, HandPose
from geneoh.synthesis.gestures.variation import GestureTiming, HandSettings, Variation
from geneoh.synthesis.motions.object_motion import minimum_jerk

OUTWARD = (-1.0, 1.0, 1.0)
"""Signs from (outward, upward, forward) of the right hand to the body's x (to its left), y, z."""
FLEXED = (0, 3, 6, 9)  # knuckles of index, middle, pinky and ring


@dataclass(frozen=True)
class HandMotion(Bundle):
    """Hands relative to their shoulders, in the body's axes: x to the body's left, y up, z ahead.

    One right hand over T frames, or both hands of B clips (B, T, 2), the left one first.
    """

    place: Float[Tensor, "*T 3"]  # of the wrist, metres, for the arm of the embedded skeleton
    turn: Float[Tensor, "*T 3 3"]  # rotation of the wrist relative to the chest
    fingers: Float[Tensor, "*T 15 3"]
    active: Float[Tensor, "*T"]  # 0 at rest, 1 in the gesture
    stroke: Float[Tensor, "*T"]  # 0 at the start of a stroke, 1 at its other end
    swivel: Float[Tensor, "*T"]  # of the elbow, radians

    @staticmethod
    def stacked(parts: Sequence["HandMotion"], axis: int) -> "HandMotion":
        """Several of the same shape along a new axis."""
        names = vars(parts[0])
        return HandMotion(*(torch.stack([getattr(p, n) for p in parts], axis) for n in names))


def stroke(course: str, phase: Float[Tensor, " T"]) -> Float[Tensor, " T"]:
    """Position in a stroke, from 0 (start) to 1 (other end), by the number of strokes so far."""
    if course == "once":
        return minimum_jerk(phase / 0.35) - minimum_jerk((phase - 0.65) / 0.35)
    wave = 0.5 - 0.5 * torch.cos(2 * math.pi * phase.clamp(min=0))
    return {"still": torch.zeros_like(phase), "swing": wave, "strike": wave**2.2}[course]


def perform(
    gesture: Gesture,
    variation: Variation,
    timing: GestureTiming,
    rest: HandMotion,
    settings: HandSettings,
    draws: Draws,
) -> HandMotion:
    """A right hand that moves from rest to the gesture, makes its strokes and returns."""
    frames = len(timing.phase)
    strokes = stroke(gesture.strokes.course, timing.phase)
    course = strokes * (1 + settings.unsteady * draws.smooth(frames, 1, 15.0)[0, :, 0])
    if gesture.strokes.course == "strike":
        course = course.clamp(max=1.0)  # a blow ends at the surface that it hits
    first, last = (_place_of(each) for each in (gesture.start, gesture.end or gesture.start))
    place = first + variation.size * course[:, None] * (last - first) + variation.place
    place = place + settings.sway * draws.smooth(frames, 3, 14.0)[0]
    fingers = finger_course(gesture, variation, timing, course, settings, draws)
    active = timing.active[:, None]
    bulge = settings.bulge * torch.sin(math.pi * active) * torch.tensor([0.0, 0.0, 1.0])
    place = rest.place + active * (place - rest.place) + bulge
    turn = _turn_against_forearm(gesture, variation, timing.active, course, rest)
    fingers_active = _later(timing.active, -3)[:, None, None]  # fingers lead by three frames
    swivel = gesture.swivel * timing.active
    return HandMotion(
        place,
        _forearm(place, swivel) @ turn,
        rest.fingers + fingers_active * (fingers - rest.fingers),
        timing.active,
        strokes * timing.active,
        swivel,
    )


def _turn_against_forearm(
    gesture: Gesture,
    variation: Variation,
    active: Float[Tensor, " T"],
    course: Float[Tensor, " T"],
    rest: HandMotion,
) -> Float[Tensor, "T 3 3"]:
    """Rotation of a right hand relative to its forearm, from rest through a gesture's strokes.

    Rotations are interpolated relative to the forearm, because interpolation relative to the chest
    can pass through a twist that no wrist can make.
    """
    one, other = (
        against_forearm(turn_of(each), _place_of(each), gesture.swivel)
        for each in (gesture.start, gesture.end or gesture.start)
    )
    turn = interpolate_rotations(one, other, course.clamp(0, 1.2))
    turn = turn @ axis_angle_to_matrix(variation.turn)
    at_rest = against_forearm(rest.turn, rest.place, 0.0)
    return interpolate_rotations(at_rest, turn, active)


def against_forearm(
    turn: Float[Tensor, "*B 3 3"], place: Float[Tensor, "*B 3"], swivel: float
) -> Float[Tensor, "*B 3 3"]:
    """Rotation of a right hand relative to its forearm, from that relative to the chest."""
    return _forearm(place, swivel).mT @ turn


def _forearm(
    place: Float[Tensor, "*B 3"], swivel: Float[Tensor, "*B"] | float
) -> Float[Tensor, "*B 3 3"]:
    return forearm(embedded_skeleton(), "right", place, swivel)


def finger_course(
    gesture: Gesture,
    variation: Variation,
    timing: GestureTiming,
    course: Float[Tensor, " T"],
    settings: HandSettings,
    draws: Draws,
) -> Float[Tensor, "T 15 3"]:
    """Axis-angle of a right hand's fingers during the gesture."""
    frames, phase = len(course), timing.phase
    start = shaped(gesture.start, variation)
    end = shaped(gesture.end or gesture.start, variation)
    lag = int(draws.integers(0, 4))
    moved = _later(course, lag).clamp(0, 1.2)
    if gesture.fingers == "grasp":
        moved = minimum_jerk((phase - 0.25) / 0.15) - minimum_jerk((phase - 0.85) / 0.12)
    elif gesture.fingers == "throw":
        moved = minimum_jerk((phase - 0.2) / 0.12)
    fingers = start + moved[:, None, None] * (end - start)
    if gesture.steps:
        shapes = [shaped(replace(gesture.start, shape=name), variation) for name in gesture.steps]
        fingers = shapes[0].expand(frames, -1, -1)
        for number, (one, other) in enumerate(pairwise(shapes)):
            fingers = fingers + minimum_jerk((phase - number) / 0.3)[:, None, None] * (other - one)
    bent = torch.zeros(frames, 15)
    if gesture.fingers in ("taps", "ripple"):
        bent[:, FLEXED] = settings.tap * taps(gesture.fingers, phase, draws)
    noise = draws.smooth(frames, 46, 9.0)[0]
    own, common = noise[:, :45].unflatten(-1, (15, 3)), noise[:, 45]
    tremble = settings.tremble * (1 - settings.together) ** 0.5 * own
    bent = bent + settings.tremble * settings.together**0.5 * common[:, None]
    bent[:, 12:] = 0
    return fingers + tremble + bent[..., None] * torch.tensor([0.0, 0.0, 1.0])


def taps(kind: str, phase: Float[Tensor, " T"], draws: Draws) -> Float[Tensor, "T 4"]:
    """Bend of the knuckles of index, middle, pinky and ring by taps, from 0 to 1.

    With "ripple" each finger taps once per stroke, the pinky first; otherwise one or two random
    fingers tap in the middle of each stroke.
    """
    order = torch.tensor([0.6, 0.4, 0.0, 0.2])
    if kind == "ripple":
        at = phase[:, None] - order
        return (0.5 + 0.5 * torch.cos(2 * math.pi * at)) ** 4
    at = phase[:, None] - 0.5
    number = at.round()
    which = draws.share(64, 4)[0].argsort(1) < 1 + draws.integers(0, 2, 64, 1)[0]
    chosen = which[number[:, 0].long() % 64].float()
    return chosen * torch.exp(-0.5 * ((at - number) / 0.16) ** 2)


def resting_hand(
    pose: HandPose, frames: int, swing: Float[Tensor, " T"], settings: HandSettings, draws: Draws
) -> HandMotion:
    """A right hand at rest, which swings forward by `swing` (metres) while the person walks."""
    variation = Variation.drawn(draws, settings, 0.7)
    place = _place_of(pose) + variation.place + swing[:, None] * torch.tensor([0.0, 0.0, 1.0])
    turn = turn_of(pose) @ axis_angle_to_matrix(variation.turn)
    still = replace(_STILL, start=pose)
    timing = GestureTiming(torch.zeros(frames), torch.ones(frames))
    fingers = finger_course(still, variation, timing, timing.phase, settings, draws)
    place = place + settings.sway * draws.smooth(frames, 3, 25.0)[0]
    return HandMotion(place, turn.expand(frames, 3, 3), fingers, *torch.zeros(3, frames))


def _place_of(pose: HandPose) -> Float[Tensor, " 3"]:
    """The place of a right wrist from its shoulder, in the body's axes."""
    return torch.tensor(pose.place) * torch.tensor(OUTWARD)


def turn_of(pose: HandPose) -> Float[Tensor, "3 3"]:
    """Rotation of a right wrist, in whose frame flat fingers are along -x and the palm faces -y."""
    along, palm = (torch.tensor(v) * torch.tensor(OUTWARD) for v in (pose.along, pose.palm))
    along = normalize(along, dim=0)
    palm = normalize(palm - (palm @ along) * along, dim=0)
    return torch.stack([-along, -palm, torch.linalg.cross(along, palm)], dim=1)


def shaped(pose: HandPose, variation: Variation) -> Float[Tensor, "15 3"]:
    """The fingers of a pose, with the curls of a variation."""
    shape = SHAPES[pose.shape]
    curl = tuple((torch.tensor(shape.curl) * variation.curl).clamp(max=2.25).tolist())
    return replace(shape, curl=curl).fingers()


def _later(values: Float[Tensor, " T"], frames: int) -> Float[Tensor, " T"]:
    """The values delayed by `frames` (advanced if negative), replicated at the ends."""
    at = (torch.arange(len(values)) - frames).clamp(0, len(values) - 1)
    return values[at]


_STILL = Gesture(("rest",), HandPose((0.0, -0.5, 0.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0)))
