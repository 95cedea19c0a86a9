"""HOI4D as GeneOH Diffusion prepares it: {Category}/case{i}/merged_data.npy and meta_data.npy.

One dict for each frame with theta (1, 48) absolute, beta (1, 10), trans (1, 3) of MANO's origin,
joints (63,) in MANO's order, obj_rot and obj_trans, of which an articulated object has one for each
part; torch tensors, right hands, metres, the frame of a moving camera, 15 frames a second.
meta_data.npy names HOI4D's sequence, whose meshes are those of the data set itself.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.geometry.mesh import Mesh
from geneoh.readers import base
from geneoh.readers.builders import OPENPOSE_FROM_MANO, hand_by_frame, joints_if_complete
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import by_frame, read_record
from geneoh.readers.records import FRAME_LIMIT, Array, Record, as_record
from geneoh.readers.sources.hoi4d import ID_PARTS, exchanged_parts, read_meshes
from geneoh.readers.transforms import rigid_matrices


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The right hand and the object's parts, in the camera's frame."""
    steps = read_steps(clip.path / "merged_data.npy")
    frames = max(steps) + 1
    hand = hand_by_frame("right", steps, frames, "theta", "trans", "beta")
    joints = read_joints(steps, frames)
    motion = read_motion(steps, frames)
    category, meshes = meshes_of(clip.path, motion.shape[1], options)
    if options.mano_dir is None:  # with the model keypoints are made; else they place the wrist
        hand = replace(hand, joints=joints_if_complete(joints, hand.pose))
    yield base.ClipParts(
        f"HOI4D {clip.name} (GeneOH)",
        [hand],
        {f"hoi4d_{category}_{clip.path.name}_{k}": mesh for k, mesh in enumerate(meshes)},
        motion,
        notes=("camera frame",),
        cross_checks=base.CrossChecks(
            joints={"right": joints} if np.isfinite(joints).any() else {},
            contradictions=exchanged_parts(meshes, motion[base.finite_frames(motion)]),
        ),
    )


def read_steps(path: Path) -> dict[int, Record]:
    """Each frame's fields; a list holds frames in order, a dict by their numbers."""
    value: Any = read_values(path)
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = value.tolist()
    if isinstance(value, list):
        value = dict(enumerate(value))
    steps = {}
    for key, step in value.items() if isinstance(value, dict) else ():
        number = str(key)[:40]
        if not number.isdecimal() or int(number) >= FRAME_LIMIT:
            raise InputError(f"{path}: expected frames by number, got {number!r}; check it")
        steps[int(number)] = as_record(step, f"{path} frame {number}")
    if not steps:
        raise InputError(f"{path}: expected frames with 'theta' and 'obj_rot', got none; check it")
    return steps


def read_joints(steps: dict[int, Record], frames: int) -> Array:
    """(T, 21, 3) stored keypoints; NaN in frames without."""
    found = {
        frame: step.array("joints", (63,), (21, 3)).reshape(21, 3)
        for frame, step in steps.items()
        if "joints" in step
    }
    return by_frame(found, frames, 21, 3)[:, OPENPOSE_FROM_MANO]


def read_motion(steps: dict[int, Record], frames: int) -> Array:
    """(T, Q, 4, 4) of the parts to the camera; NaN where there is no frame."""
    poses = {}
    for frame, step in steps.items():
        turn = step.array("obj_rot", (3, 3), ("Q", 3, 3), ("Q", 1, 3, 3)).reshape(-1, 3, 3)
        shift = step.array("obj_trans", (3,), ("Q", 3), ("Q", 1, 3)).reshape(-1, 3)
        if len(turn) != len(shift):
            raise step.refuse("obj_trans", f"one for each of {len(turn)} parts")
        poses[frame] = rigid_matrices(turn, shift)
    count = max(len(pose) for pose in poses.values())
    complete = {frame: pose for frame, pose in poses.items() if len(pose) == count}
    return by_frame(complete, frames, count, 4, 4)


def meshes_of(case: Path, count: int, options: base.ReaderOptions) -> tuple[str, list[Mesh]]:
    """The category and the mesh of each part: the caller's, or the data set's own."""
    if options.meshes:
        return case.parent.name, list(options.meshes)
    meta = case / "meta_data.npy"
    if not meta.is_file():
        raise InputError(
            f"{meta}: expected the name of HOI4D's sequence, got no such file; copy it, or pass "
            "the object's meshes with --obj"
        )
    record = read_record(meta)
    sequence = tuple(record.text("case_flag").strip("/").split("/"))[-ID_PARTS:]
    if len(sequence) != ID_PARTS:
        raise record.refuse("case_flag", "a sequence such as ZY20210800001/H1/C1/N1/S1/s01/T1")
    return read_meshes(sequence, count, case.parents[1], options)


READER = DatasetReader(
    parts, ("merged_data.npy",), clip_is_folder=True, name_parts=2, fps=15.0, convention=base.ORIGIN
)
