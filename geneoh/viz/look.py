"""How a scene is shown: what the hands' colours mean, what is up, which frames."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from torch import Tensor, zeros_like

from geneoh.choices import CELL_LIMITS, STRIP_CELL, Axis, Colouring
from geneoh.config import check_fields
from geneoh.metrics.contact import TOUCH

Colour = tuple[float, float, float]  # red, green and blue in sRGB, 0 to 1

BACKGROUND: Colour = (0.985, 0.985, 0.98)
SKIN_COLOUR: Colour = (0.86, 0.69, 0.59)
BODY_COLOUR: Colour = (0.78, 0.8, 0.83)
OBJECT_COLOUR: Colour = (0.55, 0.63, 0.73)
LARGEST_DEPTH = 0.006  # penetration in metres at which its ramp ends
LARGEST_SPREAD = 0.02  # spread in metres at which its ramp ends


@dataclass(frozen=True)
class Look:
    """How a scene is shown; each format uses what applies to it."""

    colouring: Colouring = "penetration"
    """What the hands' colours show in pictures and films; a page can switch."""
    up: Axis = "z"
    """Axis of the world that points up."""
    frames: tuple[int, ...] = ()
    """Frames of a filmstrip; evenly spread ones when empty."""
    cell: int = STRIP_CELL
    """Side of one picture in a filmstrip, pixels."""

    def __post_init__(self) -> None:
        """Refuse choices that do not exist, and pictures that are too small or large."""
        check_fields(self, {"cell": CELL_LIMITS})

    @property
    def upward(self) -> Float[np.ndarray, " 3"]:
        """The unit vector in the world that points up."""
        return np.eye(3)["xyz".index(self.up[-1])] * (-1.0 if self.up.startswith("-") else 1.0)


DEFAULT_LOOK = Look()


@dataclass(frozen=True)
class ColourScale:
    """How one quantity becomes a colour; position 0 on the ramp keeps the colour of the skin."""

    title: str
    ramp: tuple[Colour, ...]  # colours at even steps of the position from 0 to 1
    limits: tuple[float, float]  # the values in metres at the positions 0 and 1
    labels: tuple[str, str]  # what the legend says at both ends, with the unit

    def position(self, value: Float[Tensor, "*B"]) -> Float[Tensor, "*B"]:
        """The position of each value in metres on the ramp, 0 to 1."""
        first, last = self.limits
        return ((value - first) / (last - first)).clamp(0, 1)

    def colours(self, position: Float[np.ndarray, "*B"]) -> Float[np.ndarray, "*B 3"]:
        """The colour at each position on the ramp, 0 to 1."""
        stops = np.array(self.ramp)
        at = np.linspace(0, 1, len(stops))
        channels = [np.interp(position, at, channel) for channel in stops.T]
        return np.stack(channels, -1).astype(np.float32)


SCALES: dict[Colouring, ColourScale] = {
    "penetration": ColourScale(
        "penetration depth",
        (SKIN_COLOUR, (0.98, 0.70, 0.16), (0.93, 0.32, 0.13), (0.78, 0.06, 0.22), (0.45, 0.0, 0.3)),
        (0.0, LARGEST_DEPTH),
        ("0", f"{1000 * LARGEST_DEPTH:.0f} mm"),
    ),
    "contact": ColourScale(
        "distance to the object",
        (SKIN_COLOUR, (0.62, 0.78, 0.52), (0.10, 0.62, 0.47), (0.0, 0.45, 0.55)),
        (TOUCH, 0.0),
        (f"{1000 * TOUCH:.0f} mm", "touches"),
    ),
    "spread": ColourScale(
        "expected error of the result (RMS)",
        (SKIN_COLOUR, (0.74, 0.55, 0.78), (0.48, 0.33, 0.78), (0.20, 0.12, 0.62)),
        (0.0, LARGEST_SPREAD),
        ("0", f"{1000 * LARGEST_SPREAD:.0f} mm"),
    ),
}
"""The scale of every colouring but "plain"."""


def ramp_position(
    colouring: Colouring, distance: Float[Tensor, "*B V"], spread: Float[Tensor, "*B V"] | None
) -> Float[Tensor, "*B V"]:
    """The position of each vertex on the ramp of a colouring, 0 to 1.

    From its signed distance to the object, negative inside, or its expected error, both in metres.
    """
    shown = {"penetration": -distance, "contact": distance, "spread": spread}.get(colouring)
    return zeros_like(distance) if shown is None else SCALES[colouring].position(shown)


def ramp_colours(
    colouring: Colouring, position: Float[np.ndarray, "*B"]
) -> Float[np.ndarray, "*B 3"]:
    """The colours at positions on the ramp of a colouring; "plain" skin is position 0 of any."""
    return SCALES.get(colouring, SCALES["penetration"]).colours(position)
