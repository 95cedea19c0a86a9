"""Analytic objects: batched unions of simple solids, their distance, surface and families.

Every object is a union of at most `SOLIDS` solids (box, cylinder, ellipsoid, torus), each with a
pose and a rounding radius, so one tensor program evaluates any mixture of families at once. Sizes
are those of things people hold: coin-thin boards to two-hand boxes. Some have a second part that
turns about a hinge or slides.
"""

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.errors import ConfigError
from geneoh.geometry.rotations import axis_angle_to_matrix

SOLIDS = 4
PARTS = 2
"""Parts of an object that move by themselves: the first, and one on a joint."""
BOX, CYLINDER, ELLIPSOID, TORUS = range(4)
ASTRAY = 1e-5
"""Distance from the surface beyond which a point's slide down to it has not converged, metres."""
FAR = 10.0
"""Where unused solids are parked, metres: never the nearest part of anything."""


@dataclass(frozen=True)
class Solids:
    """A batch of objects, each a union of solids in the object's own frame, metres."""

    kind: Int[Tensor, "B S"]
    """BOX (half extents), CYLINDER (radius, radius, half height along z), ELLIPSOID (semi-axes)
    or TORUS (ring radius, tube radius, unused; axis z)."""
    size: Float[Tensor, "B S 3"]
    rounding: Float[Tensor, "B S"]
    center: Float[Tensor, "B S 3"]
    rotation: Float[Tensor, "B S 3 3"]
    part: Int[Tensor, "B S"]
    """Which part each solid belongs to, 0 or 1."""
    axis: Float[Tensor, "B 3"]
    """Along which the second part's joint lies, a unit vector; through `pivot`."""
    pivot: Float[Tensor, "B 3"]
    slides: Bool[Tensor, " B"]
    """Whether the second part slides along the axis (metres) or turns about it (radians)."""
    travel: Float[Tensor, "B 2"]
    """How far it may go either way from how the object was drawn; zero for rigid objects."""

    @property
    def jointed(self) -> Bool[Tensor, " B"]:
        """Whether there is a second part."""
        return self.part.any(1)

    def only(self, part: int) -> "Solids":
        """One part by itself; where an object has no such part, nothing within reach."""
        away = (self.part != part)[..., None]
        return replace(self, center=torch.where(away, FAR, self.center))

    def mirrored(self) -> "Solids":
        """The mirror images at x = 0: what is a left hand's object is then a right hand's."""
        flip = self.center.new_tensor([-1.0, 1.0, 1.0])
        # turning about an axis and its mirror image are opposite; sliding along them is not
        axis = self.axis * torch.where(self.slides[:, None], flip, -flip)
        return replace(
            self,
            center=torch.where(self.center < FAR / 2, self.center * flip, self.center),
            rotation=flip[:, None] * self.rotation * flip,  # each solid is its own mirror image
            axis=axis,
            pivot=self.pivot * flip,
        )

    def joint_pose(
        self, travelled: Float[Tensor, "B T"]
    ) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
        """Rotation and translation that bring the second part to where its joint has gone."""
        along = travelled[..., None] * self.axis[:, None]
        slides = self.slides[:, None, None]
        turn = axis_angle_to_matrix(torch.where(slides, 0.0, along))
        pivot = self.pivot[:, None]
        swung = pivot - (turn @ pivot[..., None])[..., 0]
        return turn, torch.where(slides, along, swung)

    def part_of(self, points: Float[Tensor, "B P 3"]) -> Int[Tensor, "B P"]:
        """The part that each point is nearest to."""
        first, second = (self.only(part).signed_distance(points) for part in range(PARTS))
        return (second < first).long()

    def chosen(self, which: Bool[Tensor, " B"] | Int[Tensor, " C"]) -> "Solids":
        """Some of the objects."""
        return Solids(*(getattr(self, field.name)[which] for field in fields(self)))

    def signed_distance(self, points: Float[Tensor, "B P 3"]) -> Float[Tensor, "B P"]:
        """Signed distance in metres, negative inside; exact outside boxes, cylinders and tori.

        Ellipsoids use the first-order bound k0 (k0 - 1) / k1, inside a union it is the maximum
        depth over the parts: both are zero on the surface and have its normal there.
        """
        local = (points[:, None] - self.center[:, :, None]) @ self.rotation
        size, kind = self.size[:, :, None], self.kind[:, :, None]
        radial = local[..., :2].norm(dim=-1)

        q = local.abs() - (size - self.rounding[:, :, None, None])
        box = q.clamp(min=0).norm(dim=-1) + q.amax(-1).clamp(max=0)
        c = torch.stack([radial, local[..., 2].abs()], -1) - size[..., 1:]
        c = c + self.rounding[:, :, None, None]
        cylinder = c.clamp(min=0).norm(dim=-1) + c.amax(-1).clamp(max=0)
        k0 = (local / size).norm(dim=-1)
        k1 = (local / size**2).norm(dim=-1).clamp(min=1e-6)
        ellipsoid = k0 * (k0 - 1) / k1
        tube = torch.stack([radial - size[..., 0], local[..., 2]], -1).norm(dim=-1) - size[..., 1]

        rounding = self.rounding[:, :, None]
        each = torch.where(kind == BOX, box - rounding, cylinder - rounding)
        each = torch.where(kind == ELLIPSOID, ellipsoid, each)
        return torch.where(kind == TORUS, tube, each).amin(1)

    def distance_and_normal(
        self, points: Float[Tensor, "B P 3"]
    ) -> tuple[Float[Tensor, "B P"], Float[Tensor, "B P 3"]]:
        """Signed distance and its unit gradient, the outward normal on the surface."""
        with torch.enable_grad():
            query = points.detach().requires_grad_(True)
            distance = self.signed_distance(query)
            (gradient,) = torch.autograd.grad(distance.sum(), query)
        normal = torch.nn.functional.normalize(gradient, dim=-1)
        return distance.detach(), normal

    def surface_points(
        self, count: int, *, generator: torch.Generator
    ) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B P 3"]]:
        """Points spread over the surface with their outward normals.

        Random points around the solids slide down the distance field; the sharp ends of thin parts
        get fewer points than wide faces, much as area weighting would do.
        """
        batch = len(self.kind)
        used = (self.center[..., 0] < FAR / 2).float()
        reach = torch.where(
            self.kind == TORUS, self.size[..., :2].sum(-1), self.size.norm(dim=-1)
        ).clamp(min=0.01)
        drawn = count + count // 2  # a third is lost where the slide has not converged
        part = torch.multinomial(used * reach, drawn, replacement=True, generator=generator)
        at = torch.arange(batch)[:, None]
        ball = torch.randn(batch, drawn, 3, generator=generator)
        ball = ball / ball.norm(dim=-1, keepdim=True)
        extent = torch.where(
            (self.kind == TORUS)[..., None],
            (self.size[..., :1] + self.size[..., 1:2]).expand(-1, -1, 3),
            self.size,
        )[at, part]
        local = ball * extent * 1.2
        points = self.center[at, part] + (self.rotation[at, part] @ local[..., None])[..., 0]
        for _ in range(7):
            distance, normal = self.distance_and_normal(points)
            points = points - 0.9 * distance[..., None] * normal
        distance, normal = self.distance_and_normal(points)
        # in the order they were drawn: rounding is smaller on some parts, whose points would win
        astray = (distance.abs() > ASTRAY).int()
        keep = astray.argsort(dim=1, stable=True)[:, :count, None].expand(-1, -1, 3)
        return points.gather(1, keep), normal.gather(1, keep)


