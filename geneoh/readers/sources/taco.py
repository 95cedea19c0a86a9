"""TACO as it is distributed: the right hand with its tool, the left hand with its target.

Hand_Poses/{triplet}/{seq}/{side}_hand.pkl, {side}_hand_shape.pkl (torch tensors in pickles, also of
a GPU); Object_Poses/{triplet}/{seq}/{tool|target}_{id}.npy; Object_Models/{id}_cm.obj in
centimetres. Convention W, absolute pose, MANO_LEFT as shipped, world frame with z up, 30 frames a
second.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clip_name, finite_frames
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    Track,
    mano_track,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, Record, as_record, read_array, read_record

CONVENTION = ManoConvention(origin=False)
FPS = 30.0
CENTIMETRES = 0.01
HOLDS: dict[str, Side] = {"tool": "right", "target": "left"}
"""The hand that holds each object."""


def find(path: Path) -> list[SourceClip]:
    """Every sequence that has hand poses."""
    hands = sorted({p.parent for p in path.rglob("*_hand.pkl")} if path.is_dir() else {path.parent})
    return [SourceClip(clip_name(folder, 2), folder) for folder in hands if folder.is_dir()]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """One recording for each hand and what it holds."""
    root = clip.path.parents[2]
    poses = root / "Object_Poses" / clip.path.parent.name / clip.path.name
    found = []
    for role, side in HOLDS.items():
        files = sorted(poses.glob(f"{role}_*.npy"))
        if not files or not (clip.path / f"{side}_hand.pkl").is_file():
            continue
        found += read_one(clip, known, side, files[0], root)
    if not found:
        raise InputError(
            f"{clip.path}: expected a hand with poses of its object in {poses}, got none; "
            "download Object_Poses as well"
        )
    return found


def read_one(
    clip: SourceClip, known: ReaderOptions, side: Side, pose: Path, root: Path
) -> list[Recording]:
    """One hand and its object."""
    role, name = pose.stem.split("_", 1)
    motion = read_array(pose, ("T", 4, 4))
    folder = known.objects or root / "Object_Models"
    mesh = read_mesh(find_mesh([folder / f"{name}_cm.obj"], f"object {name}"), CENTIMETRES)
    hand = read_hand(clip.path, side, len(motion), known)
    sequence = sequence_of(
        [hand],
        object_track([mesh], motion[:, None]),
        known.rate(FPS),
        f"TACO {clip.path.parent.name} {clip.path.name} {role}",
    )
    present = finite_frames(motion)
    return recordings(
        f"{clip.name}_{role}", sequence, object_known=present, mesh_names=(f"taco_{name}",)
    )


def read_hand(folder: Path, side: Side, frames: int, known: ReaderOptions) -> Track:
    """One hand, in as many frames as the object has."""
    record = read_record(folder / f"{side}_hand.pkl")
    keys = sorted(record.values, key=str)
    if len(keys) != frames:
        raise InputError(
            f"{record.where}: expected {frames} frames, as the object has, got {len(keys)}; "
            "the files are of different sequences or versions"
        )
    steps = [record.record(key) for key in keys]
    return mano_track(
        ManoParameters(
            side,
            pose=np.stack([step.array("hand_pose", (48,)) for step in steps]),
            trans=np.stack([step.array("hand_trans", (3,)) for step in steps]),
            betas=read_shape(folder / f"{side}_hand_shape.pkl"),
        ),
        CONVENTION,
        known,
        record.where,
    )


def read_shape(path: Path) -> Array | None:
    """(10,) betas, if the file is there."""
    if not path.is_file():
        return None
    record: Record = as_record(read_record(path).values, str(path))
    return record.array("hand_shape", (10,))
