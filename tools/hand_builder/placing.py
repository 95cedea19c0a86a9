"""Places the vertices on the implicit surface: by rays from the bones, then by even spacing."""

from collections.abc import Callable
from functools import partial

import numpy as np

from tools.hand_builder.anatomy import (
    ACROSS,
    CHAINS,
    THUMB,
    UP,
    Digit,
    FloatArray,
    digits,
    hand_distance,
    skeleton,
)
from tools.hand_builder.topology import ROWS, HandTopology

DistanceField = Callable[[FloatArray], FloatArray]

DOWN, RADIAL = -UP, np.array([0.0, 0.0, 1.0])
REACH, STEP = 60.0, 0.4
"""Length of a ray and distance between its samples, mm."""

FINGER_Q = {
    11: (0.70, 0.87, 1.0, 1.15, 1.45, 1.82, 2.0, 2.2, 2.55, 2.80, 2.945),
    12: (0.66, 0.80, 0.90, 1.0, 1.13, 1.45, 1.82, 2.0, 2.2, 2.55, 2.80, 2.945),
}
"""Positions q of a finger's rings (see `Digit`), by their number; they are denser at joints."""
THUMB_Q = (0.93, 1.08, 1.27, 1.55, 1.83, 2.0, 2.17, 2.42, 2.68, 2.86, 2.96)
THUMB_SHEAR = (0.42, 0.36, 0.25, 0.12, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Tilt of each ring of the thumb, in q: its side at the web lies farther towards the tip."""
KNUCKLES = 2
"""Row of the palm over the knuckles."""
WEB_Q, WEB_DIP = 0.5, 0.06
"""Place of the web line along the first phalanx, and how much it falls back between two fingers."""


def place_vertices(topology: HandTopology) -> FloatArray:
    """Vertices (V, 3) of the whole hand in the rest pose, mm, wrist joint at the origin."""
    bones = skeleton()
    tubes = digits(bones)
    surface = partial(hand_distance, bones=bones, tubes=tubes)
    verts = np.zeros((topology.count, 3))
    _place_palm(topology, verts, bones, tubes, surface)
    for place_index, finger in enumerate((*ACROSS, THUMB)):
        _place_digit(topology, verts, place_index, tubes[finger])
    return _even_out(topology, verts, surface)


def _exit(distance: DistanceField, origins: FloatArray, directions: FloatArray) -> FloatArray:
    """First point of each ray outside of the solid; its origin if that is outside."""
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    reach = np.arange(0.0, REACH, STEP)
    samples = origins[:, None] + reach[:, None] * directions[:, None]
    values = distance(samples.reshape(-1, 3)).reshape(len(origins), -1)
    outside = values > 0
    first = np.where(outside.any(1), outside.argmax(1), len(reach) - 1)
    row = np.arange(len(origins))
    low, high = values[row, np.maximum(first - 1, 0)], values[row, first]
    part = np.where(first > 0, low / np.minimum(low - high, -1e-9), 0.0)
    return origins + ((np.maximum(first - 1, 0) + part) * STEP)[:, None] * directions


def _row_centres(bones: FloatArray, tubes: tuple[Digit, ...]) -> FloatArray:
    """Middle of the palm under each finger, (1 + ROWS, 4, 3), row by row."""
    knuckles = np.stack([bones[CHAINS[f][0]] for f in ACROSS])
    web = np.stack([tubes[f].centre(WEB_Q) for f in ACROSS])
    wrist = np.stack([[0.0, -1.5, z] for z in (15.0, 5.0, -6.5, -16.5)])
    arm = wrist + [28.0, 0.0, 0.0]
    along = [0.0, 0.52, 1.0, 1.09, 1.2, 1.325, 1.45, 1.575, 1.7, 1.82, 1.92, 2.1, 2.5, 3.0]
    along = np.array(along)
    assert len(along) == 1 + ROWS, "one place along the palm per row"
    keys = np.stack([web, knuckles, wrist, arm])
    low = np.minimum(along.astype(int), 2)
    part = (along - low)[:, None, None]
    return keys[low] * (1 - part) + keys[low + 1] * part


def _place_palm(
    topology: HandTopology,
    verts: FloatArray,
    bones: FloatArray,
    tubes: tuple[Digit, ...],
    surface: DistanceField,
) -> None:
    """Places back, palm, sides, webs and cap by rays up, down and sideways from the middle."""
    centres = _row_centres(bones, tubes)
    between = 0.5 * (centres[:, 1:] + centres[:, :-1])
    between[0] = _between(tubes, WEB_Q - WEB_DIP)
    edge = np.stack([centres[:, 0], centres[:, -1]], 1)
    mid = np.zeros((1 + ROWS, 9, 3))
    mid[:, 1::2], mid[:, 2:-1:2] = centres, between
    mid[:, 0], mid[:, 8] = edge[:, 0] + 4 * RADIAL, edge[:, 1] - 4 * RADIAL
    fan = np.zeros((9, 3))
    fan[0], fan[8] = RADIAL, -RADIAL
    # rays in the palm must not stop at the thumb
    hand = partial(hand_distance, bones=bones, tubes=tuple(tubes[finger] for finger in ACROSS))
    for rows, way in ((topology.dorsal, UP), (topology.palmar, DOWN)):
        ways = np.tile(way + fan, (1 + ROWS, 1, 1))
        ways[0, 2:-1:2, 0] -= 0.4  # towards the crest of the web
        hit = _exit(hand, mid.reshape(-1, 3), ways.reshape(-1, 3))
        verts[rows.ravel()] = hit
    for column, way in ((0, RADIAL), (1, -RADIAL)):
        rows = topology.side[:, column] >= 0
        origin = edge[rows, column]
        verts[topology.side[rows, column]] = _exit(hand, origin, np.tile(way, (len(origin), 1)))
    start, end = (_between(tubes, q) for q in (0.9, 0.0))
    # where the rays enter the hand
    verts[topology.webs] = _exit(lambda points: -surface(points), start, end - start)
    _round_cap(topology, verts)


def _between(tubes: tuple[Digit, ...], q: float) -> FloatArray:
    """Points (3, 3) halfway between neighbouring fingers' axes."""
    axis = np.stack([tubes[finger].centre(q) for finger in ACROSS])
    return 0.5 * (axis[1:] + axis[:-1])


def _round_cap(topology: HandTopology, verts: FloatArray) -> None:
    """Narrows the last row, so that the forearm ends round, and places the middle of the cap."""
    last = np.r_[topology.dorsal[ROWS], topology.palmar[ROWS], topology.side[ROWS]]
    before = np.r_[topology.dorsal[ROWS - 1], topology.palmar[ROWS - 1], topology.side[ROWS - 1]]
    middle = verts[last].mean(0)
    verts[last] = 0.8 * (verts[last] - middle) + middle
    verts[last, 0] = verts[before, 0].mean() + 7.0
    verts[topology.cap] = verts[last].mean(0) + [1.0, 0.0, 0.0]


def _place_digit(topology: HandTopology, verts: FloatArray, place_index: int, tube: Digit) -> None:
    """Places the rings of one digit and its tip."""
    thumb = place_index == 4
    ring = topology.rings[place_index]
    count = ring.shape[1]
    sides = np.arange(count) * 2 * np.pi / count
    if thumb:
        places, shear = THUMB_Q, THUMB_SHEAR
    else:
        places, shear = FINGER_Q[len(ring) - 1], np.zeros(len(ring) - 1)
    for row, (q, lean) in enumerate(zip(places, shear, strict=True), start=1):
        at = q + lean * np.cos(sides) if thumb else np.full(count, q)
        origins = np.stack([tube.centre(x) for x in at])
        ways = np.stack(
            [_ring_direction(tube.frame(x), side, thumb) for x, side in zip(at, sides, strict=True)]
        )
        verts[ring[row]] = _exit(tube.distance, origins, ways)
    verts[topology.tips[place_index]] = tube.points[3]


def _ring_direction(frame: FloatArray, side: float, thumb: bool) -> FloatArray:
    """Direction of a ring vertex from the axis.

    Angles start at the back of a finger and grow towards the pinky; those of the thumb start at the
    web and grow towards the palm.
    """
    if not thumb:
        side = side - np.pi / 4
        return np.cos(side) * frame[:, 1] - np.sin(side) * frame[:, 2] * np.sign(frame[2, 2])
    tangent = frame[:, 0]
    web = np.cross(tangent, UP)
    web /= np.linalg.norm(web)
    web *= -np.sign(web[2])
    return (
        np.cos(side) * web
        + np.sin(side) * np.cross(web, tangent) * np.sign(np.cross(web, tangent)[1]) * -1
    )


def _even_out(topology: HandTopology, verts: FloatArray, surface: DistanceField) -> FloatArray:
    """Moves palm, finger bases and thumb base along the surface until they are evenly spaced."""
    free = np.zeros(topology.count, dtype=bool)
    free[topology.dorsal[1:-2]] = free[topology.palmar[1:-2]] = True
    free[topology.side[1:-2][topology.side[1:-2] >= 0]] = True
    # The joint regressor needs vertices straight above and below the knuckles.
    free[topology.dorsal[KNUCKLES, 1::2]] = free[topology.palmar[KNUCKLES, 1::2]] = False
    for ring in topology.rings[:4]:
        free[ring[1]] = True
    free[topology.rings[4][1:5]] = True
    total = np.zeros((topology.count, topology.count))
    a, b = topology.edges.T
    total[a, b] = total[b, a] = 1.0
    total /= total.sum(1, keepdims=True)
    verts = verts.copy()
    for _ in range(16):
        move = (total @ verts - verts)[free]
        slope = _gradient(surface, verts[free])
        move -= slope * (move * slope).sum(1, keepdims=True)
        verts[free] += 0.5 * move
        verts[free] -= surface(verts[free])[:, None] * _gradient(surface, verts[free])
    return verts


def _gradient(distance: DistanceField, points: FloatArray) -> FloatArray:
    """Unit outward direction (P, 3) by central differences."""
    shift = 0.05 * np.eye(3)  # mm
    slope = np.stack([distance(points + s) - distance(points - s) for s in shift], -1)
    return slope / np.linalg.norm(slope, axis=-1, keepdims=True)
