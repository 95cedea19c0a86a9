"""Families of rigid objects, from boxes and coins to mugs, pans and brushes."""

from geneoh.synthesis.shapes.family_parts import (
    LYING,
    STANDING,
    Draw,
    Drawn,
    Family,
    Shape,
    named,
    rod,
    round_rod,
    torus,
)
from geneoh.synthesis.shapes.solids import BOX, CYLINDER, ELLIPSOID


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


RIGID_FAMILIES: dict[str, Family] = {
    "box": lambda u: [
        Shape(BOX, (u(0.01, 0.08), u(0.01, 0.06), u(0.01, 0.05)), rounding=u(0.001, 0.005))
    ],
    "board": lambda u: [Shape(BOX, (u(0.05, 0.11), u(0.03, 0.08), u(0.003, 0.008)))],
    "cylinder": lambda u: [rod(u(0.01, 0.045), u(0.02, 0.10), rounding=u(0.001, 0.005))],
    "capsule": lambda u: [rod(r := u(0.006, 0.025), u(0.04, 0.12), rounding=0.98 * r)],
    "ellipsoid": lambda u: [Shape(ELLIPSOID, (u(0.02, 0.05), u(0.02, 0.05), u(0.02, 0.06)))],
    "ring": lambda u: [torus(u(0.02, 0.06), u(0.004, 0.014))],
    "ball": lambda u: [Shape(ELLIPSOID, (r := u(0.015, 0.06), r, r))],
    "coin": lambda u: [rod(u(0.012, 0.045), u(0.0015, 0.006), rounding=0.001)],
    "phone": lambda u: [
        Shape(BOX, (u(0.06, 0.085), u(0.03, 0.042), u(0.0035, 0.006)), rounding=0.0033)
    ],
    "pen": lambda u: [round_rod(u(0.0035, 0.007), u(0.05, 0.09))],
    "carton": lambda u: [Shape(BOX, (u(0.05, 0.15), u(0.04, 0.12), u(0.03, 0.1)))],
    "mouse": lambda u: [Shape(ELLIPSOID, (u(0.045, 0.06), u(0.025, 0.036), u(0.014, 0.024)))],
    **named(_mug, _hammer, _pan, _knife, _loop_tool, _cluster, _bowl, _plate, _spoon, _brush),
    **named(_screwdriver, _kettle, _wine_glass, _spray),
}
