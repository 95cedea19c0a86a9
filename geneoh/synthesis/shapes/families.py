"""Families of objects, such as mugs, pans, lids and scissors: solids as plain numbers."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from geneoh.config import closest_name
from geneoh.errors import ConfigError
from geneoh.synthesis.shapes.solids import BOX, CYLINDER, ELLIPSOID, FAR_AWAY, TORUS

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


def _mug(u: Draw) -> Drawn:
    r, h = u(0.03, 0.045), u(0.035, 0.06)
    handle = torus(u(0.018, 0.03), u(0.004, 0.007), (r, 0.0, 0.0), turn=STANDING)
    return [rod(r, h, rounding=0.003), handle]


def _hammer(u: Draw) -> Drawn:
    r, h = u(0.009, 0.017), u(0.08, 0.14)
    head = Shape(BOX, (u(0.035, 0.06), u(0.012, 0.02), u(0.012, 0.02)), (0.0, 0.0, h))
    return [rod(r, h, rounding=0.004), head]


def _pan(u: Draw) -> Drawn:
    r, h, length = u(0.06, 0.11), u(0.012, 0.025), u(0.06, 0.1)
    handle = round_rod(u(0.007, 0.013), length, (r + length, 0.0, h / 2), turn=LYING)
    return [rod(r, h, rounding=0.004), handle]


def _knife(u: Draw) -> Drawn:
    grip, blade = u(0.045, 0.07), u(0.05, 0.1)
    handle = Shape(BOX, (grip, u(0.009, 0.014), u(0.007, 0.011)), rounding=0.005)
    return [handle, Shape(BOX, (blade, 0.012, 0.0015), (grip + blade, 0.0, 0.0), rounding=0.001)]


def _loop_tool(u: Draw) -> Drawn:
    r, tube, length = u(0.018, 0.03), u(0.004, 0.007), u(0.04, 0.07)
    loops = [torus(r, tube, (-length - r, side * r, 0.0)) for side in (-1.0, 1.0)]
    return [Shape(BOX, (length, u(0.006, 0.012), 0.003), rounding=0.001), *loops]


def _cluster(u: Draw) -> Drawn:
    return [
        Shape(
            (BOX, CYLINDER, ELLIPSOID)[int(u(0.0, 2.999))],
            ((r := u(0.012, 0.04)), r, u(0.012, 0.05)),
            (u(-0.03, 0.03), u(-0.03, 0.03), u(-0.03, 0.03)),
            (u(-3.0, 3.0), u(-3.0, 3.0), u(-3.0, 3.0)),
        )
        for _ in range(3)
    ]


def _bowl(u: Draw) -> Drawn:
    r, tube, h = u(0.045, 0.085), u(0.004, 0.007), u(0.02, 0.045)
    rims = [torus((0.7 + 0.3 * k) * r, tube, (0.0, 0.0, k * h)) for k in (0.0, 0.5)]
    return [rod(0.7 * r, tube), *rims, torus(r, tube, (0.0, 0.0, h))]


def _plate(u: Draw) -> Drawn:
    r, tube = u(0.06, 0.12), u(0.004, 0.007)
    return [rod(r, tube), torus(r, tube, (0.0, 0.0, 2 * tube))]


def _spoon(u: Draw) -> Drawn:
    length, bowl = u(0.05, 0.09), u(0.015, 0.03)
    handle = Shape(BOX, (length, u(0.004, 0.008), u(0.002, 0.004)), rounding=0.0015)
    return [handle, Shape(ELLIPSOID, (bowl, 0.7 * bowl, 0.006), (length + 0.8 * bowl, 0.0, 0.0))]


def _brush(u: Draw) -> Drawn:
    length, r = u(0.05, 0.08), u(0.006, 0.012)
    head = Shape(BOX, (u(0.02, 0.04), u(0.01, 0.025), u(0.008, 0.02)), (length + 0.02, 0.0, 0.0))
    return [round_rod(r, length, turn=LYING), head]


def _screwdriver(u: Draw) -> Drawn:
    grip, shaft, r = u(0.035, 0.06), u(0.04, 0.08), u(0.009, 0.016)
    return [rod(r, grip, rounding=0.5 * r), rod(0.003, shaft, (0.0, 0.0, grip + shaft))]


def _kettle(u: Draw) -> Drawn:
    r, h, ring = u(0.045, 0.07), u(0.04, 0.06), u(0.03, 0.045)
    handle = torus(ring, u(0.006, 0.01), (0.0, 0.0, h + 0.5 * ring), turn=STANDING)
    return [rod(r, h, rounding=0.01), handle]


def _wine_glass(u: Draw) -> Drawn:
    r, stem = u(0.025, 0.042), u(0.03, 0.05)
    bowl = Shape(ELLIPSOID, (r, r, 1.3 * r), (0.0, 0.0, stem + 1.1 * r))
    return [bowl, rod(0.004, stem), rod(0.8 * r, 0.003, (0.0, 0.0, -stem), rounding=0.001)]


def _spray(u: Draw) -> Drawn:
    r, h, reach = u(0.022, 0.036), u(0.05, 0.08), u(0.015, 0.03)
    top = h + 0.02
    return [
        rod(r, h, rounding=0.4 * r),
        Shape(BOX, (reach, 0.011, 0.01), (0.4 * reach, 0.0, top), rounding=0.003),
        Shape(BOX, (0.004, 0.006, 0.016), (reach, 0.0, top - 0.02), (0.0, 0.3, 0.0)),
        rod(0.4 * r, 0.015, (0.0, 0.0, h)),
    ]


def _bottle(u: Draw) -> Drawn:
    r, h = u(0.025, 0.04), u(0.05, 0.09)
    neck, cap = u(0.4, 0.5) * r, u(0.012, 0.02)
    top = rod(neck, cap, (0.0, 0.0, h + cap), part=1)
    pulled = PartJoint((0.0, 0.0, 1.0), (0.0, 0.06), slides=True)
    return [rod(r, h, rounding=0.3 * r), top], pulled


def _scissors(u: Draw) -> Drawn:
    opening, blade = u(0.05, 0.5), u(0.04, 0.07)
    radius, tube = u(0.013, 0.024), u(0.0035, 0.006)
    solids = []
    for part, side in enumerate((-1.0, 1.0)):
        c, s = math.cos(side * opening / 2), math.sin(side * opening / 2)
        reach = -0.75 * blade - radius
        loop = (reach * c - side * radius * s, reach * s + side * radius * c, 0.0)
        bar = (blade, u(0.004, 0.007), u(0.0015, 0.003))
        middle = (0.15 * blade * c, 0.15 * blade * s, 0.002 * side)
        solids.append(Shape(BOX, bar, middle, (0.0, 0.0, side * opening / 2), 0.001, part))
        solids.append(torus(radius, tube, loop, part=part))
    return solids, PartJoint((0.0, 0.0, 1.0), (-opening, 0.9 - opening))


def _pliers(u: Draw) -> Drawn:
    opening, grip, r = u(0.15, 0.6), u(0.05, 0.08), u(0.005, 0.009)
    jaw, wide = u(0.015, 0.03), u(0.004, 0.008)
    solids = []
    for part, turn in enumerate((-opening / 2, opening / 2)):
        c, s = math.cos(turn), math.sin(turn)
        handle = (-grip * c, -grip * s, 0.0)
        tip = (jaw * c, jaw * s + (2 * part - 1) * wide, 0.0)
        solids.append(Shape(BOX, (grip, r, r), handle, (0.0, 0.0, turn), 0.8 * r, part))
        solids.append(Shape(BOX, (jaw, wide, r), tip, (0.0, 0.0, turn), 0.001, part))
    return solids, PartJoint((0.0, 0.0, 1.0), (-0.8 * opening, 0.7 - opening))


def _laptop(u: Draw) -> Drawn:
    width, depth, opening = u(0.08, 0.14), u(0.06, 0.1), u(0.3, 2.0)
    size = (depth, width, u(0.003, 0.006))
    open_lid = (-depth + depth * math.cos(opening), 0.0, depth * math.sin(opening))
    solids = [Shape(BOX, size), Shape(BOX, size, open_lid, (0.0, -opening, 0.0), part=1)]
    hinge = (-depth, 0.0, 0.0)
    return solids, PartJoint((0.0, -1.0, 0.0), (0.1 - opening, 2.2 - opening), hinge)


def _chest(u: Draw) -> Drawn:
    depth, width, height = u(0.04, 0.09), u(0.05, 0.11), u(0.02, 0.05)
    opening, thick = u(0.0, 1.5), u(0.003, 0.006)
    hinge = (-depth, 0.0, height + thick)
    lid = (depth * math.cos(opening) - depth, 0.0, height + thick + depth * math.sin(opening))
    solids = [
        Shape(BOX, (depth, width, height)),
        Shape(BOX, (depth, width, thick), lid, (0.0, -opening, 0.0), part=1),
    ]
    return solids, PartJoint((0.0, -1.0, 0.0), (-opening, 1.8 - opening), hinge)


def _drawer(u: Draw) -> Drawn:
    wide, high, deep = u(0.06, 0.12), u(0.03, 0.06), u(0.06, 0.1)
    opened, knob, t = u(0.0, 0.06), u(0.025, 0.05), u(0.004, 0.007)
    front = opened + deep + 0.004
    solids = [
        Shape(BOX, (deep, wide + 0.01, high + 0.01)),
        Shape(BOX, (deep, wide, high), (opened + 0.004, 0.0, 0.0), part=1),
        Shape(BOX, (0.016, t, t), (front + 0.014, 0.0, 0.0), part=1),
        round_rod(t, knob, (front + 0.03, 0.0, 0.0), turn=STANDING, part=1),
    ]
    return solids, PartJoint((1.0, 0.0, 0.0), (-opened, 0.09 - opened), slides=True)


def _matchbox(u: Draw) -> Drawn:
    deep, wide, high = u(0.03, 0.06), u(0.025, 0.045), u(0.01, 0.025)
    opened, out = u(0.0, 0.05), u(0.012, 0.03)
    tray = Shape(BOX, (deep, wide - 0.003, high - 0.003), (opened + out, 0.0, 0.0), part=1)
    pulled = PartJoint((1.0, 0.0, 0.0), (-opened, 0.07 - opened), slides=True)
    return [Shape(BOX, (deep, wide, high), rounding=0.001), tray], pulled


def _plunger(u: Draw) -> Drawn:
    r, h, knob = u(0.03, 0.05), u(0.05, 0.08), u(0.012, 0.025)
    opened, size = u(0.0, 0.06), u(0.014, 0.03)
    top = h + opened + knob
    solids = [
        rod(r, h, rounding=0.003),
        rod(0.004, 0.04, (0.0, 0.0, top - knob - 0.04), part=1),
        rod(size, knob, (0.0, 0.0, top), rounding=0.5 * min(size, knob), part=1),
    ]
    return solids, PartJoint((0.0, 0.0, 1.0), (-opened, 0.08 - opened), slides=True)


FAMILIES: dict[str, Family] = {
    "box": lambda u: [
        Shape(BOX, (u(0.01, 0.08), u(0.01, 0.06), u(0.01, 0.05)), rounding=u(0.001, 0.005))
    ],
    "board": lambda u: [Shape(BOX, (u(0.05, 0.11), u(0.03, 0.08), u(0.003, 0.008)))],
    "cylinder": lambda u: [rod(u(0.01, 0.045), u(0.02, 0.10), rounding=u(0.001, 0.005))],
    "capsule": lambda u: [rod(r := u(0.006, 0.025), u(0.04, 0.12), rounding=0.98 * r)],
    "ellipsoid": lambda u: [Shape(ELLIPSOID, (u(0.02, 0.05), u(0.02, 0.05), u(0.02, 0.06)))],
    "ring": lambda u: [torus(u(0.02, 0.06), u(0.004, 0.014))],
    **named(_mug, _hammer, _bottle, _pan, _knife, _loop_tool, _cluster),
    "ball": lambda u: [Shape(ELLIPSOID, (r := u(0.015, 0.06), r, r))],
    "coin": lambda u: [rod(u(0.012, 0.045), u(0.0015, 0.006), rounding=0.001)],
    "phone": lambda u: [
        Shape(BOX, (u(0.06, 0.085), u(0.03, 0.042), u(0.0035, 0.006)), rounding=0.0033)
    ],
    "pen": lambda u: [round_rod(u(0.0035, 0.007), u(0.05, 0.09))],
    "carton": lambda u: [Shape(BOX, (u(0.05, 0.15), u(0.04, 0.12), u(0.03, 0.1)))],
    **named(_bowl, _plate, _spoon, _brush, _screwdriver),
    **named(_scissors, _pliers, _laptop, _chest, _drawer, _kettle, _wine_glass),
    "mouse": lambda u: [Shape(ELLIPSOID, (u(0.045, 0.06), u(0.025, 0.036), u(0.014, 0.024)))],
    **named(_spray, _matchbox, _plunger),
}
"""All families by name; another order would change all synthetic data."""
JOINTED_FAMILIES = named(_bottle, _scissors, _pliers, _laptop, _chest, _drawer, _matchbox, _plunger)


def family_named(name: str) -> Family:
    """The function that draws an object of a family; `ConfigError` if there is none."""
    if name not in FAMILIES:
        raise ConfigError(f"'{name}' is no object family; {closest_name(name, FAMILIES)}")
    return FAMILIES[name]
