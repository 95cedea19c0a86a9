"""The object's motion out of the fields of an npz."""

import numpy as np
import torch

from geneoh.errors import InputError, numbered
from geneoh.geometry.mesh import Mesh
from geneoh.readers.npz.layouts import OBJECT_FIELDS, quoted
from geneoh.readers.object_poses import pose_field
from geneoh.readers.records import Array, Notes, Record, float32
from geneoh.readers.transforms import refuse_bottom_row
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack

MOTION_MISSING = (
    "neither; add them, for an object that does not move the identity and zeros in every frame; "
    "`geneoh denoise`, `generate --body` and `batch` also take --object-pose POSES.npy"
)


def read_object(record: Record, meshes: tuple[Mesh, ...], frames: int) -> ObjectTrack:
    """The motion from rotation and translation or 4x4 matrices; empty without mesh and motion."""
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
        matrix = pose_field(record, "obj_pose", "object to world")
        matrix = matrix if matrix.ndim == 4 else matrix[:, None]
        refuse_bottom_row(record.where, "'obj_pose'", matrix)
        rotation, translation = matrix[..., :3, :3], matrix[..., :3, 3]
        return observed_object(record, meshes, rotation, translation)
    if len(pair) == 1:
        (other,) = {*OBJECT_FIELDS[:2]} - {*pair}
        raise InputError(f"{record.where}: '{pair[0]}' needs '{other}', got none; add it")
    cure = "turn axis-angle or quaternions into matrices"
    shapes = (("T", "Q", 3, 3), ("T", 3, 3))
    rotation = record.array("object_rotation", *shapes, unit="as matrices", remedy=cure)
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
    """The track; poses that are NaN or outside `object_valid` are marked and filled in."""
    frames, parts = translation.shape[:2]
    seen = record.optional_array("object_valid", ("T", "Q"), ("T",))
    if seen is not None:
        if len(seen) != frames:
            raise record.refuse("object_valid", f"{frames} frames", "give one for each pose")
        seen = np.broadcast_to(seen.reshape(frames, -1) > 0, (frames, parts))
        seen = torch.from_numpy(np.array(seen))
    return fill_object(ObjectTrack(meshes, float32(rotation), float32(translation)), seen)


def notes_on_gaps(motion: ObjectTrack) -> Notes:
    """A note where an object has no pose in some frames, or in none."""
    if motion.valid is None or not motion.is_known:
        return ()
    if not motion.is_seen:
        return ("there is no pose of the object in any frame",)
    lost = int((~motion.valid[:, motion.seen_parts]).any(1).sum())
    return (f"{numbered(lost, 'frame')} without a pose of the object, filled in",) if lost else ()
