"""The object's motion out of the fields of an npz."""

import numpy as np
import torch

from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.npz_layouts import OBJECT_FIELDS, quoted
from geneoh.readers.records import Array, Record, float32
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack

MOTION_MISSING = (
    "neither; add them, for an object that does not move the identity and zeros in every frame, "
    "or give --object-pose POSES.npy"
)


def read_object(record: Record, meshes: tuple[Mesh, ...], frames: int) -> ObjectTrack:
    """The object's motion, from rotation and translation or from 4x4 matrices.

    A file without motion, for which no mesh is given, is of a hand alone: nothing moves.

    Raises:
        InputError: no motion, two of them, or one that is not rigid.
    """
    pair = [name for name in OBJECT_FIELDS[:2] if name in record]
    if not (pair or meshes or "obj_pose" in record):
        return ObjectTrack.resting((), frames)
    if ("obj_pose" in record) == bool(pair):
        raise InputError(
            f"{record.where}: the object's motion must be given once, as 'object_rotation' with "
            f"'object_translation' or as 'obj_pose', got "
            + (f"{quoted(pair)} and 'obj_pose'; remove one of them" if pair else MOTION_MISSING)
        )
    if "obj_pose" in record:
        matrix = record.array("obj_pose", ("T", 4, 4), ("T", "Q", 4, 4), unit="object to world")
        matrix = matrix if matrix.ndim == 4 else matrix[:, None]
        refuse_bottom_row(record, matrix)
        rotation, translation = matrix[..., :3, :3], matrix[..., :3, 3]
        return observed_object(record, meshes, rotation, translation)
    if len(pair) == 1:
        other = next(name for name in OBJECT_FIELDS[:2] if name != pair[0])
        raise InputError(f"{record.where}: '{pair[0]}' needs '{other}', got none; add it")
    rotation = record.array(
        "object_rotation",
        *(("T", "Q", 3, 3), ("T", 3, 3)),
        unit="as matrices",
        remedy="turn axis-angle or quaternions into matrices",
    )
    translation = record.array("object_translation", ("T", "Q", 3), ("T", 3), unit="in metres")
    record.refuse_lengths(*pair)
    rotation = rotation if rotation.ndim == 4 else rotation[:, None]
    translation = translation if translation.ndim == 3 else translation[:, None]
    if rotation.shape[1] != translation.shape[1]:
        raise InputError(
            f"{record.where}: rotation and translation must have the same number of parts, got "
            f"{rotation.shape[1]} in 'object_rotation' and {translation.shape[1]} in "
            "'object_translation'; give one of each per part"
        )
    return observed_object(record, meshes, rotation, translation)


def observed_object(
    record: Record, meshes: tuple[Mesh, ...], rotation: Array, translation: Array
) -> ObjectTrack:
    """The track with poses that are NaN, or not in `object_valid`, marked and filled."""
    frames, parts = translation.shape[:2]
    seen = record.optional_array("object_valid", ("T", "Q"), ("T",))
    if seen is not None and len(seen) != frames:
        raise record.refuse("object_valid", f"{frames} frames", "give one for each pose")
    if seen is not None:
        seen = np.broadcast_to(seen.reshape(frames, -1) > 0, (frames, parts))
        seen = torch.from_numpy(np.array(seen))
    return fill_object(ObjectTrack(meshes, float32(rotation), float32(translation)), seen)


def refuse_bottom_row(record: Record, matrix: Array) -> None:
    """Refuse (T, Q, 4, 4) matrices that do not act on column vectors."""
    rows = matrix[..., 3, :][~np.isnan(matrix).any((-1, -2))]
    if not np.allclose(rows, [0.0, 0.0, 0.0, 1.0], atol=1e-4):
        row = matrix[0, 0, 3].tolist()
        raise InputError(
            f"{record.where}: 'obj_pose' must have 0 0 0 1 as its last row, got {row} in the first "
            "frame; transpose it if its translation is there"
        )
