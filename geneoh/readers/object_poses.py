"""Read the poses of an object or a camera that a caller passes as an array, a file or a folder."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.files.reading import note_read
from geneoh.files.values import read_values
from geneoh.geometry.mesh import METRES
from geneoh.readers.clock import TIME_NAMES, is_column
from geneoh.readers.foreign_files import (
    by_frame,
    frame_number,
    number_in,
    numbered_files,
    read_numbers,
)
from geneoh.readers.nested_lists import Shape
from geneoh.readers.pose_matching import PoseTrack
from geneoh.readers.pose_tables import with_bottom_row
from geneoh.readers.records import FRAME_LIMIT, Array, Record
from geneoh.readers.trajectories import (
    in_seconds,
    is_text,
    read_trajectory,
    refuse_other_lengths,
)

POSE_SHAPES = (("T", 4, 4), ("T", "Q", 4, 4), ("T", 3, 4), ("T", "Q", 3, 4), (4, 4), (3, 4))
"""Accepted shapes of object poses; those without T are a single pose."""
CAMERA_SHAPES = tuple(shape for shape in POSE_SHAPES if "Q" not in shape)
"""The same of a camera, which has no parts."""

AS_MATRICES = (
    "give a 4x4 matrix for each frame, made of its position and its quaternion or axis-angle"
)
"""What to do about poses of other shapes."""

IN_A_TEXT = (
    "write the 16 numbers of a 4x4 matrix with spaces between them; a position and a quaternion "
    "or axis-angle make one"
)
"""What to do about a text that holds no matrix."""


def pose_field(
    record: Record, name: str, unit: str = "", shapes: tuple[Shape, ...] = POSE_SHAPES
) -> Array:
    """(T, 4, 4) or (T, Q, 4, 4) poses in a field that may lack their last row, or the axis T."""
    poses = record.array(name, *shapes, unit=unit, remedy=AS_MATRICES)
    return with_bottom_row(poses if poses.ndim > 2 else poses[None])


def poses_of(
    given: Path | str | Array | None, where: str, unit: Unit | None = None, owner: str = "object"
) -> PoseTrack | None:
    """The poses that a caller passes as an array or as a path for `read_poses`, in metres.

    Lengths are in `unit`, or in that of the file's format; `owner` is what has the poses.
    """
    if given is None:
        return None
    name = f"{owner}_pose"
    record = Record(where, {name: given}, AS_MATRICES)
    on_disk = isinstance(given, Path | str)
    poses = read_poses(Path(given)) if on_disk else PoseTrack(pose_field(record, name))
    matrices = poses.matrices.copy()
    matrices[..., :3, 3] *= METRES[poses.unit or unit or "m"]
    return replace(poses, matrices=matrices, unit="m", owner=owner)


def read_poses(path: Path) -> PoseTrack:
    """The poses in a file, or in a folder with a text of a 4x4 matrix for each frame.

    A file is a npy, an npz with one field of poses, or a trajectory in a table or JSON. In a
    folder, as FoundationPose writes it, frames without a file get NaN; file names too large to be
    frame numbers are timestamps.
    """
    if os.path.isdir(path):
        return poses_in_folder(path)
    if is_text(path):
        return read_trajectory(path)
    value = read_values(path)
    fields = value if isinstance(value, dict) else {"array": value}
    arrays = {name: each for name, each in fields.items() if isinstance(each, Array)}
    shaped = [name for name, each in arrays.items() if each.shape[-2:] in ((4, 4), (3, 4))]
    if len(fields) > 1 and len(shaped) != 1:
        raise InputError(
            f"{path}: expected one field of (T, 4, 4) poses, got {len(shaped)} in "
            f"{', '.join(map(str, fields))[:200]}; save them as npy"
        )
    poses = pose_field(Record(str(path), fields), (shaped or list(fields))[0])
    columns = {n: fields[n] for n in TIME_NAMES if isinstance(fields.get(n), Array | list)}
    refuse_other_lengths(columns, len(poses), path)
    poses = seen_poses(poses, Record(str(path), fields, "give one for each pose"))
    name = next((name for name in TIME_NAMES if is_column(fields.get(name), len(poses))), None)
    times = None if name is None else in_seconds(path, name, np.asarray(fields[name], float))
    return PoseTrack(poses, times=times)


def seen_poses(poses: Array, record: Record) -> Array:
    """(T, 4, 4) or (T, Q, 4, 4) poses, NaN where the field 'object_valid' says that a part was not
    found."""
    seen = record.optional_array("object_valid", *{poses.shape[:-2], poses.shape[:1]})
    if seen is None:
        return poses
    return np.where(seen.reshape(*seen.shape, *[1] * (poses.ndim - seen.ndim)) > 0, poses, np.nan)


def poses_in_folder(folder: Path) -> PoseTrack:
    """The poses in the texts of a folder."""
    note_read(folder)
    files = sorted(folder.glob("*.txt"))
    if not files:
        raise InputError(
            f"{folder}: expected a text of a 4x4 matrix for each frame, such as 000000.txt, got "
            "none; name the folder ob_in_cam of FoundationPose, or a npy file"
        )
    stamps = {file: number_in(file.stem) for file in files}
    if all(stamp > FRAME_LIMIT for stamp in stamps.values()):
        files.sort(key=lambda file: stamps[file])
        times = in_seconds(folder, "timestamp", np.array([stamps[file] for file in files]))
        return PoseTrack(np.stack(list(map(read_matrix, files))), times=times)
    found = numbered_files(folder, "*.txt")
    if twice := [file for file in files if file not in found.values()]:
        other = found[frame_number(twice[0])]
        raise InputError(
            f"{folder}: expected one text for each frame, got {twice[0].name} and {other.name}, "
            "which have the same number; remove one, and keep the poses of one object or camera"
        )
    first = min(found)
    poses = {frame - first: read_matrix(file) for frame, file in found.items()}
    return PoseTrack(by_frame(poses, max(found) + 1 - first, 4, 4), first)


def read_matrix(path: Path) -> Array:
    """The 4x4 matrix in a text, in four rows or in one."""
    values = read_numbers(path, 4, 16, remedy=IN_A_TEXT)
    if values.size != 16:
        raise InputError(f"{path}: expected a 4x4 matrix, got {len(values)} rows; write it again")
    return values.reshape(4, 4)
