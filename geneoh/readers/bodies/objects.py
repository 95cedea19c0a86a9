"""The object in a body's hands: its poses, from the body's file or from the caller."""

from pathlib import Path

from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.geometry.mesh import meshes_of
from geneoh.readers import foreign_files
from geneoh.readers.meshes import find_meshes
from geneoh.readers.npz_files import with_callers
from geneoh.readers.npz_tracks import read_object
from geneoh.readers.records import Record
from geneoh.sequence.sequence import ObjectTrack


def object_of_body(
    path: Path,
    frames: int,
    *,
    obj: tuple[Path, ...] = (),
    object_pose: Path | None = None,
    unit: Unit = "m",
) -> ObjectTrack:
    """The object in the world of a body's file; without mesh and poses none, which has no meshes.

    Args:
        path: of the body. An npz may hold `obj_pose`, or `object_rotation` with
            `object_translation`, and name its meshes, as a geneoh-sequence does.
        frames: of the body, which are those of the object too.
        obj: mesh files, one per rigid part.
        object_pose: npy of (T, 4, 4) or (T, Q, 4, 4) object to world, or a folder of texts of each
            frame's matrix, where the file has none.
        unit: of the mesh files.

    Raises:
        InputError: a mesh without poses or the reverse, or poses of another number of frames.
    """
    own = path.suffix.lower() == ".npz"
    record = foreign_files.read_record(path) if own else Record(str(path), {})
    given = None
    if object_pose is not None:
        given, _ = foreign_files.read_poses(object_pose)
    record = with_callers(record, "obj_pose", given)
    meshes = meshes_of(obj, unit) or find_meshes(record, path.parent)[0]
    motion = read_object(record, meshes, frames)
    if len(motion.rotation) != frames:
        raise InputError(
            f"{path}: the object must have as many frames as the body, {frames}, got "
            f"{len(motion.rotation)}; cut them to the same frames"
        )
    return motion
