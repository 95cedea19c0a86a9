"""Connectivity of the mesh: rings around the fingers, rows over the palm, almost all quads.

Columns u run over the back and over the palm from the index side (0) to the pinky side (8): the odd
ones pass along a finger's middle, the even ones between fingers, where two neighbours share the
web. Row 0 is the line of the webs; each finger grows from the eight vertices round its base, the
thumb from a hole of `THUMB_ROWS` rows in the index side. The forearm is closed by a cap.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

VertexIds = NDArray[np.int64]
Faces = VertexIds

COLUMNS = 9
ROWS = 13
"""Palm rows behind the web line, the last one is the inner ring of the cap."""
THUMB_ROWS = (5, 9)
"""First and last row of the hole that the thumb grows from."""
FINGER_RINGS = (11, 12, 11, 11)
"""Rings beyond the web line of index, middle, ring, pinky."""
THUMB_RINGS = 11


@dataclass(frozen=True)
class HandTopology:
    """Connectivity of the mesh, and which vertices form its parts; no positions."""

    count: int
    triangles: Faces
    edges: VertexIds
    """Edges of the quads and fans, without the quads' diagonals."""
    dorsal: VertexIds
    """(1 + ROWS, 9): back of the hand, row by row from the web line to the forearm."""
    palmar: VertexIds
    side: VertexIds
    """(1 + ROWS, 2): index side and pinky side; -1 where the thumb's hole is."""
    webs: VertexIds
    """(3,): the crest between neighbouring fingers."""
    cap: int
    rings: tuple[VertexIds, ...]
    """Index, middle, ring, pinky, thumb: (1 + rings, 8 or 12), ring 0 shared with the palm."""
    tips: tuple[int, ...] = field(default=())


class _Counter:
    """Numbers the vertices."""

    def __init__(self) -> None:
        self.count = 0

    def new(self, *shape: int) -> VertexIds:
        size = int(np.prod(shape))
        self.count += size
        return np.arange(self.count - size, self.count).reshape(shape)


def hand_topology() -> HandTopology:
    """The connectivity: 778 vertices, closed, one piece."""
    counter = _Counter()
    dorsal, palmar = counter.new(1 + ROWS, COLUMNS), counter.new(1 + ROWS, COLUMNS)
    side = np.full((1 + ROWS, 2), -1)
    first, last = THUMB_ROWS
    for row in range(1 + ROWS):
        if not first < row < last:
            side[row, 0] = counter.new(1)[0]
        side[row, 1] = counter.new(1)[0]
    webs = counter.new(3)
    cap = int(counter.new(1)[0])
    bases = [_finger_base(place, dorsal, palmar, side, webs) for place in range(4)]
    bases.append(_thumb_base(dorsal, palmar, side))
    rings, tips, quads, fans = [], [], [], []
    for base, count in zip(bases, (*FINGER_RINGS, THUMB_RINGS), strict=True):
        ring = np.concatenate([base[None], counter.new(count, len(base))])
        tip = int(counter.new(1)[0])
        rings.append(ring)
        tips.append(tip)
        quads.append(_tube(ring))
        fans.append(_fan(ring[-1], tip))
    quads.append(_palm(dorsal, palmar, side))
    fans.append(_fan(_around(dorsal, palmar, side, ROWS)[::-1], cap))
    quad, fan = np.concatenate(quads), np.concatenate(fans)
    triangles = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]], fan])
    return HandTopology(
        counter.count,
        triangles,
        _edges(quad, fan),
        dorsal,
        palmar,
        side,
        webs,
        cap,
        tuple(rings),
        tuple(tips),
    )


def _edges(quads: Faces, fans: Faces) -> VertexIds:
    """Each side of the given polygons once."""
    sides = [np.stack([face, np.roll(face, -1, 1)], -1).reshape(-1, 2) for face in (quads, fans)]
    return np.unique(np.sort(np.concatenate(sides), axis=1), axis=0)


def _finger_base(
    place: int, dorsal: VertexIds, palmar: VertexIds, side: VertexIds, webs: VertexIds
) -> VertexIds:
    """The eight vertices at the base of a finger, from the back over the pinky side."""
    left = side[0, 0] if place == 0 else webs[place - 1]
    right = side[0, 1] if place == 3 else webs[place]
    u = 2 * place
    back, front = dorsal[0, u : u + 3], palmar[0, u : u + 3]
    return np.r_[back, right, front[::-1], left]


def _thumb_base(dorsal: VertexIds, palmar: VertexIds, side: VertexIds) -> VertexIds:
    """The hole's rim, from the web to the index over the palm, the wrist and the back."""
    first, last = THUMB_ROWS
    back, front = dorsal[first : last + 1, 0], palmar[first : last + 1, 0]
    return np.r_[side[first, 0], front, side[last, 0], back[::-1]]


def _around(dorsal: VertexIds, palmar: VertexIds, side: VertexIds, row: int) -> VertexIds:
    """One row of the palm as a closed ring of 20 vertices."""
    return np.r_[dorsal[row], side[row, 1], palmar[row, ::-1], side[row, 0]]


def _tube(rings: VertexIds) -> Faces:
    """The quads between successive rings."""
    a, b = rings[:-1], rings[1:]
    return np.stack([a, np.roll(a, -1, 1), np.roll(b, -1, 1), b], -1).reshape(-1, 4)


def _fan(ring: VertexIds, tip: int) -> Faces:
    """Triangles from a ring to one vertex."""
    return np.stack([ring, np.roll(ring, -1), np.full(len(ring), tip)], 1)


def _palm(dorsal: VertexIds, palmar: VertexIds, side: VertexIds) -> Faces:
    """The rows of 20 as quads, without those of the thumb's hole, turned like the tubes."""
    ring = np.stack([_around(dorsal, palmar, side, row) for row in range(1 + ROWS)])
    a, b = ring[:-1], ring[1:]
    quads = np.stack([a, b, np.roll(b, -1, 1), np.roll(a, -1, 1)], -1)
    first, last = THUMB_ROWS
    keep = np.ones(quads.shape[:2], dtype=bool)
    keep[first:last, -2:] = False  # between palm edge, index side and back edge
    return quads[keep]