Draw = Callable[[float, float], float]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class _Solid:
    kind: int
    size: Vector
    center: Vector = (0.0, 0.0, 0.0)
    turn: Vector = (0.0, 0.0, 0.0)
    rounding: float = 0.002
    part: int = 0


@dataclass(frozen=True)
class _Joint:
    """What the second part of an object turns about or slides along, and how far either way."""

    axis: Vector
    travel: tuple[float, float]
    pivot: Vector = (0.0, 0.0, 0.0)
    slides: bool = False


Drawn = list[_Solid] | tuple[list[_Solid], _Joint]
"""A rigid object, or one with a second part on a joint."""


def _box(u: Draw) -> list[_Solid]:
    return [_Solid(BOX, (u(0.01, 0.08), u(0.01, 0.06), u(0.01, 0.05)), rounding=u(0.001, 0.005))]


def _board(u: Draw) -> list[_Solid]:
    return [_Solid(BOX, (u(0.05, 0.11), u(0.03, 0.08), u(0.003, 0.008)), rounding=0.002)]


def _cylinder(u: Draw) -> list[_Solid]:
    r = u(0.01, 0.045)
    return [_Solid(CYLINDER, (r, r, u(0.02, 0.10)), rounding=u(0.001, 0.005))]


def _capsule(u: Draw) -> list[_Solid]:
    r = u(0.006, 0.025)
    return [_Solid(CYLINDER, (r, r, u(0.04, 0.12)), rounding=0.98 * r)]


