"""Faces of more than three corners, cut into triangles within their outline.

trimesh cuts them by lines from their first corner, which lie outside of a face that has a notch:
the gap of a wrench gets a lid.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

Polygons = list[list[int]]
"""The corners of each face."""
OUTSIDE = 1e-3
"""Share of a face's area that counts as cut outside of its outline; coordinates are rounded."""


def obj_polygons(data: bytes) -> tuple[Float[np.ndarray, "V 3"], Polygons] | None:
    """Points and faces of an OBJ file; None where all faces are triangles."""
    words = [line.split() for line in data.replace(b"\\\n", b" ").split(b"\n")]
    faces = [each[1:] for each in words if each[:1] == [b"f"]]
    if all(len(face) <= 3 for face in faces):
        return None
    points = np.array([each[1:4] for each in words if each[:1] == [b"v"]]).astype(np.float64)
    return points, [[int(corner.split(b"/")[0]) - 1 for corner in face] for face in faces]


def cut_within(
    points: Float[np.ndarray, "V 3"], polygons: Polygons
) -> Int[np.ndarray, "F 3"] | None:
    """The triangles of faces, each within its face; None where trimesh cuts all of them so."""
    outside = are_cut_outside(points, polygons)
    if not outside.any():
        return None
    found: Polygons = []
    for face, leaves in zip(polygons, outside.tolist(), strict=True):
        corners = ears(points[face]) if leaves else [[0, k - 1, k] for k in range(2, len(face))]
        found += [[face[corner] for corner in each] for each in corners]
    return np.array(found)


def are_cut_outside(points: Float[np.ndarray, "V 3"], polygons: Polygons) -> Bool[np.ndarray, " F"]:
    """Whether lines from the first corner of each face leave its outline, and cut off triangles
    that look the other way."""
    found, sizes = np.zeros(len(polygons), dtype=bool), np.array(list(map(len, polygons)))
    for size in np.unique(sizes[sizes > 3]):
        which = np.flatnonzero(sizes == size)
        outlines = points[np.array([polygons[index] for index in which])]
        spokes = outlines[:, 1:] - outlines[:, :1]
        triangles = np.cross(spokes[:, :-1], spokes[:, 1:])
        normal = triangles.sum(1, keepdims=True)
        shares = (triangles * normal).sum(-1) / (normal**2).sum(-1).clip(1e-30)
        found[which] = (-shares).clip(min=0).sum(-1) > OUTSIDE
    return found


def turns_of(outlines: Float[np.ndarray, "*B N 3"]) -> Float[np.ndarray, "*B N"]:
    """The area of the triangle at each corner of a face, as a share of the face's.

    Negative where the triangle lies outside.
    """
    spokes, sides = outlines - outlines[..., :1, :], np.roll(outlines, -1, -2) - outlines
    normal = np.cross(spokes, np.roll(spokes, -1, -2)).sum(-2, keepdims=True)
    at_corners = (np.cross(np.roll(sides, 1, -2), sides) * normal).sum(-1)
    return at_corners / (normal**2).sum(-1).clip(1e-30)


def ears(outline: Float[np.ndarray, "N 3"]) -> Polygons:
    """The triangles of a face by its corners: one after the other is cut off within the outline."""
    left, found = list(range(len(outline))), []
    while len(left) > 3:
        turns = turns_of(outline[left])
        size = len(left)
        around = [
            (at - 1, at, (at + 1) % size) for at in np.argsort(-turns, kind="stable").tolist()
        ]
        inside = (ear for ear in around if turns[ear[1]] > 0 and is_empty(outline[left], ear))
        ear = next(inside, around[0])
        found.append([left[at] for at in ear])
        left.pop(ear[1])
    return [*found, left]


def is_empty(outline: Float[np.ndarray, "N 3"], ear: tuple[int, int, int]) -> bool:
    """Whether no corner of an outline is inside of the triangle of three others."""
    corners = outline[list(ear)]
    others = np.delete(outline, [at % len(outline) for at in ear], axis=0)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    sides = np.roll(corners, -1, 0) - corners
    inward = np.cross(sides, others[:, None] - corners) @ normal
    return not bool((inward >= 0).all(-1).any())
