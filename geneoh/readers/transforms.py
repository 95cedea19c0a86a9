"""Rotations and rigid motions of data sets, float64 in numpy; frames of NaN stay NaN."""

from collections.abc import Callable

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from geneoh.errors import InputError
from geneoh.geometry.rotations import is_rotation
from geneoh.readers.records import IN_RADIANS, Array, Record

SINGULAR = 1e-12
"""Determinant below which a matrix counts as singular."""
BOTTOM_ROW_TOLERANCE = 1e-4
"""Largest deviation of the last row of a pose from 0 0 0 1, in any entry."""
LARGEST_QUATERNION = 1e6  # sum of absolute values beyond which it is no rotation


def rigid_matrices(rotation: Array, translation: Array) -> Array:
    """(..., 4, 4) from (..., 3, 3) and (..., 3)."""
    result = np.tile(np.eye(4), (*rotation.shape[:-2], 1, 1))
    result[..., :3, :3], result[..., :3, 3] = rotation, translation
    return result


def refuse_bottom_row(where: str, name: str, poses: Array, known: Array | None = None) -> None:
    """Refuse (T, ..., 4, 4) poses whose last row is not 0 0 0 1; NaN and unknown frames pass."""
    wrong = np.abs(poses[..., 3, :] - [0.0, 0.0, 0.0, 1.0]).max(-1) > BOTTOM_ROW_TOLERANCE
    wrong &= ~np.isnan(poses).any((-1, -2))
    if known is not None:
        wrong[~known] = False
    if wrong.any():
        first = tuple(np.argwhere(wrong)[0])
        cure = "transpose them if their translation is there"
        if not poses[first].any():
            cure = "write NaN in frames without a pose"
        raise InputError(
            f"{where}: {name} must have 0 0 0 1 as last row, got {poses[first][3].tolist()} in "
            f"frame {first[0]}; {cure}"
        )


def refuse_other_matrices(record: Record, name: str, matrices: Array) -> None:
    """Refuse (T, ..., 3, 3) matrices that are no rotations; those of NaN or zeros are missing."""
    present = np.isfinite(matrices).all((-1, -2)) & matrices.any((-1, -2))
    wrong = np.argwhere(present & ~is_rotation(torch.from_numpy(matrices)).numpy())
    if len(wrong):
        first = tuple(wrong[0])
        raise InputError(
            f"{record.where}: '{name}' must be rotation matrices with R^T R = I and determinant 1, "
            f"got {np.round(matrices[first], 3).tolist()} in row {first[0]}; {record.remedy}"
        )


def read_turns(record: Record, name: str, *counts: int, remedy: str = "") -> Array:
    """(T, J, 3) axis-angle, or (T, J, 3, 3) matrices after a check; J is one of `counts`."""
    shapes = [s for n in counts for s in (("T", 3 * n), ("T", n, 3), ("T", n, 3, 3))]
    shapes += [("T", 3, 3)] * (counts == (1,))
    turns = record.array(name, *shapes, unit=IN_RADIANS, remedy=remedy)
    if counts == (1,) and turns.shape[1:] == (3, 3):
        turns = turns[:, None]
    if turns.ndim < 4:
        return turns.reshape(len(turns), -1, 3)
    refuse_other_matrices(record, name, turns)
    return turns


def converted(
    values: Array, usable: Array, convert: Callable[[Array], Array], *shape: int
) -> Array:
    """(..., *shape) results of `convert` for the usable values; NaN for the others."""
    result = np.full((*usable.shape, *shape), np.nan)
    if usable.any():
        result[usable] = convert(values[usable])
    return result


def rotation_matrices(vectors: Array) -> Array:
    """(..., 3, 3) rotations of (..., 3) axis-angle vectors."""
    finite = np.asarray(np.isfinite(vectors).all(-1))
    return converted(vectors, finite, lambda v: Rotation.from_rotvec(v).as_matrix(), 3, 3)


def axis_angles(rotations: Array) -> Array:
    """(..., 3) axis-angle vectors of (..., 3, 3) matrices; NaN for what is no rotation."""
    proper = is_rotation(torch.from_numpy(rotations)).numpy()
    return converted(rotations, proper, lambda m: Rotation.from_matrix(m).as_rotvec(), 3)


def are_rotations(quaternions: Array) -> Array:
    """(...) whether (..., 4) quaternions of any norm and order are neither zero nor infinite."""
    size = np.abs(quaternions).sum(-1)
    return (size > 0.1) & (size < LARGEST_QUATERNION)


def axis_angles_of_wxyz(quaternions: Array) -> Array:
    """(..., 3) axis-angle vectors of (..., 4) quaternions wxyz; NaN for what is no rotation."""
    xyzw, usable = np.roll(quaternions, -1, axis=-1), are_rotations(quaternions)
    return converted(xyzw, usable, lambda q: Rotation.from_quat(q).as_rotvec(), 3)


def rigid_of_xyzw(poses: Array) -> Array:
    """(..., 4, 4) from (..., 7) quaternions xyzw and translations; NaN for what is no rotation."""

    def matrices(found: Array) -> Array:
        return rigid_matrices(Rotation.from_quat(found[:, :4]).as_matrix(), found[:, 4:])

    usable = np.isfinite(poses).all(-1) & are_rotations(poses[..., :4])
    return converted(poses, usable, matrices, 4, 4)


def inverse(matrices: Array, where: str) -> Array:
    """(..., 4, 4) inverses of (..., 4, 4) transformations; `InputError` where one has none."""
    sound = bool(np.isfinite(matrices).all())
    if not sound or (np.abs(np.linalg.det(matrices)) < SINGULAR).any():
        raise InputError(f"{where}: expected a camera's pose that can be inverted; copy it again")
    return np.linalg.inv(matrices)


def moved_points(points: Array, frame: Array) -> Array:
    """(..., P, 3) points transformed by (..., 4, 4) matrices, or all of them by one (4, 4)."""
    return points @ frame[..., :3, :3].swapaxes(-1, -2) + frame[..., None, :3, 3]
