"""Read a body's motion from any supported file, and the object in its hands."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

from geneoh.choices import Axis, Unit
from geneoh.errors import InputError
from geneoh.files.npz import read_archive
from geneoh.geometry.mesh_files import meshes_of
from geneoh.readers import foreign_files
from geneoh.readers.bodies.base import BodyRecording
from geneoh.readers.bodies.bvh import read_bvh
from geneoh.readers.bodies.smpl import OFFSETS, read_smpl
from geneoh.readers.npz.files import with_callers
from geneoh.readers.npz.objects import find_meshes, read_object
from geneoh.readers.object_poses import poses_of
from geneoh.readers.records import Record
from geneoh.sequence.sequence import ObjectTrack

SCENES = (".fbx", ".glb", ".gltf", ".blend", ".abc", ".usd", ".usda", ".usdc", ".c3d", ".bip")
"""Endings of files of 3D programs, which are not read: these programs export BVH."""


def read_bodies(
    path: Path | str, *, fps: float | None = None, up: Axis | None = None, model: Path | None = None
) -> Iterator[BodyRecording]:
    """The bodies in a file, metres, y up, at its frame rate; several only in lists of BOTH57M.

    Args:
        path: npz by smplx names or of AMASS, npy of Motion-X, joblib list of BOTH57M, BVH, or what
            `geneoh generate --body` wrote. No code in it is run.
        fps: frames a second, if the file does not state it.
        up: axis of the file's world that points up, if neither its layout nor the body shows it.
        model: the user's SMPL-H or SMPL-X model, for the skeleton of SMPL parameters.

    Raises:
        InputError: the file holds no body that can be read; the message says why.
    """
    path = Path(path)
    if path.suffix.lower() in SCENES and path.is_file():
        raise InputError(
            f"{path}: expected a body as .npz, .npy, .p or .bvh, got '{path.suffix}'; export it as "
            "BVH"
        )
    if path.suffix.lower() == ".bvh":
        if model is not None:
            raise InputError(f"{path}: a BVH has bones of its own; leave --skeleton {model} out")
        return iter((read_bvh(path, fps=fps, up=up),))
    return read_smpl(path, fps=fps, up=up, model=model)


def read_body(
    path: Path | str,
    *,
    clip: int | None = None,
    fps: float | None = None,
    up: Axis | None = None,
    model: Path | None = None,
) -> BodyRecording:
    """One body of a file; see `read_bodies`.

    `clip` is its index in a file with several, from 0; by default the first one, with a note.
    """
    index = clip or 0
    bodies = list(islice(read_bodies(path, fps=fps, up=up, model=model), index, index + 2))
    if not bodies:
        raise InputError(f"{path}: expected a clip number {index}, got fewer; lower --clip")
    body = bodies[0]
    if clip is None and len(bodies) > 1:
        note = "the first of several clips; --clip takes another"
        return replace(body, notes=(*body.notes, note))
    return body


def own_body(path: Path) -> BodyRecording | None:
    """The body beside the hands in a file that geneoh wrote; None where there is none."""
    if path.suffix.lower() != ".npz" or OFFSETS not in read_archive(path):
        return None
    return read_body(path)


def object_of_body(
    path: Path,
    frames: int,
    *,
    obj: tuple[Path, ...] = (),
    object_pose: Path | None = None,
    unit: Unit = "m",
) -> ObjectTrack:
    """The object in the world of a body's file; a track without meshes if there is no object.

    Args:
        path: the body's file. An npz may hold `obj_pose`, or `object_rotation` with
            `object_translation`, and name its meshes, as a geneoh-sequence does.
        frames: number of frames of the body, which the object must have, too.
        obj: mesh files, one per rigid part.
        object_pose: if the body's file has no object poses: poses, object to world, in a file or
            folder that `geneoh.readers.object_poses.read_poses` reads.
        unit: unit of the mesh files.

    Raises:
        InputError: a mesh without poses or the reverse, or poses of another number of frames.
    """
    own = path.suffix.lower() == ".npz"
    record = foreign_files.read_record(path) if own else Record(str(path), {})
    poses = poses_of(object_pose, str(path))
    record = with_callers(record, "obj_pose", poses and poses.matrices)
    meshes = meshes_of(obj, unit) or find_meshes(record, path)[0]
    motion = read_object(record, meshes, frames)
    if len(motion.rotation) != frames:
        raise InputError(
            f"{path}: the object must have as many frames as the body, {frames}, got "
            f"{len(motion.rotation)}; cut them to the same frames"
        )
    return motion
