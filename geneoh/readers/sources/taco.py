"""TACO as it is distributed, and in the simplified pickle of GeneOH Diffusion.

Both: translation of the wrist, absolute pose, left hand as shipped, metres, 30 frames a second.

Distributed: the right hand with its tool, the left hand with its target, in a world frame with z
up. Torch tensors in pickles, also of a GPU: Hand_Poses/{triplet}/{seq}/{side}_hand.pkl, by the
number of the frame, and {side}_hand_shape.pkl beside it. The object:
Object_Poses/{triplet}/{seq}/{tool|target}_{id}.npy and Object_Models/{id}_cm.obj in centimetres.

Simplified: {seq}.pkl with one hand and its object, {seq}.obj. hand_pose (T, 48), hand_trans (T, 3),
hand_shape (10,), hand_verts (T, 778, 3), obj_verts (T, V, 3), obj_faces, obj_pose (T, 4, 4). The
side is not stored: the published files hold left hands.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh, checked_mesh
from geneoh.readers import base, builders, foreign_files, mano, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, Record

HOLDS: dict[str, Side] = {"tool": "right", "target": "left"}
"""The hand that holds each object."""


@reads(
    "*_hand.pkl",
    clip_is_folder=True,
    name_parts=2,
    content="a hand, and poses of its object in the same folder below Object_Poses",
    takes=("objects",),
)
def taco(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Each hand with the object that it holds, in the world."""
    root = base.ancestor(clip.path, 3)
    triplet, sequence = clip.path.parts[-2:]
    folder = options.objects or root / "Object_Models"
    for role, side in HOLDS.items():
        poses = sorted((root / "Object_Poses" / triplet / sequence).glob(f"{role}_*.npy"))
        if not poses or not (clip.path / f"{side}_hand.pkl").is_file():
            continue
        name = poses[0].stem.removeprefix(f"{role}_")
        motion = foreign_files.read_array(poses[0], ("T", 4, 4))
        mesh = find_mesh([folder / f"{name}_cm.obj"], f"object {name}", "cm")
        hand, meshes = _read_hand(clip.path, side, len(motion)), {f"taco_{name}": mesh}
        source, name = f"TACO {triplet} {sequence} {role}", f"{clip.name}_{role}"
        yield base.ClipParts(source, [hand], meshes, motion, name=name)


@reads("*.pkl")
def taco_pickle(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The hand and its object."""
    record = foreign_files.read_record(clip.path)
    side = options.side or "left"
    motion = record.array("obj_pose", ("T", 4, 4))
    stored = record.optional_array("obj_verts", (len(motion), "V", 3))
    mesh = _read_object(record, clip.path, motion, stored)
    points = None
    if stored is not None and stored.shape[1:] == mesh.verts.shape:
        points = stored, transforms.moved_points(mesh.verts.double().numpy(), motion)
    joints = record.optional_array("hand_joints", (len(motion), 21, 3))
    verts = record.optional_array("hand_verts", (len(motion), 778, 3))
    pose, wrist = record.array("hand_pose", ("T", 48)), record.array("hand_trans", ("T", 3))
    shape = record.array("hand_shape", (10,))
    hand = base.ManoParameters(side, pose, wrist, shape, joints=joints)
    rim = base.by_side(side, None if verts is None else verts[:, mano.RIM].mean(1))
    checks = base.CrossChecks(base.by_side(side, joints), rim, object_points=points)
    yield base.ClipParts(
        f"{clip.path.name} (simplified TACO pickle)",
        [hand],
        {f"taco_{clip.name}": mesh},
        motion,
        notes=() if options.side else ("a left hand is assumed; --side says otherwise",),
        cross_checks=checks,
    )


def _read_hand(folder: Path, side: Side, frames: int) -> base.ManoParameters:
    """One hand at the object's frames, NaN in missing ones, with betas if their file exists."""
    record = foreign_files.read_record(folder / f"{side}_hand.pkl")
    keys = {foreign_files.frame_number(Path(str(key))): key for key in record.values}
    first, last = min(keys, default=0), max(keys, default=-1)
    if last - first + 1 != frames:
        raise InputError(
            f"{record.where}: expected {frames} frames, as the object has, got frames {first} to "
            f"{last}; the files are of different sequences or versions"
        )
    steps = {number - first: record.record(key) for number, key in keys.items()}
    hand = builders.hand_by_frame(side, steps, frames, "hand_pose", "hand_trans")
    shape = folder / f"{side}_hand_shape.pkl"
    betas = foreign_files.read_record(shape).array("hand_shape", (10,)) if shape.is_file() else None
    return replace(hand, betas=betas)


def _read_object(record: Record, path: Path, motion: Array, stored: Array | None) -> Mesh:
    """The mesh in its own frame, from the OBJ beside the pickle, else from the world's vertices."""
    if path.with_suffix(".obj").is_file() or stored is None:
        return read_mesh(path.with_suffix(".obj"))
    verts = (stored[0] - motion[0, :3, 3]) @ motion[0, :3, :3]
    faces = np.int64(record.array("obj_faces", ("F", 3)))
    mesh = Mesh(torch.from_numpy(np.float32(verts)), torch.from_numpy(faces))
    return checked_mesh(mesh, record.where)
