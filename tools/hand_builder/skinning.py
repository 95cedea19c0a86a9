"""Which bone moves which vertex, and how the surface corrects itself when a joint bends."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

from tools.hand_builder.anatomy import ACROSS, CHAINS, THUMB, Array, Digit
from tools.hand_builder.topology import Layout

Mask = NDArray[np.bool_]

MOST_JOINTS = 4
HALF_BLEND = (7.0, 5.5)
"""Half the length over which two phalanges share the skin, mm: middle joint, distal joint."""
SHARPNESS = 1.6
"""Harmonic weights spread far: a power keeps a digit from pulling at its neighbour's knuckle."""
KNUCKLE_ROW = 5
"""Palm rows from here on belong to the wrist's bone."""
THUMB_FREE_ROW = 3
"""Rings of the thumb from here on follow the thumb alone."""


def skin_weights(plan: Layout, verts: Array, tubes: tuple[Digit, ...]) -> Array:
    """Weights (V, 16): harmonic between what surely belongs to a digit and what to the palm."""
    labels = _harmonic(plan, *_seeds(plan)) ** SHARPNESS
    labels /= labels.sum(1, keepdims=True)
    weights = np.zeros((plan.count, 16))
    weights[:, 0] = labels[:, 5]
    for finger, chain in enumerate(CHAINS):
        shares = _shares(verts, tubes[finger])
        weights[:, chain[:3]] = labels[:, finger, None] * shares
    return _sparse(weights)


def _seeds(plan: Layout) -> tuple[Mask, Array]:
    """Known rows of (V, 6): five digits (in the order of CHAINS), then the palm."""
    label = np.full(plan.count, -1)
    for place, finger in enumerate((*ACROSS, THUMB)):
        start = THUMB_FREE_ROW if finger == THUMB else 1
        label[plan.rings[place][start:]] = finger
        label[plan.tips[place]] = finger
    label[plan.dorsal[KNUCKLE_ROW:, 2:]] = 5
    label[plan.palmar[KNUCKLE_ROW:, 4:]] = 5
    label[plan.palmar[KNUCKLE_ROW, 2:]] = 5
    label[plan.side[KNUCKLE_ROW:, 1]] = 5
    # Between index and thumb the palm holds still, or each would pull at the other's root.
    for rows in (plan.dorsal, plan.palmar, plan.side):
        label[rows[KNUCKLE_ROW - 1, :1]] = 5
        last = rows[11:]
        label[last[last >= 0]] = 5
    label[plan.cap] = 5
    known = label >= 0
    return known, np.eye(6)[label] * known[:, None]


def _harmonic(plan: Layout, known: Mask, values: Array) -> Array:
    """Fill the unknown rows so that each is the mean of its neighbours."""
    a, b = plan.edges.T
    links = coo_matrix((np.ones(len(a)), (a, b)), shape=(plan.count, plan.count))
    links = (links + links.T).tocsr()
    laplace = (diags(np.asarray(links.sum(1)).ravel()) - links).tocsr()
    filled = values.copy()
    right = -laplace[~known][:, known] @ values[known]
    filled[~known] = spsolve(laplace[~known][:, ~known].tocsc(), right)
    return filled


def _shares(verts: Array, tube: Digit) -> Array:
    """How the three phalanges of one digit share each vertex, (V, 3)."""
    steps = np.diff(tube.points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    shares = np.ones((len(verts), 3))
    for joint, half in zip((1, 2), HALF_BLEND, strict=True):
        before, after = steps[joint - 1] / lengths[joint - 1], steps[joint] / lengths[joint]
        along = (verts - tube.points[joint]) @ (before + after) / np.linalg.norm(before + after)
        past = _smoothstep(0.5 + along / (2 * half))
        shares[:, joint] = shares[:, joint - 1] * past
        shares[:, joint - 1] *= 1 - past
    return shares


def _smoothstep(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def _sparse(weights: Array) -> Array:
    """At most `MOST_JOINTS` joints a vertex, rows that sum to one."""
    weights = np.where(weights < 1e-3, 0.0, weights)
    smallest = np.argsort(-weights, axis=1)[:, MOST_JOINTS:]
    np.put_along_axis(weights, smallest, 0.0, axis=1)
    return weights / weights.sum(1, keepdims=True)


def joint_regressor(
    verts: Array, joints: Array, dirs: Array, joint_dirs: Array, near: int = 72
) -> Array:
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
