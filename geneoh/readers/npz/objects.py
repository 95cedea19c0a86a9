"""The object of an npz: its motion, and its meshes, by file paths and hashes of their contents."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.errors import InputError, numbered
from geneoh.files.npz import Arrays
from geneoh.geometry.mesh import METRES, Mesh
from geneoh.geometry.mesh_files import load_mesh
from geneoh.readers.npz.layouts import MESH_FIELDS, OBJECT_FIELDS, quoted
from geneoh.readers.object_poses import pose_field
from geneoh.readers.records import Array, Notes, Record, float32
from geneoh.readers.transforms import refuse_bottom_row
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack

MOTION_MISSING = (
    "neither; add them, for an object that does not move the identity and zeros in every frame; "
    "`geneoh denoise`, `generate --body` and `batch` also take --object-pose POSES.npy"
)
FILES, HASHES = MESH_FIELDS
IN_NO_FILE = "the object's mesh was made in memory, and no file is known that holds it"
"""Note on a sequence with hashes but no paths of its meshes."""


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
    """The track; poses that are NaN or outside `object_valid` are marked, and filled in unless they
    are in `object_filled`: what geneoh filled in is kept."""
    frames, parts = translation.shape[:2]

    def mask(name: str) -> Bool[Tensor, "T Q"] | None:
        """A field of one truth value for each pose or each frame, if the file has it."""
        shapes = (frames, parts), (frames,)
        values = record.optional_array(name, *shapes, remedy="give one for each pose")
        if values is None:
            return None
        every = np.broadcast_to(values.reshape(frames, -1) > 0, (frames, parts))
        return torch.from_numpy(np.array(every))

    track = ObjectTrack(meshes, float32(rotation), float32(translation))
    seen, filled = mask("object_valid"), mask("object_filled")
    if seen is None or filled is None:
        return fill_object(track, seen)
    track = fill_object(track, seen | filled)
    return replace(track, valid=track.observed & seen)


def notes_on_gaps(motion: ObjectTrack) -> Notes:
    """A note where an object has no pose in some frames, or in none."""
    if motion.valid is None or not motion.is_known:
        return ()
    if not motion.is_seen:
        return ("there is no pose of the object in any frame",)
    lost = int((~motion.valid[:, motion.seen_parts]).any(1).sum())
    return (f"{numbered(lost, 'frame')} without a pose of the object, filled in",) if lost else ()


def folder_of(path: Path) -> Path:
    """The folder that a file lies in, behind links: paths of meshes are relative to it."""
    return Path(os.path.realpath(path)).parent


def mesh_arrays(meshes: tuple[Mesh, ...], npz: Path) -> Arrays:
    """SHA-256 hashes of meshes, and their paths relative to the npz if every mesh has a file."""
    if not meshes:
        return {}
    arrays = {HASHES: np.array([mesh.sha256 for mesh in meshes])}
    sources = [mesh.source for mesh in meshes if mesh.source is not None]
    if len(sources) == len(meshes):
        arrays[FILES] = np.array([_seen_from(folder_of(npz), source) for source in sources])
    return arrays


def _seen_from(folder: Path, file: Path) -> str:
    """The path from a folder to a file, so that both can be moved together."""
    try:
        seen = Path(os.path.relpath(file, folder))
        if os.path.exists(file) and not os.path.exists(folder / seen):  # `..` behind a link
            seen = Path(os.path.relpath(os.path.realpath(file), os.path.realpath(folder)))
        return seen.as_posix()
    except ValueError:  # another drive of Windows
        return str(file.absolute())


def find_meshes(record: Record, npz: Path) -> tuple[tuple[Mesh, ...], str]:
    """The meshes that an npz names, if all files exist and are unchanged; else none, and why."""
    if FILES not in record:
        return (), IN_NO_FILE if HASHES in record else ""
    names = record.texts(FILES)
    hashes = record.texts(HASHES) if HASHES in record else []
    meshes: list[Mesh] = []
    for index, name in enumerate(names):
        path = folder_of(npz) / name
        if not os.path.isfile(path):
            return (), f"the object's mesh {name} is not there any more"
        try:
            same = known_mesh(path, hashes[index : index + 1] if hashes else None)
        except InputError as error:
            return (), f"the object's mesh cannot be used: {error}"
        if same is None:
            return (), f"the object's mesh {name} was changed since then"
        meshes.append(same)
    return tuple(meshes), ""


def notes_on_meshes(record: Record, meshes: tuple[Mesh, ...]) -> Notes:
    """A note where none of a caller's meshes, nor of their parts, is one that an npz has hashes of.

    The poses in the npz may be wrong for another mesh, which may have another origin or size.
    `InputError` for the meshes of the npz in another order than that of its parts.
    """
    if HASHES not in record:
        return ()
    stored, given = record.texts(HASHES), [mesh.sha256 for mesh in meshes]
    if given != stored and sorted(given) == sorted(stored):
        numbers = ", ".join(str(stored.index(each) + 1) for each in given)
        raise InputError(
            f"{record.where}: expected the meshes in the order of the parts, got those of the "
            f"parts {numbers}; exchange them"
        )
    if any(each.sha256 in stored for mesh in meshes for each in (mesh, *mesh.parts)):
        return ()
    return ("the mesh in --obj is another one than the file was written with",)


def known_mesh(path: Path, hashes: list[str] | None) -> Mesh | None:
    """The mesh in a file, or its part, that has one of `hashes` in some unit, if any does.

    Without hashes it is the whole mesh, read in metres.
    """
    for unit in reversed(METRES):  # metres first
        whole = load_mesh(path, unit)
        for mesh in (whole, *whole.parts):
            if hashes is None or mesh.sha256 in hashes:
                return mesh
    return None
