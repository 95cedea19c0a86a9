"""The simplified TACO pickle of GeneOH Diffusion: {seq}.pkl with one hand and its object,
{seq}.obj.

hand_pose (T, 48), hand_trans (T, 3) of the wrist, hand_shape (10,), hand_verts (T, 778, 3),
obj_verts (T, V, 3), obj_faces, obj_pose (T, 4, 4); metres, absolute pose, 30 frames a second. The
side is not stored: the published files hold left hands.
"""

from pathlib import Path

from geneoh.geometry.mesh import Mesh, checked
from geneoh.readers import base
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import read_record
from geneoh.readers.mano import RIM
from geneoh.readers.meshes import mesh_from, read_mesh
from geneoh.readers.records import Array, Record
from geneoh.readers.transforms import moved_points


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The hand and its object."""
    record = read_record(clip.path)
    side = options.side or "left"
    motion = record.array("obj_pose", ("T", 4, 4))
    stored = record.optional_array("obj_verts", (len(motion), "V", 3))
    mesh = read_object(record, clip.path, motion, stored)
    points = None
    if stored is not None and stored.shape[1:] == mesh.verts.shape:
        points = stored, moved_points(mesh.verts.double().numpy(), motion)
    joints = record.optional_array("hand_joints", (len(motion), 21, 3))
    verts = record.optional_array("hand_verts", (len(motion), 778, 3))
    hand = base.ManoParameters(
        side,
        record.array("hand_pose", ("T", 48)),
        record.array("hand_trans", ("T", 3)),
        record.array("hand_shape", (10,)),
        joints=joints,
    )
    yield base.ClipParts(
        f"{clip.path.name} (simplified TACO pickle)",
        [hand],
        {f"taco_{clip.name}": mesh},
        motion,
        notes=() if options.side else ("a left hand is assumed; --side says otherwise",),
        cross_checks=base.CrossChecks(
            joints={} if joints is None else {side: joints},
            rim={} if verts is None else {side: verts[:, RIM].mean(1)},
            object_points=points,
        ),
    )


def read_object(record: Record, path: Path, motion: Array, stored: Array | None) -> Mesh:
    """The mesh in its own frame, from the OBJ beside the pickle, else from the moved vertices."""
    if path.with_suffix(".obj").is_file() or stored is None:
        return read_mesh(path.with_suffix(".obj"))
    verts = (stored[0] - motion[0, :3, 3]) @ motion[0, :3, :3]
    return checked(mesh_from(verts, record.array("obj_faces", ("F", 3))), record.where)


READER = DatasetReader(parts, ("*.pkl",))
