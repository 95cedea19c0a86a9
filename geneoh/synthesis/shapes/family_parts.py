"""Building blocks of object families: solids, and the joint of a second part, as plain numbers."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from geneoh.synthesis.shapes.solids import BOX, CYLINDER, FAR_AWAY, TORUS

Draw = Callable[[float, float], float]
Vector = tuple[float, float, float]

ORIGIN = (0.0, 0.0, 0.0)
LYING, STANDING = (0.0, math.pi / 2, 0.0), (math.pi / 2, 0.0, 0.0)
"""Axis-angles that bring z to x, for a lying handle, and z to -y, for a standing ring."""


@dataclass(frozen=True)
class Shape:
    """One solid of an object; the fields are those of `Solids`."""

    kind: int
    size: Vector
    center: Vector = ORIGIN
    turn: Vector = ORIGIN  # axis-angle, radians
    rounding: float = 0.002
    part: int = 0

    @property
    def bevel(self) -> float:
        """Rounding radius, limited by the smallest size of the solid."""
        return min(self.rounding, 0.95 * min(self.size))


UNUSED = Shape(BOX, (0.01, 0.01, 0.01), (FAR_AWAY, FAR_AWAY, FAR_AWAY), rounding=0.0)


def rod(radius: float, half: float, center: Vector = ORIGIN, **rest: Any) -> Shape:
    """A cylinder along z."""
    return Shape(CYLINDER, (radius, radius, half), center, **rest)


def round_rod(radius: float, half: float, center: Vector = ORIGIN, **rest: Any) -> Shape:
    """A cylinder along z with round ends."""
    return rod(radius, half, center, rounding=0.9 * radius, **rest)


def torus(ring: float, tube: float, center: Vector = ORIGIN, **rest: Any) -> Shape:
    """A ring about z."""
    return Shape(TORUS, (ring, tube, 1.0), center, **rest)


@dataclass(frozen=True)
class PartJoint:
    """Joint of an object's second part: axis to turn about or slide along, and range of travel."""

    axis: Vector
    travel: tuple[float, float]
    pivot: Vector = ORIGIN
    slides: bool = False


RIGID = PartJoint((0.0, 0.0, 1.0), (0.0, 0.0))
Drawn = list[Shape] | tuple[list[Shape], PartJoint]
"""A rigid object, or one with a second part on a joint."""
Family = Callable[[Draw], Drawn]
"""Draws an object of a family; `u(low, high)` draws each size in metres."""


def named(*families: Family) -> dict[str, Family]:
    """Families by the names of their functions."""
    return {family.__name__.removeprefix("_"): family for family in families}
