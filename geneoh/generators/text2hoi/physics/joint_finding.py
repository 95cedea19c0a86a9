"""The joint of two meshes in their closed state, found from their shapes, and its range.

A part that can leave the other one in one direction only slides there, as a drawer does. A part
that lies flat on the other one turns about the longest straight side of their contact region.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial import ConvexHull
from torch import Tensor

from geneoh.errors import InputError
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.joint import FORM, Joint
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.sampling import sample_surface
from geneoh.seeds import seeded_generator

COMPARED_POINTS = 1500  # points of each surface at which parts are compared
CONTACTS = 8000  # points of the second part among which those in contact are searched
APART = 0.02  # largest gap between the parts of an object, metres
CONTACT_MARGIN = 0.003  # margin over the least gap within which points are in contact, metres
INSIDE = 0.2  # share of a part's surface inside the other one above which they overlap
DEEPER = 0.0008
"""Penetration depth that a moving part may reach, metres: less than half of a thin wall."""
HINGE, SLIDE = math.radians(110.0), 0.12
"""Largest opening of a joint of unknown range, radians and metres."""
LEAST_RANGE = {"hinge": math.radians(10.0), "slide": 0.01}
"""Least range of a joint that opens, radians and metres, or half of a smaller one that is given."""
OPENS = math.radians(60.0)  # least range of a hinge that is found from shapes
COMPARED_STATES = 34  # states over the range in which parts are compared
TRIED = 12  # states in which candidates for a hinge are compared
FLAT_CONTACT = 0.25  # largest ratio of thickness to width of a flat contact region
STRIP, SHARE = (0.002, 0.006), 0.05
"""Least and largest width of the strip along a side in which contact is searched, metres, and the
strip's share of the width of the contact region."""
BIN, COVERED = 0.006, 0.7
"""Length of the bins along a side, metres, and the share of the side whose bins need a point."""
STRAIGHT = math.cos(math.radians(1.0))  # cosine above which an axis is rounded to a frame axis


@dataclass(frozen=True, eq=False)
class Parts:
    """Two closed parts, as distance fields and surface points of each."""

    fields: tuple[SurfaceDistance, SurfaceDistance]
    points: tuple[Float[Tensor, "P 3"], Float[Tensor, "P 3"]]

    @classmethod
    def of(cls, meshes: tuple[Mesh, Mesh]) -> "Parts":
        """The parts of these meshes; `InputError` if they are more than `APART` apart."""
        fields = SurfaceDistance(meshes[0]), SurfaceDistance(meshes[1])
        first, second = (
            sample_surface(f.solid, COMPARED_POINTS, generator=seeded_generator("parts")).points
            for f in fields
        )
        parts = cls(fields, (first, second))
        if (gap := float(parts.gap)) > APART:
            raise InputError(
                f"{named(meshes[1])}: expected a part next to the first one, got one that is "
                f"{100 * gap:.3g} cm away from it; both meshes are in one frame, closed"
            )
        return parts

    @property
    def gap(self) -> Float[Tensor, ""]:
        """Least distance between the parts, metres."""
        return self.fields[0].query(self.points[1]).distance.amin().clamp(min=0)

    def depths(
        self, joint: Joint, states: Float[Tensor, " T"]
    ) -> tuple[Float[Tensor, "T P"], Float[Tensor, "T P"]]:
        """Penetration depths of the second part's points in the first one in each state of a joint,
        and of the first part's points in the second one, metres; zero outside."""
        pose = joint.pose(states)
        there = self.fields[0].query(pose.apply(self.points[1]), within=DEEPER)
        back = self.fields[1].query(pose.inverse().apply(self.points[0]), within=DEEPER)
        return -there.distance.clamp(max=0), -back.distance.clamp(max=0)

    def room(self, joint: Joint, most: float, states: int = COMPARED_STATES) -> float:
        """The state of the joint up to which the parts do not penetrate each other.

        Points that are inside in the closed state do not count: some models overlap there.
        """
        tried = torch.linspace(0.0, most, states)
        free = torch.ones(states, dtype=torch.bool)
        for depth in self.depths(joint, tried):
            free &= ~((depth > DEEPER) & (depth[0] < DEEPER)).any(1)
        return float(tried[int(free.long().cumprod(0).sum()) - 1])

    @property
    def contact(self) -> Float[Tensor, "N 3"]:
        """Points of the second part that are next to the first one."""
        drawn = sample_surface(
            self.fields[1].solid, CONTACTS, generator=seeded_generator("contact")
        ).points
        distance = self.fields[0].query(drawn).distance
        return drawn[distance < distance.amin().clamp(min=0) + CONTACT_MARGIN]


def named(mesh: Mesh) -> str:
    """The name of a part in messages."""
    return "a part" if mesh.source is None else mesh.source.name


def joint_of(meshes: tuple[Mesh, Mesh], known: Joint | None) -> tuple[Joint, tuple[str, ...]]:
    """The joint of two meshes with its range, and notes on what was found.

    Raises:
        InputError: the parts are far apart, the passed joint is far from them or does not open
            them, or no joint is passed and none is found from their shapes.
    """
    parts = Parts.of(meshes)
    if known is None:
        joint, notes = found_joint(parts, named(meshes[1]))
        return joint, (f"the joint is found from the meshes: --joint {joint}", *notes)
    refuse_far(meshes, known)
    most = known.most or (SLIDE if known.slides else HINGE)
    least, room = min(LEAST_RANGE[known.kind], most / 2), parts.room(known, most)
    if room >= least:
        notes = ()
        if known.most is not None and room < most - 1e-6:
            unit = "cm" if known.slides else "degrees"
            notes = (f"the parts meet beyond {known.in_unit(room)} {unit}, where the joint ends",)
        return replace(known, most=room), notes
    if parts.room(replace(known, axis=-known.axis), most) >= least:
        raise InputError(
            f"joint '{known}': expected a part that moves out of the first one, got one that runs "
            "into it at once; turn the axis round"
        )
    return replace(known, most=most), ("the parts run through each other as the joint moves",)


