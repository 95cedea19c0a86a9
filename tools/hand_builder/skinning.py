"""Skinning weights, and the regressor that gives joints from vertices."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

from tools.hand_builder.anatomy import ACROSS, CHAINS, THUMB, Digit, FloatArray, smoothstep
from tools.hand_builder.topology import HandTopology

Mask = NDArray[np.bool_]

MOST_JOINTS = 4
HALF_BLEND = (7.0, 5.5)
"""Half of the length over which the weights go from one phalanx to the next, mm: at the middle and
at the distal joint."""
SHARPNESS = 1.6
"""Exponent that sharpens the harmonic weights, so that no digit moves another's knuckle."""
KNUCKLE_ROW = 5
"""First palm row that follows the wrist alone."""
THUMB_FREE_ROW = 3
"""First ring of the thumb that follows the thumb alone."""


def skin_weights(topology: HandTopology, verts: FloatArray, tubes: tuple[Digit, ...]) -> FloatArray:
    """Weights (V, 16): harmonic between vertices of a single digit and those of the palm."""
    labels = _harmonic(topology, *_seeds(topology)) ** SHARPNESS
    labels /= labels.sum(1, keepdims=True)
    weights = np.zeros((topology.count, 16))
    weights[:, 0] = labels[:, 5]
    for finger, chain in enumerate(CHAINS):
        shares = _shares(verts, tubes[finger])
        weights[:, chain[:3]] = labels[:, finger, None] * shares
    return _sparse(weights)


def _seeds(topology: HandTopology) -> tuple[Mask, FloatArray]:
    """Known rows of (V, 6): five digits (in the order of CHAINS), then the palm."""
    label = np.full(topology.count, -1)
    for place, finger in enumerate((*ACROSS, THUMB)):
        start = THUMB_FREE_ROW if finger == THUMB else 1
        label[topology.rings[place][start:]] = finger
        label[topology.tips[place]] = finger
    label[topology.dorsal[KNUCKLE_ROW:, 2:]] = 5
    label[topology.palmar[KNUCKLE_ROW:, 4:]] = 5
    label[topology.palmar[KNUCKLE_ROW, 2:]] = 5
    label[topology.side[KNUCKLE_ROW:, 1]] = 5
    # between index and thumb the palm stays, or each would move the other's root
    for rows in (topology.dorsal, topology.palmar, topology.side):
        label[rows[KNUCKLE_ROW - 1, :1]] = 5
        last = rows[11:]
        label[last[last >= 0]] = 5
    label[topology.cap] = 5
    known = label >= 0
    return known, np.eye(6)[label] * known[:, None]


def _harmonic(topology: HandTopology, known: Mask, values: FloatArray) -> FloatArray:
    """The unknown rows filled so that each is the mean of its neighbours."""
    a, b = topology.edges.T
    links = coo_matrix((np.ones(len(a)), (a, b)), shape=(topology.count, topology.count))
    links = (links + links.T).tocsr()
    laplace = (diags(np.asarray(links.sum(1)).ravel()) - links).tocsr()
    filled = values.copy()
    right = -laplace[~known][:, known] @ values[known]
    filled[~known] = spsolve(laplace[~known][:, ~known].tocsc(), right)
    return filled


def _shares(verts: FloatArray, tube: Digit) -> FloatArray:
    """How the three phalanges of one digit share each vertex, (V, 3)."""
    steps = np.diff(tube.points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    shares = np.ones((len(verts), 3))
    for joint, half in zip((1, 2), HALF_BLEND, strict=True):
        before, after = steps[joint - 1] / lengths[joint - 1], steps[joint] / lengths[joint]
        along = (verts - tube.points[joint]) @ (before + after) / np.linalg.norm(before + after)
        past = smoothstep(0.5 + along / (2 * half))
        shares[:, joint] = shares[:, joint - 1] * past
        shares[:, joint - 1] *= 1 - past
    return shares


def _sparse(weights: FloatArray) -> FloatArray:
    """At most `MOST_JOINTS` joints a vertex, rows that sum to one."""
    weights = np.where(weights < 1e-3, 0.0, weights)
    smallest = np.argsort(-weights, axis=1)[:, MOST_JOINTS:]
    np.put_along_axis(weights, smallest, 0.0, axis=1)
    return weights / weights.sum(1, keepdims=True)


def joint_regressor(
    verts: FloatArray, joints: FloatArray, dirs: FloatArray, joint_dirs: FloatArray, near: int = 72
) -> FloatArray:
    """Sparse convex combinations (16, V) of vertices round each joint that give its position.

    They hold for the template (V, 3) and for each shape direction (V, 3, S) at once.
    """
    rows = np.zeros((16, len(verts)))
    for joint in range(16):
        close = np.argsort(np.linalg.norm(verts - joints[joint], axis=1))[:near]
        a = np.concatenate([(verts[close] - joints[joint]).T, dirs[close].reshape(near, -1).T])
        b = np.r_[np.zeros(3), joint_dirs[joint].ravel()]
        # The last row makes the weights sum to one; it outweighs the fit, which is exact anyway.
        a, b = np.vstack([a, np.full(near, 100.0)]), np.r_[b, 100.0]
        solution, _ = nnls(a, b)
        rows[joint, close] = solution / solution.sum()
    return rows
