"""Triangulation of polygons with more than three corners, convex or concave.

trimesh makes a fan from the first corner, which leaves the outline of a concave face: the gap of
a wrench would get a lid.
"""

import re
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int

if TYPE_CHECKING:
    import trimesh

Polygons = tuple[Int[np.ndarray, " C"], Int[np.ndarray, " P"]]
"""Vertex indices of all faces, one face after the other, and the number of corners of each."""
OUTSIDE = 1e-3
"""Share of a face's area that a fan may cover outside of the outline; less may be rounding."""


def obj_polygons(data: bytes) -> tuple[Float[np.ndarray, "V 3"], Polygons] | None:
    """Points and faces of an OBJ file; None where all faces are triangles."""
    lines = data.replace(b"\r", b"").replace(b"\\\n", b" ").split(b"\n")
    faces = [line for line in lines if line[:2] in (b"f ", b"f\t")]
    if not any(len(line.split()) > 4 for line in faces if line.count(b" ") > 3 or b"\t" in line):
        return None
    faces = [line[2:].split() for line in faces]
    corners = b" ".join(chain.from_iterable(faces))
    corners = re.sub(rb"/\S*", b"", corners) if b"/" in corners else corners
    points = [line[2:].split()[:3] for line in lines if line[:2] in (b"v ", b"v\t")]
    places = np.fromstring(b" ".join(chain.from_iterable(points)), sep=" ").reshape(-1, 3)
    indices = np.fromstring(corners, dtype=np.int64, sep=" ") - 1
    return places, (indices, np.array(list(map(len, faces))))


def ply_polygons(scene: "trimesh.Scene") -> tuple[Float[np.ndarray, "V 3"], Polygons] | None:
    """Points and faces of an ASCII PLY file that trimesh has read; None for all other files, and
    where all faces have the same number of corners."""
    for shape in scene.geometry.values():
        columns = shape.metadata.get("_ply_raw", {}).get("face", {}).get("data")
        if isinstance(columns, dict):  # of a binary file it is one array
            faces = columns.get("vertex_indices", columns.get("vertex_index"))
            if faces is not None and faces.dtype == object:  # of several lengths
                polygons = np.concatenate(faces), np.array(list(map(len, faces)))
                return np.array(shape.vertices), polygons
    return None


def cut_within(
    points: Float[np.ndarray, "V 3"], polygons: Polygons
) -> Int[np.ndarray, "F 3"] | None:
    """Triangulation within the outlines of faces; None where trimesh's fans are all correct."""
    outside = are_cut_outside(points, polygons)
    if not outside.any():
        return None
    corners, sizes = polygons
    found: list[Int[np.ndarray, "M 3"]] = []
    for face, leaves in zip(np.split(corners, sizes.cumsum()[:-1]), outside, strict=True):
        fan = [[0, last - 1, last] for last in range(2, len(face))]
        found.append(face[np.array(ears(points[face]) if leaves else fan).reshape(-1, 3)])
    return np.concatenate(found)


def are_cut_outside(points: Float[np.ndarray, "V 3"], polygons: Polygons) -> Bool[np.ndarray, " P"]:
    """Whether the fan from the first corner of each face leaves its outline: some triangles then
    have reversed orientation."""
    corners, sizes = polygons
    found, starts = np.zeros(len(sizes), dtype=bool), sizes.cumsum() - sizes
    for size in np.unique(sizes[sizes > 3]):
        which = np.flatnonzero(sizes == size)
        outlines = points[corners[starts[which, None] + np.arange(size)]]
        spokes = outlines[:, 1:] - outlines[:, :1]
        triangles = np.cross(spokes[:, :-1], spokes[:, 1:])
        normal = triangles.sum(1, keepdims=True)
        shares = (triangles * normal).sum(-1) / (normal**2).sum(-1).clip(1e-30)
        found[which] = (-shares).clip(min=0).sum(-1) > OUTSIDE
    return found


def _turns_of(outline: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    """Signed area of the triangle of each corner and its two neighbours, as a share of the area
    of the face; negative at reflex corners."""
    spokes, sides = outline - outline[:1], np.roll(outline, -1, 0) - outline
    normal = np.cross(spokes, np.roll(spokes, -1, 0)).sum(0)
    at_corners = (np.cross(np.roll(sides, 1, 0), sides) * normal).sum(-1)
    return at_corners / (normal**2).sum().clip(1e-30)


def ears(outline: Float[np.ndarray, "N 3"]) -> list[list[int]]:
    """Triangulate a face by ear clipping; triangles index its corners.

    An ear is a triangle of three consecutive corners that lies within the outline. The largest
    ear is cut first.
    """
    left, found = list(range(len(outline))), []
    while len(left) > 3:
        turns, size = _turns_of(outline[left]), len(left)
        largest = np.argsort(-turns, kind="stable").tolist()
        around = [(at - 1, at, (at + 1) % size) for at in largest]
        inside = (ear for ear in around if turns[ear[1]] > 0 and _is_empty(outline[left], ear))
        ear = next(inside, around[0])
        found.append([left[at] for at in ear])
        left.pop(ear[1])
    return [*found, left]


def _is_empty(outline: Float[np.ndarray, "N 3"], ear: tuple[int, int, int]) -> bool:
    """Whether the triangle of three corners contains no other corner of the outline."""
    corners = outline[list(ear)]
    others = np.delete(outline, [at % len(outline) for at in ear], axis=0)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    sides = np.roll(corners, -1, 0) - corners
    inward = np.cross(sides, others[:, None] - corners) @ normal
    return not bool((inward >= 0).all(-1).any())
