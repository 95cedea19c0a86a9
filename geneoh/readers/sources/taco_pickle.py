"""The simplified TACO pickle of GeneOH Diffusion: {seq}.pkl with one hand and its object,
{seq}.obj.

hand_pose (T, 48), hand_trans (T, 3) of the wrist, hand_shape (10,), hand_verts (T, 778, 3),
obj_verts (T, V, 3), obj_faces, obj_pose (T, 4, 4); metres, absolute pose. The side is not stored:
the published files hold left hands.
"""

from pathlib import Path

from geneoh.geometry.mesh import Mesh, checked
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clips,
    finite_frames,
)
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    mano_track,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.mano import RIM
from geneoh.readers.meshes import mesh_from, read_mesh
from geneoh.readers.records import Array, Record, read_record

CONVENTION = ManoConvention(origin=False)
FPS = 30.0


def find(path: Path) -> list[SourceClip]:
    """Every pickle."""
    return clips(path, "*.pkl", 1)


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """The hand and its object."""
    record = read_record(clip.path)
    side = known.side or "left"
    notes = () if known.side else ("a left hand is assumed; --side says otherwise",)
    motion = record.array("obj_pose", ("T", 4, 4))
    mesh, moved = read_object(record, clip.path, motion)
    joints = record.array("hand_joints", ("T", 21, 3)) if "hand_joints" in record else None
    track = mano_track(
        ManoParameters(
            side,
            pose=record.array("hand_pose", ("T", 48)),
            trans=record.array("hand_trans", ("T", 3)),
            betas=record.array("hand_shape", (10,)),
            joints=joints,
        ),
        CONVENTION,
        known,
        record.where,
    )
    verts = record.array("hand_verts", ("T", 778, 3)) if "hand_verts" in record else None
    evidence = CrossChecks(
        joints={} if joints is None else {side: joints},
        rim={} if verts is None else {side: verts[:, RIM].mean(1)},
        object_points=moved,
    )
    sequence = sequence_of(
        [track],
        object_track([mesh], motion[:, None]),
        known.rate(FPS),
        f"{clip.path.name} (simplified TACO pickle)",
        *notes,
    )
    present = finite_frames(motion)
    return recordings(
        clip.name,
        sequence,
        object_known=present,
        mesh_names=(f"taco_{clip.name}",),
        evidence=evidence,
    )


def read_object(
    record: Record, path: Path, motion: Array
) -> tuple[Mesh, tuple[Array, Array] | None]:
    """The mesh in its own frame, from the OBJ beside the pickle, else from the moved vertices."""
    stored = record.array("obj_verts", ("T", "V", 3)) if "obj_verts" in record else None
    rotation, shift = motion[:, :3, :3], motion[:, None, :3, 3]
    if path.with_suffix(".obj").is_file() or stored is None:
        mesh = read_mesh(path.with_suffix(".obj"))
    else:
        verts = (stored[0] - shift[0]) @ rotation[0]
        faces = record.array("obj_faces", ("F", 3))
        mesh = checked(mesh_from(verts, faces), record.where)
    if stored is None:
        return mesh, None
    moved = mesh.verts.double().numpy() @ rotation.transpose(0, 2, 1) + shift
    return mesh, (stored, moved) if stored.shape == moved.shape else None
