"""Pose correctives: restore the volume that linear blend skinning loses outside a bent joint.

Blending two rotations linearly pulls the skin over a knuckle inwards, 3 mm on a finger bent by 100
degrees. Blending the angle instead keeps it round. The difference, taken on the outer side only
(the inner side should give way), is regressed on the entries of the joint's rotation, which is what
`posedirs` are in MANO.
"""

from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from geneoh.hand.skeleton import PARENTS
from tools.hand_builder.anatomy import CHAINS, THUMB, Digit, FloatArray, smoothstep
from tools.hand_builder.limits import FLEX, SPREAD, rotation_vector

THUMB_BENDS = ((-20, 35), (-10, 65), (-15, 80))
"""Degrees of flexion over which the thumb's correctives are fitted."""
RIDGE = 1e-2
LEAST = 0.02
"""Displacements below this are set to zero, mm."""
STRENGTH = (0.35, 0.6, 0.6)
"""Share of the correction at knuckles, middle and distal joints: all of it makes joints pointed."""


def pose_directions(verts: FloatArray, weights: FloatArray, tubes: tuple[Digit, ...]) -> FloatArray:
    """Displacement (V, 3, 135), mm per unit of each entry of (rotation minus identity)."""
    dirs = np.zeros((len(verts), 3, 15, 9))
    for finger, chain in enumerate(CHAINS):
        for place, joint in enumerate(chain[:3]):
            # weight of the joint relative to its parent: only those two are blended here
            both = weights[:, joint] + weights[:, PARENTS[joint]]
            share = np.divide(weights[:, joint], both, out=np.zeros(len(verts)), where=both > 0)
            touched = (share > 0.01) & (share < 0.99)
            fitted = _joint_directions(
                verts[touched], share[touched], tubes[finger], place, _bends(finger, place)
            )
            dirs[touched, :, joint - 1] = STRENGTH[place] * both[touched, None, None] * fitted
    dirs[np.linalg.norm(dirs, axis=(1, 3)).max(-1) < LEAST] = 0.0
    return dirs.reshape(len(verts), 3, 135)


def _bends(finger: int, place: int) -> list[tuple[float, float, float]]:
    """Flexion, spread and twist in degrees over which one joint is fitted."""
    low, high = THUMB_BENDS[place] if finger == THUMB else FLEX[finger][place]
    aside = SPREAD.get(finger, (-20, 20)) if place == 0 else (-5, 5)
    return list(product(np.linspace(low, high, 9), np.linspace(*aside, 3), (-10.0, 0.0, 10.0)))


def _joint_directions(
    verts: FloatArray,
    share: FloatArray,
    tube: Digit,
    place: int,
    bends: list[tuple[float, float, float]],
) -> FloatArray:
    """Least-squares directions (P, 3, 9) of the vertices round one joint."""
    away = verts - tube.points[place]
    outer = _outer(away, tube, place)
    features, wanted = [], []
    for bend in bends:
        vector = rotation_vector(tube, place, *bend)
        matrix = Rotation.from_rotvec(vector).as_matrix()
        blend = np.eye(3) + share[:, None, None] * (matrix - np.eye(3))
        round_ = Rotation.from_rotvec(share[:, None] * vector).as_matrix()
        target = (round_ @ away[..., None])[..., 0]
        lost = np.linalg.solve(blend, target[..., None])[..., 0] - away
        features.append((matrix - np.eye(3)).ravel())
        wanted.append(outer[:, None] * lost)
    a = np.stack(features)
    solution = np.linalg.solve(
        a.T @ a + RIDGE * len(a) * np.eye(9), a.T @ np.stack(wanted).reshape(len(a), -1)
    )
    return np.moveaxis(solution.reshape(9, -1, 3), 0, -1)


def _outer(away: FloatArray, tube: Digit, place: int) -> FloatArray:
    """1 on the back of a joint, 0 on the side that closes."""
    up = tube.frame(float(place))[:, 1]
    height = away @ up / np.maximum(np.linalg.norm(away, axis=1), 1e-9)
    return smoothstep(0.5 + 0.75 * height)
