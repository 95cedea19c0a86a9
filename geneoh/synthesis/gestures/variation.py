"""Variation of gestures: settings, variants and timing."""

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
from geneoh.synthesis.motions.object_motion import minimum_jerk

VARIANTS = 10
"""Number of variants of each gesture; they differ in place, direction, size, tempo and shape."""


@dataclass(frozen=True)
class HandSettings:
    """How much hands vary. `place` to `curl` are standard deviations between variants; a single
    clip varies by half of them around its variant."""

    place: float = 0.03  # of the wrist's place on each axis, metres
    turn: float = 0.12  # of the hand's rotation on each axis, radians
    tempo: float = 0.15  # of the logarithm of the period
    size: float = 0.18  # of the logarithm of a stroke's length
    curl: float = 0.1  # of the logarithm of each finger's curl
    early: float = 0.35  # share of the gestures that have begun before the clip
    late: float = 0.45  # share of those that continue beyond its end
    begin: tuple[float, float] = (0.1, 1.1)  # range of the time at which a hand sets out, seconds
    end: tuple[float, float] = (3.7, 4.7)  # range of the time at which it returns, seconds
    way: tuple[float, float] = (0.5, 0.95)  # range of the duration of either way, seconds
    bulge: float = 0.07  # how far hands deviate forward from a straight way, metres
    unsteady: float = 0.08  # standard deviation of the tempo and the size between strokes
    sway: float = 0.006  # standard deviation of the slow drift of the place, metres
    tremble: float = 0.035  # standard deviation of the fingers' tremor, radians
    together: float = 0.6
    """Correlation of the tremor between the four fingers; recorded free motion has 0.56 to 0.8."""
    tap: float = 0.45  # bend of the knuckle of a tapping finger, radians


@dataclass(frozen=True)
class GestureTiming(Bundle):
    """When a gesture happens; shared by hands that make it together."""

    phase: Float[Tensor, " T"]  # number of strokes since it began; at most zero before
    active: Float[Tensor, " T"]  # from 0, at rest, to 1, in the gesture


@dataclass(frozen=True)
class Variation(Bundle):
    """Offsets and factors by which a variant, or a single clip, of a gesture differs."""

    place: Float[Tensor, " 3"]
    turn: Float[Tensor, " 3"]
    tempo: float  # factor of the period
    size: float  # factor of the stroke
    curl: Float[Tensor, " 5"]  # factor of each finger's curl

    @staticmethod
    def drawn(draws: Draws, settings: HandSettings, share: float = 1.0) -> "Variation":
        """A random variation with the standard deviations of `settings`, scaled by `share`."""
        tempo, size = (share * draws.normal()[0]).item(), (share * draws.normal()[0]).item()
        return Variation(
            share * settings.place * draws.normal(3)[0],
            share * settings.turn * draws.normal(3)[0],
            math.exp(settings.tempo * tempo),
            math.exp(settings.size * size),
            torch.exp(share * settings.curl * draws.normal(5)[0]),
        )

    def with_palms_together(self) -> "Variation":
        """The same without components that push the palms through each other or apart."""
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
    """The variation of one variant of a gesture, the same in every clip."""
    generator = seeded_generator("variant", name, variant)
    return Variation.drawn(Draws(1, generator), settings)


def draw_timing(
    gesture: Gesture, tempo: float, frames: int, settings: HandSettings, draws: Draws
) -> GestureTiming:
    """When the gesture begins, how fast its strokes are, and when it ends."""
    time, strokes = torch.arange(frames) / FPS, gesture.strokes
    early, late = bool(draws.chance(settings.early)), bool(draws.chance(settings.late))
    begin, end, go, back = (
        draws.uniform(limits).item()
        for limits in (settings.begin, settings.end, settings.way, settings.way)
    )
    period = tempo * draws.log_uniform((strokes.shortest, strokes.longest)).item()
    if strokes.course == "once":
        end = max(end, begin + go + period)
    begin = -go - 2.0 * draws.share().item() if early and strokes.course != "once" else begin
    active = minimum_jerk((time - begin) / go)
    if not late:
        active = active - minimum_jerk((time - end) / back)
    speed = 1 + settings.unsteady * draws.smooth(frames, 1, 20.0)[0, :, 0]
    # strokes begin while the hand arrives
    since = (time - begin - 0.7 * go) * speed.cumsum(0) / torch.arange(1, frames + 1)
    return GestureTiming(since / period, active)