def _ellipsoid(u: Draw) -> list[_Solid]:
    return [_Solid(ELLIPSOID, (u(0.02, 0.05), u(0.02, 0.05), u(0.02, 0.06)))]


def _ring(u: Draw) -> list[_Solid]:
    return [_Solid(TORUS, (u(0.02, 0.06), u(0.004, 0.014), 1.0))]


def _mug(u: Draw) -> list[_Solid]:
    r, h = u(0.03, 0.045), u(0.035, 0.06)
    handle = _Solid(
        TORUS, (u(0.018, 0.03), u(0.004, 0.007), 1.0), (r, 0.0, 0.0), (math.pi / 2, 0.0, 0.0)
    )
    return [_Solid(CYLINDER, (r, r, h), rounding=0.003), handle]


def _hammer(u: Draw) -> list[_Solid]:
    r, h = u(0.009, 0.017), u(0.08, 0.14)
    head = _Solid(BOX, (u(0.035, 0.06), u(0.012, 0.02), u(0.012, 0.02)), (0.0, 0.0, h))
    return [_Solid(CYLINDER, (r, r, h), rounding=0.004), head]


def _bottle(u: Draw) -> Drawn:
    r, h = u(0.025, 0.04), u(0.05, 0.09)
    neck, cap = u(0.4, 0.5) * r, u(0.012, 0.02)
    top = _Solid(CYLINDER, (neck, neck, cap), (0.0, 0.0, h + cap), part=1)
    pulled = _Joint((0.0, 0.0, 1.0), (0.0, 0.06), slides=True)
    return [_Solid(CYLINDER, (r, r, h), rounding=0.3 * r), top], pulled


def _pan(u: Draw) -> list[_Solid]:
    r, h, length = u(0.06, 0.11), u(0.012, 0.025), u(0.06, 0.1)
    t = u(0.007, 0.013)
    handle = _Solid(
        CYLINDER, (t, t, length), (r + length, 0.0, h / 2), (0.0, math.pi / 2, 0.0), 0.9 * t
    )
    return [_Solid(CYLINDER, (r, r, h), rounding=0.004), handle]


def _knife(u: Draw) -> list[_Solid]:
    grip, blade = u(0.045, 0.07), u(0.05, 0.1)
    handle = _Solid(BOX, (grip, u(0.009, 0.014), u(0.007, 0.011)), rounding=0.005)
    return [handle, _Solid(BOX, (blade, 0.012, 0.0015), (grip + blade, 0.0, 0.0), rounding=0.001)]


def _loop_tool(u: Draw) -> list[_Solid]:
    radius, tube = u(0.018, 0.03), u(0.004, 0.007)
    length = u(0.04, 0.07)
    loops = [
        _Solid(TORUS, (radius, tube, 1.0), (-length - radius, side * radius, 0.0))
        for side in (-1.0, 1.0)
    ]
    return [_Solid(BOX, (length, u(0.006, 0.012), 0.003), rounding=0.001), *loops]


def _cluster(u: Draw) -> list[_Solid]:
    return [
        _Solid(
            (BOX, CYLINDER, ELLIPSOID)[int(u(0.0, 2.999))],
            ((r := u(0.012, 0.04)), r, u(0.012, 0.05)),
            (u(-0.03, 0.03), u(-0.03, 0.03), u(-0.03, 0.03)),
            (u(-3.0, 3.0), u(-3.0, 3.0), u(-3.0, 3.0)),
        )
        for _ in range(3)
    ]


def _ball(u: Draw) -> list[_Solid]:
    r = u(0.015, 0.06)
    return [_Solid(ELLIPSOID, (r, r, r))]


def _coin(u: Draw) -> list[_Solid]:
    r = u(0.012, 0.045)
    return [_Solid(CYLINDER, (r, r, u(0.0015, 0.006)), rounding=0.001)]


def _phone(u: Draw) -> list[_Solid]:
    return [_Solid(BOX, (u(0.06, 0.085), u(0.03, 0.042), u(0.0035, 0.006)), rounding=0.0033)]


def _pen(u: Draw) -> list[_Solid]:
    r = u(0.0035, 0.007)
    return [_Solid(CYLINDER, (r, r, u(0.05, 0.09)), rounding=0.9 * r)]


def _carton(u: Draw) -> list[_Solid]:
    return [_Solid(BOX, (u(0.05, 0.15), u(0.04, 0.12), u(0.03, 0.1)), rounding=0.002)]


