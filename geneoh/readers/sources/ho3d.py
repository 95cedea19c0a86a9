"""HO-3D v3 as it is distributed: {train,evaluation}/{SEQ}/meta/{frame}.pkl.

handPose (48,) absolute, handTrans (convention O), handBeta, handJoints3D in MANO's order, objRot
(Rodrigues), objTrans; right hand, metres, in OpenGL camera axes (y up, z backward), which become
OpenCV's here. None stands for what was not annotated. Objects are YCB models. 30 frames a second.
"""

from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clip_name,
    finite_frames,
)
from geneoh.readers.builders import (
    OPENPOSE_FROM_M,
    ManoConvention,
    ManoParameters,
    hand_in,
    mano_track,
    matrices,
    object_track,
    recordings,
    sequence_of,
    turned,
)
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, Record, frame_number, read_record

CONVENTION = ManoConvention(origin=True)
FPS = 30.0
OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])


def find(path: Path) -> list[SourceClip]:
    """Every sequence that has annotations."""
    folders = {p.parent for p in path.rglob("meta") if p.is_dir()} if path.is_dir() else set()
    return [SourceClip(clip_name(folder, 2), folder) for folder in sorted(folders)]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """The right hand and the object, in the camera's frame."""
    files = {frame_number(p): p for p in sorted((clip.path / "meta").glob("*.pkl"))}
    if not files:
        raise InputError(f"{clip.path}: expected frames in 'meta', got none; download them")
    records = {frame: read_record(path) for frame, path in files.items()}
    frames = max(records) + 1
    pose, trans = rows(records, "handPose", 48, frames), rows(records, "handTrans", 3, frames)
    joints = rows(records, "handJoints3D", 63, frames).reshape(frames, 21, 3)
    joints = joints[:, OPENPOSE_FROM_M]
    betas = rows(records, "handBeta", 10, frames)
    betas = betas[np.isfinite(betas).all(1)]
    complete = np.isfinite(joints[np.isfinite(pose).all(1)]).all()
    numbers = ManoParameters(
        "right",
        pose,
        trans,
        betas.mean(0) if len(betas) else None,
        joints=joints if complete else None,
    )
    hand, notes = mano_track(numbers, CONVENTION, known, str(clip.path))
    flip = np.tile(np.eye(4), (frames, 1, 1))
    flip[:, :3, :3] = OPENCV_FROM_OPENGL
    motion = flip @ matrices(
        turned(rows(records, "objRot", 3, frames)), rows(records, "objTrans", 3, frames)
    )
    name = object_name(records)
    root = clip.path.parents[1]
    folder = known.objects or root / "models"
    mesh = read_mesh(find_mesh([folder / name / "textured_simple.obj"], name))
    sequence = sequence_of(
        [(hand_in(hand, flip), notes)],
        object_track([mesh], motion[:, None]),
        known.rate(FPS),
        f"HO-3D {clip.name}",
    )
    return recordings(
        clip.name,
        sequence,
        object_known=finite_frames(motion),
        mesh_names=(f"ho3d_{name}",),
        evidence=CrossChecks(joints={"right": joints @ OPENCV_FROM_OPENGL}),
    )


def rows(records: dict[int, Record], name: str, count: int, frames: int) -> Array:
    """(T, count) of one field; NaN where it is missing, None, or shorter (the root alone)."""
    result = np.full((frames, count), np.nan)
    for frame, record in records.items():
        if record.values.get(name) is None:
            continue
        values = record.numbers(name).ravel()
        if len(values) == count:
            result[frame] = values
        elif name != "handJoints3D" or len(values) != 3:
            raise record.refuse(name, f"{count} numbers")
    return result


def object_name(records: dict[int, Record]) -> str:
    """The object of the sequence, by the first frame that names it."""
    for record in records.values():
        if record.values.get("objName") is not None:
            return record.text("objName").replace("/", "_")
    raise InputError(f"{next(iter(records.values())).where}: expected 'objName', got none")
