"""HOI4D as GeneOH Diffusion prepares it: {Category}/case{i}/merged_data.npy and meta_data.npy.

One dict for each frame with theta (1, 48) absolute, beta (1, 10), trans (1, 3) of convention O,
joints (63,) in MANO's order, obj_rot and obj_trans, of which an articulated object has one for each
part; torch tensors, right hands, metres, the frame of a moving camera, 15 frames a second.
meta_data.npy names HOI4D's sequence, whose meshes are those of the data set itself.
"""

from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.pickles.files import read_values
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clip_name,
    clips,
    finite_frames,
)
from geneoh.readers.builders import (
    OPENPOSE_FROM_M,
    ManoConvention,
    ManoParameters,
    mano_track,
    matrices,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.records import FRAME_LIMIT, Array, Record, as_record, read_record
from geneoh.readers.sources.hoi4d import FPS, read_meshes, wrong_order

CONVENTION = ManoConvention(origin=True)
ID_PARTS = 7
"""Of a sequence of HOI4D: camera, person, category, instance, room, layout, task."""


def find(path: Path) -> list[SourceClip]:
    """Every case."""
    found = clips(path, "merged_data.npy", 3)
    return [SourceClip(clip_name(clip.path.parent, 2), clip.path) for clip in found]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """The right hand and the object's parts, in the camera's frame."""
    steps = read_steps(clip.path)
    frames = max(steps) + 1
    pose, trans = np.full((frames, 48), np.nan), np.full((frames, 3), np.nan)
    joints, betas = np.full((frames, 21, 3), np.nan), []
    for frame, step in steps.items():
        pose[frame] = step.array("theta", (48,))
        trans[frame] = step.array("trans", (3,))
        betas.append(step.array("beta", (10,)))
        if "joints" in step:
            joints[frame] = step.array("joints", (63,), (21, 3)).reshape(21, 3)
    joints = joints[:, OPENPOSE_FROM_M]
    motion = read_motion(steps, frames)
    category, meshes = meshes_of(clip.path, motion.shape[1], known)
    # With the model keypoints are made from the pose; without, the stored ones place the wrist.
    stored = known.mano is None and np.isfinite(joints[np.isfinite(trans).all(1)]).all()
    numbers = ManoParameters(
        "right", pose, trans, np.mean(betas, axis=0), joints=joints if stored else None
    )
    sequence = sequence_of(
        [mano_track(numbers, CONVENTION, known, str(clip.path))],
        object_track(meshes, motion),
        known.rate(FPS),
        f"HOI4D {clip.name} (GeneOH)",
        "camera frame",
    )
    present = finite_frames(motion)
    return recordings(
        clip.name,
        sequence,
        object_known=present,
        mesh_names=tuple(
            f"hoi4d_{category}_{clip.path.parent.name}_{k}" for k in range(len(meshes))
        ),
        evidence=CrossChecks(
            joints={"right": joints} if np.isfinite(joints).any() else {},
            said=tuple(wrong_order(meshes, motion[present])),
        ),
    )


def read_steps(path: Path) -> dict[int, Record]:
    """Each frame's fields; a list holds frames in order, a dict by their numbers."""
    value: Any = read_values(path)
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = value.tolist()
    items = (
        value
        if isinstance(value, dict)
        else dict(enumerate(value if isinstance(value, list) else []))
    )
    steps = {}
    for key, step in items.items():
        number = str(key)
        if not number.isdecimal() or int(number) >= FRAME_LIMIT:
            raise InputError(f"{path}: expected frames by number, got {number[:40]!r}; check it")
        steps[int(number)] = as_record(step, f"{path} frame {number}")
    if not steps:
        raise InputError(f"{path}: expected frames with 'theta' and 'obj_rot', got none; check it")
    return steps


def read_motion(steps: dict[int, Record], frames: int) -> Array:
    """(T, Q, 4, 4) of the parts to the camera; NaN where there is no frame."""
    poses = {}
    for frame, step in steps.items():
        turn = step.array("obj_rot", (3, 3), ("Q", 3, 3), ("Q", 1, 3, 3)).reshape(-1, 3, 3)
        shift = step.array("obj_trans", (3,), ("Q", 3), ("Q", 1, 3)).reshape(-1, 3)
        if len(turn) != len(shift):
            raise step.refuse("obj_trans", f"one for each of {len(turn)} parts")
        poses[frame] = matrices(turn, shift)
    count = max(len(pose) for pose in poses.values())
    motion = np.full((frames, count, 4, 4), np.nan)
    for frame, pose in poses.items():
        if len(pose) == count:
            motion[frame] = pose
    return motion


def meshes_of(path: Path, count: int, known: ReaderOptions) -> tuple[str, list[Mesh]]:
    """The category and the mesh of each part: the caller's, or the data set's own."""
    if known.meshes:
        return path.parents[1].name, list(known.meshes)
    meta = path.with_name("meta_data.npy")
    if not meta.is_file():
        raise InputError(
            f"{meta}: expected the name of HOI4D's sequence, got no such file; copy it, or pass "
            "the object's meshes with --obj"
        )
    record = read_record(meta)
    parts = tuple(record.text("case_flag").strip("/").split("/"))[-ID_PARTS:]
    if len(parts) != ID_PARTS:
        raise record.refuse("case_flag", "a sequence such as ZY20210800001/H1/C1/N1/S1/s01/T1")
    return read_meshes(parts, count, path.parents[2], known)
