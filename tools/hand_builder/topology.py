"""The mesh as an artist would lay it: rings round the fingers, rows over the palm, all quads.

Columns u run over the back and over the palm from the index side (0) to the pinky side (8): the odd
ones pass along a finger's middle, the even ones between fingers, where two neighbours share the
web. Row 0 is the line of the webs; each finger grows from the eight vertices round its base, the
thumb from a hole of `THUMB_ROWS` rows in the index side. The forearm is closed by a cap.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Ids = NDArray[np.int64]
Faces = Ids

COLUMNS = 9
ROWS = 13
"""Palm rows behind the web line, the last one is the inner ring of the cap."""
THUMB_ROWS = (5, 9)
"""First and last row of the hole that the thumb grows from."""
FINGER_RINGS = (11, 12, 11, 11)
"""Rings beyond the web line of index, middle, ring, pinky."""
THUMB_RINGS = 11


@dataclass(frozen=True)
class Layout:
    """Which vertex is where: the mesh's connectivity without any position."""

    count: int
    triangles: Faces
    edges: Ids
    """Edges of the quads and fans, without the quads' diagonals."""
    dorsal: Ids
    """(1 + ROWS, 9): back of the hand, row by row from the web line to the forearm."""
    palmar: Ids
    side: Ids
    """(1 + ROWS, 2): index side and pinky side; -1 where the thumb's hole is."""
    webs: Ids
    """(3,): the crest between neighbouring fingers."""
    cap: int
    rings: tuple[Ids, ...]
    """Index, middle, ring, pinky, thumb: (1 + rings, 8 or 12), ring 0 shared with the palm."""
    tips: tuple[int, ...] = field(default=())


class _Counter:
    """Hands out vertex numbers."""

    def __init__(self) -> None:
        self.count = 0

    def take(self, *shape: int) -> Ids:
        size = int(np.prod(shape))
        self.count += size
        return np.arange(self.count - size, self.count).reshape(shape)


def layout() -> Layout:
    """The connectivity: 778 vertices, closed, one piece."""
    new = _Counter()
    dorsal, palmar = new.take(1 + ROWS, COLUMNS), new.take(1 + ROWS, COLUMNS)
    side = np.full((1 + ROWS, 2), -1)
    first, last = THUMB_ROWS
    for row in range(1 + ROWS):
        if not first < row < last:
            side[row, 0] = new.take(1)[0]
        side[row, 1] = new.take(1)[0]
    webs = new.take(3)
    cap = int(new.take(1)[0])
    bases = [_finger_base(place, dorsal, palmar, side, webs) for place in range(4)]
    bases.append(_thumb_base(dorsal, palmar, side))
    rings, tips, quads, fans = [], [], [], []
    for base, count in zip(bases, (*FINGER_RINGS, THUMB_RINGS), strict=True):
        ring = np.concatenate([base[None], new.take(count, len(base))])
        tip = int(new.take(1)[0])
        rings.append(ring)
        tips.append(tip)
        quads.append(_tube(ring))
        fans.append(_fan(ring[-1], tip))
    quads.append(_palm(dorsal, palmar, side))
    fans.append(_fan(_around(dorsal, palmar, side, ROWS)[::-1], cap))
    quad, fan = np.concatenate(quads), np.concatenate(fans)
    triangles = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]], fan])
    return Layout(
        new.count,
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


def _edges(quads: Faces, fans: Faces) -> Ids:
    """Each side of the given polygons once."""
    sides = [np.stack([face, np.roll(face, -1, 1)], -1).reshape(-1, 2) for face in (quads, fans)]
    return np.unique(np.sort(np.concatenate(sides), axis=1), axis=0)


def _finger_base(place: int, dorsal: Ids, palmar: Ids, side: Ids, webs: Ids) -> Ids:
    """The eight vertices a finger grows from, from the back over the pinky side round."""
    left = side[0, 0] if place == 0 else webs[place - 1]
    right = side[0, 1] if place == 3 else webs[place]
    u = 2 * place
    back, front = dorsal[0, u : u + 3], palmar[0, u : u + 3]
    return np.r_[back, right, front[::-1], left]


def _thumb_base(dorsal: Ids, palmar: Ids, side: Ids) -> Ids:
    """The hole's rim, from the web to the index over the palm, the wrist and the back."""
    first, last = THUMB_ROWS
    back, front = dorsal[first : last + 1, 0], palmar[first : last + 1, 0]
    return np.r_[side[first, 0], front, side[last, 0], back[::-1]]


def _around(dorsal: Ids, palmar: Ids, side: Ids, row: int) -> Ids:
    """One whole row of the palm as a ring of 20."""
    return np.r_[dorsal[row], side[row, 1], palmar[row, ::-1], side[row, 0]]


def _tube(rings: Ids) -> Faces:
    """The quads between successive rings."""
    a, b = rings[:-1], rings[1:]
    return np.stack([a, np.roll(a, -1, 1), np.roll(b, -1, 1), b], -1).reshape(-1, 4)


def _fan(ring: Ids, tip: int) -> Faces:
    """Triangles from a ring to one vertex."""
    return np.stack([ring, np.roll(ring, -1), np.full(len(ring), tip)], 1)


def _palm(dorsal: Ids, palmar: Ids, side: Ids) -> Faces:
    """The rows of 20 as quads, without those of the thumb's hole, turned like the tubes."""
    ring = np.stack([_around(dorsal, palmar, side, row) for row in range(1 + ROWS)])
    a, b = ring[:-1], ring[1:]
    quads = np.stack([a, b, np.roll(b, -1, 1), np.roll(a, -1, 1)], -1)
    first, last = THUMB_ROWS
    keep = np.ones(quads.shape[:2], dtype=bool)
    keep[first:last, -2:] = False  # between palm edge, index side and back edge
    return quads[keep]
