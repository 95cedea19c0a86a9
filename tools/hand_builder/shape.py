"""The shape space: ten directions that move surface and skeleton together.

One unit of a beta is one standard deviation over adults and children, roughly, from the spread of
hand lengths and breadths in published anthropometry. The directions are linear, and all but the
thickness move the skeleton, independently of each other, so that joints determine the betas.

| beta | direction | one unit |
|---|---|---|
| 0 | overall size | 8 % |
| 1 | thickness of fingers and palm | 7 % |
| 2 | palm width, knuckles further apart | 6 % |
| 3 | the four fingers longer, their metacarpals shorter | 3 % each |
| 4 | thumb rooted further out: wrist to the thumb's first joint | 6 % |
| 5 | thumb length, its three bones | 5 % |
| 6 | index finger with its metacarpal | 3 % |
| 7 | ring finger with its metacarpal | 3 % |
| 8 | little finger with its metacarpal | 4 % |
| 9 | thumb spread, turned away from the index about its base | 6 degrees |
"""

from itertools import pairwise

import numpy as np

from tools.hand_builder.anatomy import ACROSS, BONE_PARENTS, CHAINS, THUMB, FloatArray

SIZE, THICKNESS, WIDTH = 0.08, 0.07, 0.06
FINGERS, THUMB_ROOT, THUMB_LENGTH = 0.03, 0.06, 0.05
RAYS = ((0, 0.03), (3, 0.03), (2, 0.04))
"""Finger (index into CHAINS) and change of its whole ray: index, ring, pinky."""
SPREAD = np.radians(6.0)
PALM_ENDS = (-0.4, 1.3)
"""Range along a metacarpal in which the skin stretches with it, a little beyond both ends, so that
the joints there stay centred; 0 and 1 are the ends."""
BONE_ENDS = (-0.3, 1.3)
"""The same range along phalanges."""
LATERAL = 6.5
"""Distance sideways over which the skin follows a metacarpal, mm."""


def shape_directions(
    verts: FloatArray, weights: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Displacement of vertices (V, 3, 10) and of joints and tips (21, 3, 10), mm per unit.

    Args:
        verts: rest vertices with the wrist at the origin.
        weights: skinning weights (V, 16).
        points: the 16 joints and 5 tips.
    """
    body = _StretchableHand(verts, weights, points)
    fields = [
        (SIZE * verts, SIZE * points),
        (THICKNESS * body.girth(), np.zeros_like(points)),
        body.widened(),
        body.stretched(dict.fromkeys(ACROSS, -FINGERS), dict.fromkeys(ACROSS, FINGERS)),
        body.stretched({THUMB: THUMB_ROOT}, {}),
        body.stretched({}, {THUMB: THUMB_LENGTH}),
        *(body.stretched({finger: part}, {finger: part}) for finger, part in RAYS),
        body.spread(),
    ]
    moved, joints = zip(*fields, strict=True)
    return np.stack(moved, axis=-1), np.stack(joints, axis=-1)


class _StretchableHand:
    """A skinned rest hand that can be stretched bone by bone."""

    def __init__(self, verts: FloatArray, weights: FloatArray, points: FloatArray) -> None:
        self.verts, self.weights, self.points = verts, weights, points
        self.offsets = points[1:] - points[list(BONE_PARENTS)]
        roots = np.stack([points[chain[0]] for chain in CHAINS])
        self.along = np.clip(verts @ roots.T / (roots**2).sum(1), *PALM_ENDS)
        gap = np.linalg.norm(verts[:, None] - self.along[..., None] * roots, axis=-1)
        near = np.exp(
            -0.5 * (gap / LATERAL) ** 2 + 0.5 * (gap.min(1, keepdims=True) / LATERAL) ** 2
        )
        self.near = near / near.sum(1, keepdims=True)
        """Weight of each metacarpal (V, 5) at each vertex of the palm."""

    def girth(self) -> FloatArray:
        """Offset of each vertex from its bone, which a change of thickness scales."""
        total = np.zeros_like(self.verts)
        for joint, child in self._finger_bones():
            _, rest = self._beside(joint, child)
            total += self.weights[:, joint, None] * rest
        roots = np.stack([self.points[chain[0]] for chain in CHAINS])
        axis = ((self.near * self.along)[..., None] * roots).sum(1)
        palm = (self.verts - axis) * [0.0, 1.0, 1.0]
        return total + self.weights[:, :1] * palm

    def widened(self) -> tuple[FloatArray, FloatArray]:
        """The palm scaled sideways; digits follow unchanged."""
        moved = self._with_digits(WIDTH * self.points * [0.0, 0.0, 1.0])
        palm = WIDTH * self.verts * [0.0, 0.0, 1.0]
        return self._blend(palm, moved), moved

    def stretched(
        self, metacarpals: dict[int, float], phalanges: dict[int, float]
    ) -> tuple[FloatArray, FloatArray]:
        """Bones longer by the given parts of their length."""
        change = np.zeros_like(self.offsets)
        for finger, part in metacarpals.items():
            change[CHAINS[finger][0] - 1] = part * self.offsets[CHAINS[finger][0] - 1]
        for finger, part in phalanges.items():
            for child in CHAINS[finger][1:]:
                change[child - 1] = part * self.offsets[child - 1]
        moved = np.zeros_like(self.points)
        for child, parent in enumerate(BONE_PARENTS, start=1):
            moved[child] = moved[parent] + change[child - 1]
        roots = np.stack([change[chain[0] - 1] for chain in CHAINS])
        palm = (self.near * self.along) @ roots
        return self._blend(palm, moved), moved

    def spread(self) -> tuple[FloatArray, FloatArray]:
        """The thumb turned about its base, in the plane of the palm, away from the index."""
        base = self.points[CHAINS[THUMB][0]]
        axis = SPREAD * np.array([0.0, 1.0, 0.0])
        moved = np.zeros_like(self.points)
        bones = list(CHAINS[THUMB])
        moved[bones] = np.cross(axis, self.points[bones] - base)
        share = self.weights[:, list(CHAINS[THUMB][:3])].sum(1, keepdims=True)
        return share * np.cross(axis, self.verts - base), moved

    def _finger_bones(self) -> list[tuple[int, int]]:
        return [pair for chain in CHAINS for pair in pairwise(chain)]

    def _beside(self, joint: int, child: int) -> tuple[FloatArray, FloatArray]:
        """Place along a bone, 0 to 1, and the offset from it, per vertex."""
        step = self.points[child] - self.points[joint]
        away = self.verts - self.points[joint]
        along = away @ step / (step @ step)
        return np.clip(along, *BONE_ENDS), away - along[:, None] * step

    def _with_digits(self, moved: FloatArray) -> FloatArray:
        """Each digit follows its first joint."""
        followed = moved.copy()
        for chain in CHAINS:
            followed[list(chain)] = moved[chain[0]]
        return followed

    def _blend(self, palm: FloatArray, moved: FloatArray) -> FloatArray:
        """Skinned sum of the palm's own displacement and of stretching bones."""
        total = self.weights[:, :1] * palm
        for joint, child in self._finger_bones():
            along, _ = self._beside(joint, child)
            bone = moved[joint] + along[:, None] * (moved[child] - moved[joint])
            total += self.weights[:, joint, None] * bone
        return total
