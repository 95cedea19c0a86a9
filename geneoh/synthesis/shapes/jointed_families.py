"""Families of objects with a second part on a joint, such as lids, drawers and scissors."""

import math

from geneoh.synthesis.shapes.family_parts import (
    STANDING,
    Draw,
    Drawn,
    PartJoint,
    Shape,
    named,
    rod,
    round_rod,
    torus,
)
from geneoh.synthesis.shapes.solids import BOX


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


JOINTED_FAMILIES = named(_bottle, _scissors, _pliers, _laptop, _chest, _drawer, _matchbox, _plunger)