def _bowl(u: Draw) -> list[_Solid]:
    r, tube, h = u(0.045, 0.085), u(0.004, 0.007), u(0.02, 0.045)
    rims = [_Solid(TORUS, ((0.7 + 0.3 * k) * r, tube, 1.0), (0.0, 0.0, k * h)) for k in (0.0, 0.5)]
    base = _Solid(CYLINDER, (0.7 * r, 0.7 * r, tube), rounding=0.002)
    return [base, *rims, _Solid(TORUS, (r, tube, 1.0), (0.0, 0.0, h))]


def _plate(u: Draw) -> list[_Solid]:
    r, tube = u(0.06, 0.12), u(0.004, 0.007)
    rim = _Solid(TORUS, (r, tube, 1.0), (0.0, 0.0, 2 * tube))
    return [_Solid(CYLINDER, (r, r, tube), rounding=0.002), rim]


def _spoon(u: Draw) -> list[_Solid]:
    length, bowl = u(0.05, 0.09), u(0.015, 0.03)
    handle = _Solid(BOX, (length, u(0.004, 0.008), u(0.002, 0.004)), rounding=0.0015)
    return [handle, _Solid(ELLIPSOID, (bowl, 0.7 * bowl, 0.006), (length + 0.8 * bowl, 0.0, 0.0))]


def _brush(u: Draw) -> list[_Solid]:
    length, r = u(0.05, 0.08), u(0.006, 0.012)
    handle = _Solid(CYLINDER, (r, r, length), turn=(0.0, math.pi / 2, 0.0), rounding=0.9 * r)
    head = _Solid(BOX, (u(0.02, 0.04), u(0.01, 0.025), u(0.008, 0.02)), (length + 0.02, 0.0, 0.0))
    return [handle, head]


def _screwdriver(u: Draw) -> list[_Solid]:
    grip, shaft, r = u(0.035, 0.06), u(0.04, 0.08), u(0.009, 0.016)
    handle = _Solid(CYLINDER, (r, r, grip), rounding=0.5 * r)
    return [handle, _Solid(CYLINDER, (0.003, 0.003, shaft), (0.0, 0.0, grip + shaft))]


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
        solids.append(_Solid(TORUS, (radius, tube, 1.0), loop, part=part))
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
    thick = u(0.003, 0.006)
    lid = (-depth + depth * math.cos(opening), 0.0, depth * math.sin(opening))
    solids = [
        _Solid(BOX, (depth, width, thick)),
        _Solid(BOX, (depth, width, thick), lid, (0.0, -opening, 0.0), part=1),
    ]
    hinge = (-depth, 0.0, 0.0)
    return solids, _Joint((0.0, -1.0, 0.0), (0.1 - opening, 2.2 - opening), hinge)


def _chest(u: Draw) -> Drawn:
    depth, width, height = u(0.04, 0.09), u(0.05, 0.11), u(0.02, 0.05)
    opening, thick = u(0.0, 1.5), u(0.003, 0.006)
    back = (-depth, 0.0, height + thick)
    lid = (depth * math.cos(opening) - depth, 0.0, height + thick + depth * math.sin(opening))
    solids = [
        _Solid(BOX, (depth, width, height)),
        _Solid(BOX, (depth, width, thick), lid, (0.0, -opening, 0.0), part=1),
    ]
    return solids, _Joint((0.0, -1.0, 0.0), (-opening, 1.8 - opening), back)


def _drawer(u: Draw) -> Drawn:
    wide, high, deep = u(0.06, 0.12), u(0.03, 0.06), u(0.06, 0.1)
    opened, knob, t = u(0.0, 0.06), u(0.025, 0.05), u(0.004, 0.007)
    front = opened + deep + 0.004
    bar = (front + 0.03, 0.0, 0.0)
    solids = [
        _Solid(BOX, (deep, wide + 0.01, high + 0.01)),
        _Solid(BOX, (deep, wide, high), (opened + 0.004, 0.0, 0.0), part=1),
        _Solid(BOX, (0.016, t, t), (front + 0.014, 0.0, 0.0), part=1),
        _Solid(CYLINDER, (t, t, knob), bar, (math.pi / 2, 0.0, 0.0), 0.9 * t, part=1),
    ]
    return solids, _Joint((1.0, 0.0, 0.0), (-opened, 0.09 - opened), slides=True)


def _kettle(u: Draw) -> list[_Solid]:
    r, h, ring = u(0.045, 0.07), u(0.04, 0.06), u(0.03, 0.045)
    handle = _Solid(
        TORUS, (ring, u(0.006, 0.01), 1.0), (0.0, 0.0, h + 0.5 * ring), (math.pi / 2, 0.0, 0.0)
    )
    return [_Solid(CYLINDER, (r, r, h), rounding=0.01), handle]


