"""How a gesture is made unlike other ones: settings, variants of it, and its timing."""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.seeds import seeded_generator
from geneoh.synthesis.actions.action import FPS
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.gestures.repertoire import Gesture
from geneoh.synthesis.motions.schedule import minimum_jerk

VARIANTS = 10
"""Ways of making each gesture, which differ in place, direction, size, tempo and shape."""


@dataclass(frozen=True)
class HandSettings:
    """How much hands vary; deviations are those of variants, and half of it of single clips."""

    place: float = 0.03  # of a place on each axis, metres
    turn: float = 0.12  # of a hand's rotation on each axis, radians
    tempo: float = 0.15  # of the logarithm of the period
    size: float = 0.18  # of the logarithm of a stroke's length
    curl: float = 0.1  # of the logarithm of each finger's curl
    early: float = 0.35  # share of the gestures that are under way when the clip begins
    late: float = 0.45  # share of those that go on beyond its end
    begin: tuple[float, float] = (0.1, 1.1)  # range of the time at which a hand sets out, seconds
    end: tuple[float, float] = (3.7, 4.7)  # range of the time at which it goes back
    way: tuple[float, float] = (0.5, 0.95)  # range of the time of the way there, and back
    bulge: float = 0.07  # how far forward of a straight way hands go, metres
    unsteady: float = 0.08  # deviation of the tempo and the size from stroke to stroke
    sway: float = 0.006  # deviation of slow motion of the place, metres
    tremble: float = 0.035  # deviation of the fingers' own motion, radians
    together: float = 0.6
    """Correlation of that between the four fingers; recorded free motion has 0.56 to 0.8."""
    tap: float = 0.45  # how far a finger that taps bends at the knuckle, radians


@dataclass(frozen=True)
class GestureTiming(Bundle):
    """When a gesture happens, for the hands that make it together."""

    phase: Float[Tensor, " T"]  # strokes since it began; not above zero before
    active: Float[Tensor, " T"]  # from 0, at rest, to 1, in the gesture


@dataclass(frozen=True)
class Variation(Bundle):
    """How a variant, or a single clip, makes a gesture unlike the others."""

    place: Float[Tensor, " 3"]
    turn: Float[Tensor, " 3"]
    tempo: float  # factor of the period
    size: float  # factor of the stroke
    curl: Float[Tensor, " 5"]  # factor of each finger's curl

    @staticmethod
    def drawn(draws: Draws, settings: HandSettings, share: float = 1.0) -> "Variation":
        """Random, with a share of the deviations."""
        tempo, size = (share * draws.normal()[0]).item(), (share * draws.normal()[0]).item()
        return Variation(
            share * settings.place * draws.normal(3)[0],
            share * settings.turn * draws.normal(3)[0],
            math.exp(settings.tempo * tempo),
            math.exp(settings.size * size),
            torch.exp(share * settings.curl * draws.normal(5)[0]),
        )

    def with_palms_together(self) -> "Variation":
        """The same without what moves the palms of both hands through each other or apart."""
        sideways = torch.tensor([0.0, 1.0, 1.0])
        return replace(self, place=self.place * sideways, turn=0.2 * self.turn, size=1.0)

    def combined_with(self, other: "Variation") -> "Variation":
        """Both variations, one after the other."""
        return Variation(
            self.place + other.place,
            self.turn + other.turn,
            self.tempo * other.tempo,
            self.size * other.size,
            self.curl * other.curl,
        )


def variation_of(name: str, variant: int, settings: HandSettings) -> Variation:
    """How a variant of a gesture is made: the same for every clip of it."""
    generator = seeded_generator("variant", name, variant)
    return Variation.drawn(Draws(1, generator), settings)


def draw_timing(
    gesture: Gesture, tempo: float, frames: int, settings: HandSettings, draws: Draws
) -> GestureTiming:
    """When the gesture begins, how fast its strokes are, and when it ends."""
    time = torch.arange(frames) / FPS
    early, late = bool(draws.chance(settings.early)), bool(draws.chance(settings.late))
    begin, end, go, back = (
        draws.uniform(limits).item()
        for limits in (settings.begin, settings.end, settings.way, settings.way)
    )
    period = tempo * draws.log_uniform(gesture.period).item()
    if gesture.course == "once":
        end = max(end, begin + go + period)
    begin = -go - 2.0 * draws.share().item() if early and gesture.course != "once" else begin
    active = minimum_jerk((time - begin) / go)
    if not late:
        active = active - minimum_jerk((time - end) / back)
    speed = 1 + settings.unsteady * draws.smooth(frames, 1, 20.0)[0, :, 0]
    # strokes begin while the hand arrives
    since = (time - begin - 0.7 * go) * speed.cumsum(0) / torch.arange(1, frames + 1)
    return GestureTiming(since / period, active)