def refuse_far(meshes: tuple[Mesh, Mesh], joint: Joint) -> None:
    """`InputError` for a hinge whose axis is farther from the parts than they are long."""
    verts = torch.cat([mesh.verts for mesh in meshes])
    size = float((verts.amax(0) - verts.amin(0)).norm())
    away = float(torch.linalg.cross(verts - joint.pivot, joint.axis[None]).norm(dim=1).amin())
    if not joint.slides and away > size:
        raise InputError(
            f"joint '{joint}': expected an axis at the parts, which are {size:.3g} m long, got one "
            f"{away:.3g} m away; give its point in metres, in the frame of the meshes"
        )


def found_joint(parts: Parts, name: str) -> tuple[Joint, tuple[str, ...]]:
    """The joint found from the shapes of two parts, and a note on each other one that fits."""
    ask = f"give the joint as --joint {FORM}"
    inside = (parts.fields[0].query(parts.points[1]).distance < -DEEPER).float().mean()
    if float(inside) > INSIDE:
        raise InputError(
            f"{name}: its joint cannot be found, as {100 * float(inside):.0f}% of its surface are "
            f"inside of the first part; {ask}"
        )
    if (slide := found_slide(parts)) is not None:
        return slide, ()
    hinges = sorted(found_hinges(parts), key=lambda each: -each[0])
    if not hinges:
        raise InputError(
            f"{name}: its joint cannot be found, as it has no straight side next to the first part "
            f"about which it turns, nor a single way out of it; {ask}"
        )
    others = (f"another side fits as well: --joint {other}" for _, other in hinges[1:])
    return hinges[0][1], tuple(others)


def found_slide(parts: Parts) -> Joint | None:
    """The slide along the only frame direction in which the second part is free; else None."""
    ways = torch.cat([torch.eye(3), -torch.eye(3)])
    slides = [Joint(way, torch.zeros(3), slides=True) for way in ways]
    free = [each for each in slides if parts.room(each, 0.03) > 0.029]
    if len(free) != 1:
        return None
    reach = (parts.points[1] @ free[0].axis).max() - (parts.points[1] @ free[0].axis).min()
    most = min(SLIDE, 0.7 * float(reach))
    return replace(free[0], most=parts.room(free[0], most))


def found_hinges(parts: Parts) -> list[tuple[float, Joint]]:
    """Hinges along straight sides of the contact region, each with the length of its side."""
    contact = parts.contact.double()
    middle = contact.mean(0)
    _, spread, axes = torch.linalg.svd(contact - middle, full_matrices=False)
    if len(contact) < 8 or spread[2] > FLAT_CONTACT * spread[1] or spread[1] < 1e-6:
        return []
    flat = ((contact - middle) @ axes[:2].T).numpy()
    found = []
    sides = sides_of(flat)
    for number, (start, end) in enumerate(sides):
        across = sides[number - 1]
        strip = SHARE * float(np.linalg.norm(across[1] - across[0]))
        length = covered(flat, start, end, min(max(strip, STRIP[0]), STRIP[1]))
        if length < COVERED * np.linalg.norm(end - start):
            continue
        pivot = middle + torch.from_numpy((start + end) / 2) @ axes[:2]
        along = torch.nn.functional.normalize(torch.from_numpy(end - start) @ axes[:2], dim=0)
        if along.abs().max() > STRAIGHT:
            along = along.round()
        ways = [Joint(sign * along.float(), pivot.float(), slides=False) for sign in (1, -1)]
        rooms = [parts.room(each, HINGE, TRIED) for each in ways]
        if max(rooms) > OPENS and min(rooms) < OPENS:
            joint = ways[int(np.argmax(rooms))]
            found.append((float(length), replace(joint, most=parts.room(joint, HINGE))))
    return found


def sides_of(points: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The sides of the smallest rectangle around points (N, 2), each from corner to corner."""
    hull = points[ConvexHull(points).vertices]
    edges = np.roll(hull, -1, 0) - hull
    best: tuple[float, np.ndarray] | None = None
    for angle in np.unique(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2)):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        low, high = (hull @ turn).min(0), (hull @ turn).max(0)
        area = float(np.prod(high - low))
        if best is None or area < best[0] - 1e-9:
            corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
            best = area, corners @ turn.T
    assert best is not None, "a hull has edges"
    return list(zip(best[1], np.roll(best[1], -1, 0), strict=True))


def covered(points: np.ndarray, start: np.ndarray, end: np.ndarray, strip: float) -> float:
    """Length of a segment along which points (N, 2) lie in a strip beside it, metres."""
    way = (end - start) / np.linalg.norm(end - start)
    aside = np.abs((points - start) @ np.array([-way[1], way[0]]))
    along = ((points - start) @ way)[aside < strip]
    return BIN * len(np.unique(np.floor(along / BIN)))
