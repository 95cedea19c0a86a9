"""Objects that people hold, as random `Solids`: families from coins to boxes, and scanned objects.

Families draw their sizes in metres with `u(low, high)`; their order is part of all synthetic data.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from geneoh.config import closest_name
from geneoh.errors import ConfigError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.synthesis.scans import Scans
from geneoh.synthesis.solids import BOX, CYLINDER, ELLIPSOID, FAR, SCAN, SOLIDS, TORUS, Solids

SCALES = (0.9, 1.1)  # range of the sizes in which a scanned object is drawn, relative to its own

Draw = Callable[[float, float], float]
Vector = tuple[float, float, float]

ORIGIN = (0.0, 0.0, 0.0)
LYING, STANDING = (0.0, math.pi / 2, 0.0), (math.pi / 2, 0.0, 0.0)
"""Axis-angles that bring z to x, for a lying handle, and z to -y, for a standing ring."""


@dataclass(frozen=True)
class _Solid:
    """One solid of an object; `Solids` says what its numbers mean."""

    kind: int
    size: Vector
    center: Vector = ORIGIN
    turn: Vector = ORIGIN  # axis-angle, radians
    rounding: float = 0.002
    part: int = 0

    @property
    def bevel(self) -> float:
        """The rounding that fits its size."""
        return min(self.rounding, 0.95 * min(self.size))


_UNUSED = _Solid(BOX, (0.01, 0.01, 0.01), (FAR, FAR, FAR), rounding=0.0)


def _rod(radius: float, half: float, center: Vector = ORIGIN, **rest: Any) -> _Solid:
    """A cylinder along z."""
    return _Solid(CYLINDER, (radius, radius, half), center, **rest)


def _round_rod(radius: float, half: float, center: Vector = ORIGIN, **rest: Any) -> _Solid:
    """A cylinder along z with round ends."""
    return _rod(radius, half, center, rounding=0.9 * radius, **rest)


def _torus(ring: float, tube: float, center: Vector = ORIGIN, **rest: Any) -> _Solid:
    """A ring about z."""
    return _Solid(TORUS, (ring, tube, 1.0), center, **rest)


@dataclass(frozen=True)
class _Joint:
    """What the second part of an object turns about or slides along, and how far either way."""

    axis: Vector
    travel: tuple[float, float]
    pivot: Vector = ORIGIN
    slides: bool = False


_RIGID = _Joint((0.0, 0.0, 1.0), (0.0, 0.0))
Drawn = list[_Solid] | tuple[list[_Solid], _Joint]
"""A rigid object, or one with a second part on a joint."""


def _mug(u: Draw) -> Drawn:
    r, h = u(0.03, 0.045), u(0.035, 0.06)
    handle = _torus(u(0.018, 0.03), u(0.004, 0.007), (r, 0.0, 0.0), turn=STANDING)
    return [_rod(r, h, rounding=0.003), handle]


def _hammer(u: Draw) -> Drawn:
    r, h = u(0.009, 0.017), u(0.08, 0.14)
    head = _Solid(BOX, (u(0.035, 0.06), u(0.012, 0.02), u(0.012, 0.02)), (0.0, 0.0, h))
    return [_rod(r, h, rounding=0.004), head]


def _bottle(u: Draw) -> Drawn:
    r, h = u(0.025, 0.04), u(0.05, 0.09)
    neck, cap = u(0.4, 0.5) * r, u(0.012, 0.02)
    top = _rod(neck, cap, (0.0, 0.0, h + cap), part=1)
    pulled = _Joint((0.0, 0.0, 1.0), (0.0, 0.06), slides=True)
    return [_rod(r, h, rounding=0.3 * r), top], pulled


def _pan(u: Draw) -> Drawn:
    r, h, length = u(0.06, 0.11), u(0.012, 0.025), u(0.06, 0.1)
    handle = _round_rod(u(0.007, 0.013), length, (r + length, 0.0, h / 2), turn=LYING)
    return [_rod(r, h, rounding=0.004), handle]


def _knife(u: Draw) -> Drawn:
    grip, blade = u(0.045, 0.07), u(0.05, 0.1)
    handle = _Solid(BOX, (grip, u(0.009, 0.014), u(0.007, 0.011)), rounding=0.005)
    return [handle, _Solid(BOX, (blade, 0.012, 0.0015), (grip + blade, 0.0, 0.0), rounding=0.001)]


def _loop_tool(u: Draw) -> Drawn:
    r, tube, length = u(0.018, 0.03), u(0.004, 0.007), u(0.04, 0.07)
    loops = [_torus(r, tube, (-length - r, side * r, 0.0)) for side in (-1.0, 1.0)]
    return [_Solid(BOX, (length, u(0.006, 0.012), 0.003), rounding=0.001), *loops]


def _cluster(u: Draw) -> Drawn:
    return [
        _Solid(
            (BOX, CYLINDER, ELLIPSOID)[int(u(0.0, 2.999))],
            ((r := u(0.012, 0.04)), r, u(0.012, 0.05)),
            (u(-0.03, 0.03), u(-0.03, 0.03), u(-0.03, 0.03)),
            (u(-3.0, 3.0), u(-3.0, 3.0), u(-3.0, 3.0)),
        )
        for _ in range(3)
    ]


def _bowl(u: Draw) -> Drawn:
    r, tube, h = u(0.045, 0.085), u(0.004, 0.007), u(0.02, 0.045)
    rims = [_torus((0.7 + 0.3 * k) * r, tube, (0.0, 0.0, k * h)) for k in (0.0, 0.5)]
    return [_rod(0.7 * r, tube), *rims, _torus(r, tube, (0.0, 0.0, h))]


def _plate(u: Draw) -> Drawn:
    r, tube = u(0.06, 0.12), u(0.004, 0.007)
    return [_rod(r, tube), _torus(r, tube, (0.0, 0.0, 2 * tube))]


def _spoon(u: Draw) -> Drawn:
    length, bowl = u(0.05, 0.09), u(0.015, 0.03)
    handle = _Solid(BOX, (length, u(0.004, 0.008), u(0.002, 0.004)), rounding=0.0015)
    return [handle, _Solid(ELLIPSOID, (bowl, 0.7 * bowl, 0.006), (length + 0.8 * bowl, 0.0, 0.0))]


def _brush(u: Draw) -> Drawn:
    length, r = u(0.05, 0.08), u(0.006, 0.012)
    head = _Solid(BOX, (u(0.02, 0.04), u(0.01, 0.025), u(0.008, 0.02)), (length + 0.02, 0.0, 0.0))
    return [_round_rod(r, length, turn=LYING), head]


def _screwdriver(u: Draw) -> Drawn:
    grip, shaft, r = u(0.035, 0.06), u(0.04, 0.08), u(0.009, 0.016)
    return [_rod(r, grip, rounding=0.5 * r), _rod(0.003, shaft, (0.0, 0.0, grip + shaft))]


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
        solids.append(_Solid(BOX, bar, middle, (0.0, 0.0, side * opening / 2), 0.001, part))
        solids.append(_torus(radius, tube, loop, part=part))
    return solids, _Joint((0.0, 0.0, 1.0), (-opening, 0.9 - opening))


def _pliers(u: Draw) -> Drawn:
    opening, grip, r = u(0.15, 0.6), u(0.05, 0.08), u(0.005, 0.009)
    jaw, wide = u(0.015, 0.03), u(0.004, 0.008)
    solids = []
    for part, turn in enumerate((-opening / 2, opening / 2)):
        c, s = math.cos(turn), math.sin(turn)
        handle = (-grip * c, -grip * s, 0.0)
        tip = (jaw * c, jaw * s + (2 * part - 1) * wide, 0.0)
        solids.append(_Solid(BOX, (grip, r, r), handle, (0.0, 0.0, turn), 0.8 * r, part))
        solids.append(_Solid(BOX, (jaw, wide, r), tip, (0.0, 0.0, turn), 0.001, part))
    return solids, _Joint((0.0, 0.0, 1.0), (-0.8 * opening, 0.7 - opening))


def _laptop(u: Draw) -> Drawn:
    width, depth, opening = u(0.08, 0.14), u(0.06, 0.1), u(0.3, 2.0)
    size = (depth, width, u(0.003, 0.006))
    open_lid = (-depth + depth * math.cos(opening), 0.0, depth * math.sin(opening))
    solids = [_Solid(BOX, size), _Solid(BOX, size, open_lid, (0.0, -opening, 0.0), part=1)]
    hinge = (-depth, 0.0, 0.0)
    return solids, _Joint((0.0, -1.0, 0.0), (0.1 - opening, 2.2 - opening), hinge)


def _chest(u: Draw) -> Drawn:
    depth, width, height = u(0.04, 0.09), u(0.05, 0.11), u(0.02, 0.05)
    opening, thick = u(0.0, 1.5), u(0.003, 0.006)
    hinge = (-depth, 0.0, height + thick)
    lid = (depth * math.cos(opening) - depth, 0.0, height + thick + depth * math.sin(opening))
    solids = [
        _Solid(BOX, (depth, width, height)),
        _Solid(BOX, (depth, width, thick), lid, (0.0, -opening, 0.0), part=1),
    ]
    return solids, _Joint((0.0, -1.0, 0.0), (-opening, 1.8 - opening), hinge)


def _drawer(u: Draw) -> Drawn:
    wide, high, deep = u(0.06, 0.12), u(0.03, 0.06), u(0.06, 0.1)
    opened, knob, t = u(0.0, 0.06), u(0.025, 0.05), u(0.004, 0.007)
    front = opened + deep + 0.004
    solids = [
        _Solid(BOX, (deep, wide + 0.01, high + 0.01)),
        _Solid(BOX, (deep, wide, high), (opened + 0.004, 0.0, 0.0), part=1),
        _Solid(BOX, (0.016, t, t), (front + 0.014, 0.0, 0.0), part=1),
        _round_rod(t, knob, (front + 0.03, 0.0, 0.0), turn=STANDING, part=1),
    ]
    return solids, _Joint((1.0, 0.0, 0.0), (-opened, 0.09 - opened), slides=True)


def _matchbox(u: Draw) -> Drawn:
    deep, wide, high = u(0.03, 0.06), u(0.025, 0.045), u(0.01, 0.025)
    opened, out = u(0.0, 0.05), u(0.012, 0.03)
    tray = _Solid(BOX, (deep, wide - 0.003, high - 0.003), (opened + out, 0.0, 0.0), part=1)
    pulled = _Joint((1.0, 0.0, 0.0), (-opened, 0.07 - opened), slides=True)
    return [_Solid(BOX, (deep, wide, high), rounding=0.001), tray], pulled


def _plunger(u: Draw) -> Drawn:
    r, h, knob = u(0.03, 0.05), u(0.05, 0.08), u(0.012, 0.025)
    opened, size = u(0.0, 0.06), u(0.014, 0.03)
    top = h + opened + knob
    solids = [
        _rod(r, h, rounding=0.003),
        _rod(0.004, 0.04, (0.0, 0.0, top - knob - 0.04), part=1),
        _rod(size, knob, (0.0, 0.0, top), rounding=0.5 * min(size, knob), part=1),
    ]
    return solids, _Joint((0.0, 0.0, 1.0), (-opened, 0.08 - opened), slides=True)


def _kettle(u: Draw) -> Drawn:
    r, h, ring = u(0.045, 0.07), u(0.04, 0.06), u(0.03, 0.045)
    handle = _torus(ring, u(0.006, 0.01), (0.0, 0.0, h + 0.5 * ring), turn=STANDING)
    return [_rod(r, h, rounding=0.01), handle]


def _wine_glass(u: Draw) -> Drawn:
    r, stem = u(0.025, 0.042), u(0.03, 0.05)
    bowl = _Solid(ELLIPSOID, (r, r, 1.3 * r), (0.0, 0.0, stem + 1.1 * r))
    return [bowl, _rod(0.004, stem), _rod(0.8 * r, 0.003, (0.0, 0.0, -stem), rounding=0.001)]


def _spray(u: Draw) -> Drawn:
    r, h, reach = u(0.022, 0.036), u(0.05, 0.08), u(0.015, 0.03)
    top = h + 0.02
    return [
        _rod(r, h, rounding=0.4 * r),
        _Solid(BOX, (reach, 0.011, 0.01), (0.4 * reach, 0.0, top), rounding=0.003),
        _Solid(BOX, (0.004, 0.006, 0.016), (reach, 0.0, top - 0.02), (0.0, 0.3, 0.0)),
        _rod(0.4 * r, 0.015, (0.0, 0.0, h)),
    ]


def _named(*families: Callable[[Draw], Drawn]) -> dict[str, Callable[[Draw], Drawn]]:
    """Families by the names of their functions."""
    return {family.__name__.removeprefix("_"): family for family in families}


FAMILIES: dict[str, Callable[[Draw], Drawn]] = {
    "box": lambda u: [
        _Solid(BOX, (u(0.01, 0.08), u(0.01, 0.06), u(0.01, 0.05)), rounding=u(0.001, 0.005))
    ],
    "board": lambda u: [_Solid(BOX, (u(0.05, 0.11), u(0.03, 0.08), u(0.003, 0.008)))],
    "cylinder": lambda u: [_rod(u(0.01, 0.045), u(0.02, 0.10), rounding=u(0.001, 0.005))],
    "capsule": lambda u: [_rod(r := u(0.006, 0.025), u(0.04, 0.12), rounding=0.98 * r)],
    "ellipsoid": lambda u: [_Solid(ELLIPSOID, (u(0.02, 0.05), u(0.02, 0.05), u(0.02, 0.06)))],
    "ring": lambda u: [_torus(u(0.02, 0.06), u(0.004, 0.014))],
    **_named(_mug, _hammer, _bottle, _pan, _knife, _loop_tool, _cluster),
    "ball": lambda u: [_Solid(ELLIPSOID, (r := u(0.015, 0.06), r, r))],
    "coin": lambda u: [_rod(u(0.012, 0.045), u(0.0015, 0.006), rounding=0.001)],
    "phone": lambda u: [
        _Solid(BOX, (u(0.06, 0.085), u(0.03, 0.042), u(0.0035, 0.006)), rounding=0.0033)
    ],
    "pen": lambda u: [_round_rod(u(0.0035, 0.007), u(0.05, 0.09))],
    "carton": lambda u: [_Solid(BOX, (u(0.05, 0.15), u(0.04, 0.12), u(0.03, 0.1)))],
    **_named(_bowl, _plate, _spoon, _brush, _screwdriver, _scissors, _pliers),
    **_named(_laptop, _chest, _drawer, _kettle, _wine_glass),
    "mouse": lambda u: [_Solid(ELLIPSOID, (u(0.045, 0.06), u(0.025, 0.036), u(0.014, 0.024)))],
    **_named(_spray, _matchbox, _plunger),
}


def family_named(name: str) -> Callable[[Draw], Drawn]:
    """The function that draws an object of a family; `ConfigError` if there is none."""
    if name not in FAMILIES:
        raise ConfigError(f"'{name}' is no object family; {closest_name(name, FAMILIES)}")
    return FAMILIES[name]


def draw_objects(
    families: list[str], *, generator: torch.Generator, scans: Scans | None = None
) -> Solids:
    """One random object per name of a family or a scan, centred near the origin of its own frame.

    A scanned object is drawn a little larger or smaller than it is.
    """
    numbers = {} if scans is None else {name: SCAN + n for n, name in enumerate(scans.names)}

    def uniform(low: float, high: float) -> float:
        return low + (high - low) * float(torch.rand((), generator=generator))

    drawn = [
        [_Solid(numbers[name], (size := uniform(*SCALES), size, size), rounding=0.0)]
        if name in numbers
        else family_named(name)(uniform)
        for name in families
    ]
    return _solids_of(drawn, scans)


def scanned_object(scans: Scans) -> Solids:
    """The first scanned object as it is, in the frame at the middle of its bounding box."""
    return _solids_of([[_Solid(SCAN, (1.0, 1.0, 1.0), rounding=0.0)]], scans)


def _solids_of(drawn: list[Drawn], scans: Scans | None) -> Solids:
    """Objects of solids, and of a joint where they have one."""
    pairs = [each if isinstance(each, tuple) else (each, _RIGID) for each in drawn]
    solids = [[*each, *[_UNUSED] * (SOLIDS - len(each))] for each, _ in pairs]

    def of_solids(name: str) -> Tensor:
        return torch.tensor([[getattr(solid, name) for solid in each] for each in solids])

    def of_joints(name: str) -> Tensor:
        return torch.tensor([getattr(joint, name) for _, joint in pairs])

    return Solids(
        **{name: of_solids(name) for name in ("kind", "size", "center", "part")},
        rounding=of_solids("bevel"),
        rotation=axis_angle_to_matrix(of_solids("turn")),
        **{name: of_joints(name) for name in ("axis", "pivot", "slides", "travel")},
        scans=scans,
    )
