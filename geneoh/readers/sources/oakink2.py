"""OakInk2 as it is distributed: anno_preview/{seq}.pkl, one pickle for each sequence.

raw_mano[frame] holds rh__ and lh__ pose_coeffs (1, 16, 4) quaternions with the real part first, tsl
(convention W) and betas as torch tensors, absolute pose, MANO_LEFT as shipped; obj_transf[object]
[frame] is object to world, metres. Frames are numbered by the motion capture, 120 a second; where
numbers are left out, time went on.
"""

from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clips, finite_frames
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    Track,
    mano_track,
    object_track,
    quats_wxyz,
    recordings,
    sequence_of,
)
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, Record, as_record, read_record

CONVENTION = ManoConvention(origin=False)
FPS = 120.0
"""Of the motion capture; frames that were left out make it less."""
PREFIX: dict[Side, str] = {"right": "rh__", "left": "lh__"}


def find(path: Path) -> list[SourceClip]:
    """Every annotation."""
    return [clip for clip in clips(path, "*.pkl", 1) if clip.path.parent.name == "anno_preview"]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands with each object that moves, one recording for an object and stretch of it."""
    record = read_record(clip.path)
    frames = [int(frame) for frame in record.numbers("mocap_frame_id_list").ravel()]
    steps = np.diff(frames)
    if not len(frames) or (steps <= 0).any() or frames[-1] - frames[0] > FRAME_LIMIT:
        raise record.refuse("mocap_frame_id_list", "frame numbers that rise")
    stride = int(np.median(steps)) if len(steps) else 1
    # Ids that are left out are a gap in time: they stay frames, without a hand or an object.
    frames = list(range(frames[0], frames[-1] + 1, stride))
    hands = record.record("raw_mano")
    tracks = [read_hand(hands, side, frames, known) for side in PREFIX]
    tracks = [track for track in tracks if bool(track[0].valid.any())]
    found = []
    for item in record.items("obj_list"):
        places = record.record("obj_transf").record(item)
        motion = np.stack([pose_at(places, frame) for frame in frames])
        present = finite_frames(motion)
        if not present.any():
            continue
        sequence = sequence_of(
            tracks,
            object_track([mesh_of(str(item), clip.path, known)], motion[:, None]),
            known.rate(FPS / stride),
            f"OakInk2 {clip.name} {item}",
        )
        name = "".join(c if c.isalnum() else "_" for c in str(item))
        found += recordings(
            f"{clip.name}_{name}", sequence, object_known=present, mesh_names=(f"oakink2_{name}",)
        )
    if not found:
        raise InputError(f"{clip.path}: expected an object with poses, got none; copy it again")
    return found


def pose_at(places: Record, frame: int) -> Array:
    """(4, 4) of an object in one frame; NaN where it has none."""
    return places.array(frame, (4, 4)) if frame in places else np.full((4, 4), np.nan)


def read_hand(hands: Record, side: Side, frames: list[int], known: ReaderOptions) -> Track:
    """One hand; NaN in the frames that lack it."""
    pose, trans = np.full((len(frames), 48), np.nan), np.full((len(frames), 3), np.nan)
    betas, prefix = [], PREFIX[side]
    for index, frame in enumerate(frames):
        step: Any = hands.values.get(frame)
        if step is None or step.get(f"{prefix}pose_coeffs") is None:
            continue
        values = as_record(step, f"{hands.where} {frame}")
        pose[index] = quats_wxyz(values.array(f"{prefix}pose_coeffs", (1, 16, 4))).reshape(48)
        trans[index] = values.array(f"{prefix}tsl", (1, 3))[0]
        betas.append(values.array(f"{prefix}betas", (1, 10))[0])
    shape = np.mean(betas, axis=0) if betas else None
    return mano_track(ManoParameters(side, pose, trans, shape), CONVENTION, known, hands.where)


def mesh_of(item: str, path: Path, known: ReaderOptions) -> Mesh:
    """The mesh of an object, used as it is."""
    root = path.parents[1]
    name = item.replace("..", "_").replace("/", "_")
    folders = [root / kind / "align_ds" / name for kind in ("object_raw", "object_repair")]
    if known.objects is not None:
        folders.insert(0, known.objects / name)
    files = [
        file
        for folder in folders
        if folder.is_dir()
        for file in sorted(folder.iterdir())
        if file.suffix in (".obj", ".ply")
    ]
    return read_mesh(find_mesh([*files, folders[0] / f"{name}.obj"], item))