def _wine_glass(u: Draw) -> list[_Solid]:
    r, stem = u(0.025, 0.042), u(0.03, 0.05)
    return [
        _Solid(ELLIPSOID, (r, r, 1.3 * r), (0.0, 0.0, stem + 1.1 * r)),
        _Solid(CYLINDER, (0.004, 0.004, stem)),
        _Solid(CYLINDER, (0.8 * r, 0.8 * r, 0.003), (0.0, 0.0, -stem), rounding=0.001),
    ]


def _mouse(u: Draw) -> list[_Solid]:
    return [_Solid(ELLIPSOID, (u(0.045, 0.06), u(0.025, 0.036), u(0.014, 0.024)))]


def _spray(u: Draw) -> list[_Solid]:
    r, h, reach = u(0.022, 0.036), u(0.05, 0.08), u(0.015, 0.03)
    top = h + 0.02
    return [
        _Solid(CYLINDER, (r, r, h), rounding=0.4 * r),
        _Solid(BOX, (reach, 0.011, 0.01), (0.4 * reach, 0.0, top), rounding=0.003),
        _Solid(BOX, (0.004, 0.006, 0.016), (reach, 0.0, top - 0.02), (0.0, 0.3, 0.0)),
        _Solid(CYLINDER, (0.4 * r, 0.4 * r, 0.015), (0.0, 0.0, h)),
    ]


FAMILIES: dict[str, Callable[[Draw], Drawn]] = {
    "box": _box,
    "board": _board,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "ellipsoid": _ellipsoid,
    "ring": _ring,
    "mug": _mug,
    "hammer": _hammer,
    "bottle": _bottle,
    "pan": _pan,
    "knife": _knife,
    "loop_tool": _loop_tool,
    "cluster": _cluster,
    "ball": _ball,
    "coin": _coin,
    "phone": _phone,
    "pen": _pen,
    "carton": _carton,
    "bowl": _bowl,
    "plate": _plate,
    "spoon": _spoon,
    "brush": _brush,
    "screwdriver": _screwdriver,
    "scissors": _scissors,
    "pliers": _pliers,
    "laptop": _laptop,
    "chest": _chest,
    "drawer": _drawer,
    "kettle": _kettle,
    "wine_glass": _wine_glass,
    "mouse": _mouse,
    "spray": _spray,
}


def family_named(name: str) -> Callable[[Draw], Drawn]:
    """What draws an object of a family.

    Raises:
        ConfigError: there is no family of that name.
    """
    if name not in FAMILIES:
        near = difflib.get_close_matches(name, FAMILIES, 1, 0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(FAMILIES)}"
        raise ConfigError(f"{name!r} is no object family; {hint}")
    return FAMILIES[name]


def draw_objects(families: list[str], *, generator: torch.Generator) -> Solids:
    """One random object per family name, centred near the origin of its own frame."""

    def uniform(low: float, high: float) -> float:
        return low + (high - low) * float(torch.rand((), generator=generator))

    batch = len(families)
    kind = torch.full((batch, SOLIDS), BOX)
    size = torch.full((batch, SOLIDS, 3), 0.01)
    rounding = torch.zeros(batch, SOLIDS)
    center = torch.full((batch, SOLIDS, 3), FAR)
    turn = torch.zeros(batch, SOLIDS, 3)
    part = torch.zeros(batch, SOLIDS, dtype=torch.long)
    axis, pivot = torch.eye(3)[2].repeat(batch, 1), torch.zeros(batch, 3)
    slides, travel = torch.zeros(batch, dtype=torch.bool), torch.zeros(batch, 2)
    for b, family in enumerate(families):
        drawn = family_named(family)(uniform)
        solids, joint = drawn if isinstance(drawn, tuple) else (drawn, None)
        for s, solid in enumerate(solids):
            kind[b, s], rounding[b, s] = solid.kind, min(solid.rounding, 0.95 * min(solid.size))
            size[b, s] = torch.tensor(solid.size)
            center[b, s] = torch.tensor(solid.center)
            turn[b, s] = torch.tensor(solid.turn)
            part[b, s] = solid.part
        if joint is not None:
            axis[b], pivot[b] = torch.tensor(joint.axis), torch.tensor(joint.pivot)
            slides[b], travel[b] = joint.slides, torch.tensor(joint.travel)
    rotation = axis_angle_to_matrix(turn)
    return Solids(kind, size, rounding, center, rotation, part, axis, pivot, slides, travel)
