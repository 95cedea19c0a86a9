"""Bodies as SMPL parameters: smplx names, AMASS, BOTH57M, Motion-X, and what geneoh writes itself.

All hold the axis-angle of 22 body joints and a translation; they differ in names, in further
fields, and in the axis that points up. Finger poses are absolute (zero: the flat hand); relative
ones are left out.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import BODY_JOINTS, JOINT_NAMES, Skeleton, embedded_skeleton
from geneoh.choices import AXES, Axis
from geneoh.errors import InputError
from geneoh.files.npz import Arrays
from geneoh.files.values import read_values
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.readers.bodies.base import BodyRecording, checked_body, upright_body
from geneoh.readers.bodies.model import RestBody, read_model
from geneoh.readers.clock import rate_fields, rate_of
from geneoh.readers.npz.layouts import quoted
from geneoh.readers.records import Array, Notes, Record, as_record, float32
from geneoh.readers.transforms import axis_angles, read_turns
from geneoh.sequence.validation import LARGEST_ANGLE

OFFSETS = "body_offsets"
"""In our own files: the (52, 3) rest offsets of the skeleton, the first that of the pelvis."""
UP = "body_up"
"""In our own files: the axis of their world that points up."""
FINGER_JOINTS = 30
JAW_AND_EYES = 9
"""Numbers of SMPL-X between body and hands, which we leave at zero."""
MOTION_X = 322
"""Numbers of a frame of Motion-X: root 3, body 63, hands 90, jaw 3, face 50 and 100, translation 3,
betas 10."""
EXPECTED = (
    "a body as 'global_orient', 'body_pose' and 'transl' (smplx), as 'root_orient', 'pose_body' "
    "and 'trans' or 'poses' and 'trans' (AMASS), or a BVH"
)


@dataclass(frozen=True)
class Layout:
    """The field names of one kind of file."""

    title: str
    root: str
    body: str
    translation: str
    hands: tuple[str, ...]
    up: Axis | None = None
    """Axis that points up in all such files; None where it differs."""
    fps: float | None = None
    """Frames a second of all such files."""


SMPLX = "smplx names"
LAYOUTS = (
    Layout(SMPLX, "global_orient", "body_pose", "transl", ("left_hand_pose", "right_hand_pose")),
    Layout("BOTH57M or Motion-X", "root_orient", "body_pose", "trans", ("hand_pose",), "y", 30.0),
    Layout("AMASS", "root_orient", "pose_body", "trans", ("pose_hand",), "z"),
    Layout("AMASS", "poses", "poses", "trans", (), "z"),
)
HANDS_IN_POSES = {156: 66, 165: 75}
"""Index of the hands' first number in AMASS's `poses`, by their width: SMPL-H, and SMPL-X with jaw
and eyes."""


def read_smpl(
    path: Path, *, fps: float | None, up: Axis | None, model: Path | None
) -> Iterator[BodyRecording]:
    """The bodies in an npz, npy, pickle or joblib file, several only in the lists of BOTH57M;
    `InputError` where it holds no body, or an impossible one."""
    values = read_values(path)
    if isinstance(values, np.ndarray):
        values = motion_x(values, path)
    clips = values if isinstance(values, list) and values else [values]
    for index, value in enumerate(clips):
        where = f"{path} clip {index}" if len(clips) > 1 else str(path)
        yield _read_clip(as_record(value, where), fps, up, model)


def _read_clip(
    record: Record, fps: float | None, up: Axis | None, model: Path | None
) -> BodyRecording:
    """The body in one dict of fields."""
    layout = _layout_of(record)
    turns, has_fingers, about_fingers = rotations_of(record, layout)
    transl = record.array(layout.translation, ("T", 3), unit="in metres")
    record.refuse_lengths(layout.root, layout.body, layout.translation)
    betas = betas_of(record)
    rest = rest_body(record, betas, model)
    stored = [record.number(name) for name in rate_fields(record.values)]
    rate, notes = rate_of(stored[0] if stored else layout.fps, fps, record.where)
    motion = BodyMotion(float32(transl) + rest.rest_root, turns)
    stated = record.optional_text(UP)
    up = up or next((axis for axis in AXES if axis == stated), None)
    motion, up, more = upright_body(motion, rest.skeleton, up, usual=layout.up)
    return checked_body(
        BodyRecording(
            motion,
            rest.skeleton,
            rest.rest_root,
            rate,
            f"{record.where} ({layout.title})",
            up,
            has_fingers,
            betas,
            record.optional_text("gender") or "neutral",
            tuple(record.texts("hand_cond")) if "hand_cond" in record else (),
            (*notes, *more, *about_fingers),
        )
    )


def _layout_of(record: Record) -> Layout:
    """The layout whose fields are all there; `InputError` where there is none."""
    for layout in LAYOUTS:
        if all(name in record for name in (layout.root, layout.body, layout.translation)):
            return layout
    raise InputError(
        f"{record.where}: expected {EXPECTED}, got {quoted(record.values) or 'no field at all'}; "
        "rename the fields or export the body again"
    )


def rotations_of(record: Record, layout: Layout) -> tuple[Float[Tensor, "T 52 3 3"], bool, Notes]:
    """Rotations of all joints, whether the fingers come from the file, and notes on them."""
    if layout.root == layout.body:
        width = record.numbers(layout.body).shape[-1]
        if width < 3 * BODY_JOINTS:
            raise record.refuse(layout.body, f"(T, {3 * BODY_JOINTS}) or more numbers in radians")
        poses = record.array(layout.body, ("T", "N"), unit="in radians")
        start = HANDS_IN_POSES.get(width)
        fingers = None if start is None else poses[:, start : start + 3 * FINGER_JOINTS]
        body = in_radians(record, layout.body, poses[:, : 3 * BODY_JOINTS])
    else:
        root = _turns_of(record, layout.root, 1)
        posed = _turns_of(record, layout.body, 21, 23)[:, :63]
        record.refuse_lengths(layout.root, layout.body)
        parts = [in_radians(record, layout.root, root), in_radians(record, layout.body, posed)]
        body = np.concatenate(parts, axis=1)
        fingers = fingers_of(record, layout, len(body))
    fingers, notes = absolute(record, layout, fingers)
    if fingers is not None and not bool((np.abs(fingers) <= LARGEST_ANGLE).all()):
        fingers, notes = None, ("the fingers are not in radians in all frames and were left out",)
    flat = np.zeros((len(body), 3 * FINGER_JOINTS)) if fingers is None else fingers
    vectors = float32(np.concatenate([body, flat], axis=1)).reshape(-1, len(JOINT_NAMES), 3)
    return axis_angle_to_matrix(vectors), fingers is not None, notes


def _turns_of(record: Record, name: str, *counts: int) -> Array:
    """(T, 3J) axis-angle, from axis-angle or, as HMR 2.0 writes, matrices; J is one of `counts`."""
    turns = read_turns(record, name, *counts)
    return (turns if turns.ndim < 4 else axis_angles(turns)).reshape(len(turns), -1)


def in_radians(record: Record, name: str, turns: Array) -> Array:
    """(T, 3J) axis-angle of a field; `InputError` for angles that must be degrees (over 4 pi)."""
    angles = np.linalg.norm(turns.reshape(-1, 3), axis=-1)
    if bool((angles[np.isfinite(angles)] > LARGEST_ANGLE).any()):
        raise record.refuse(name, "axis-angle in radians", "convert degrees to radians")
    return turns


def fingers_of(record: Record, layout: Layout, frames: int) -> Array | None:
    """(T, 90) axis-angle of all fingers; None where the file has none, or PCA coefficients."""
    if not layout.hands or any(name not in record for name in layout.hands):
        return None
    parts = [record.numbers(name) for name in layout.hands]
    if any(len(part) != frames for part in parts if part.ndim):
        record.refuse_lengths(layout.root, *layout.hands)
    whole = [part.reshape(frames, -1) for part in parts if part.ndim and part.size]
    found = np.concatenate(whole, axis=1) if whole else np.zeros((frames, 0))
    return found if found.shape[1] == 3 * FINGER_JOINTS else None


def absolute(record: Record, layout: Layout, fingers: Array | None) -> tuple[Array | None, Notes]:
    """(T, 90) finger poses, None if the file states that they are relative to a mean; and notes.

    Relative fingers (`flat_hand_mean=False`) are smplx's default. A file with smplx's names that
    does not state the convention therefore gets a note.
    """
    flat = record.optional_number("flat_hand_mean")
    if fingers is None or flat or (flat is None and layout.title != SMPLX):
        return fingers, ()
    if flat is None:
        return fingers, ("the fingers are taken as absolute; 'flat_hand_mean' says otherwise",)
    return None, (
        "the fingers are relative to a mean pose (flat_hand_mean=False) and were left out; "
        "add hands_mean to them and save flat_hand_mean=True",
    )


def betas_of(record: Record) -> Float[Tensor, " S"] | None:
    """The shape coefficients; if there is a set per frame, their mean."""
    betas = record.tensor("betas", ("S",), ("T", "S"))
    if betas is not None and not bool(betas.isfinite().all()):
        raise record.refuse("betas", "finite numbers", "correct or remove them")
    return betas if betas is None or betas.ndim == 1 else betas.mean(0)


def rest_body(record: Record, betas: Float[Tensor, " S"] | None, model: Path | None) -> RestBody:
    """The person's joints at rest: from the user's model, from our own file, else the embedded."""
    if model is not None:
        return read_model(model, betas)
    offsets = record.tensor(OFFSETS, (len(JOINT_NAMES), 3), unit="in metres")
    if offsets is None:
        return RestBody(embedded_skeleton(), torch.zeros(3))
    bones = torch.cat([torch.zeros(1, 3), offsets[1:]])
    return RestBody(Skeleton(bones), offsets[0])


def motion_x(values: Any, path: Path) -> dict[str, Array]:
    """The fields of a (T, 322) array of Motion-X, by the names of AMASS."""
    if values.ndim != 2 or values.shape[1] != MOTION_X or values.dtype.kind != "f":
        raise InputError(
            f"{path}: expected a (T, {MOTION_X}) array of Motion-X or {EXPECTED}, got an array of "
            f"{values.shape}; export the body again"
        )
    return {
        "root_orient": values[:, :3],
        "body_pose": values[:, 3:66],
        "hand_pose": values[:, 66:156],
        "trans": values[:, 309:312],
        "betas": values[:, 312:],
    }


def body_fields(body: BodyRecording) -> Arrays:
    """A body in the world of its file, with absolute finger poses (`flat_hand_mean=True`).

    `global_orient`, `body_pose`, `left_hand_pose`, `right_hand_pose` and `transl` are the arguments
    of smplx; `poses`, `trans` and `mocap_frame_rate` repeat them under AMASS's names, for the
    SMPL-X add-on of Blender.
    """
    motion = body.file_motion
    turns = matrix_to_axis_angle(motion.rotations).flatten(1).cpu().numpy()
    transl = (motion.root - body.rest_root).cpu().numpy()
    offsets = body.skeleton.offsets.clone()
    offsets[0] = body.rest_root
    face = np.zeros((len(turns), JAW_AND_EYES), dtype=turns.dtype)
    return {
        "global_orient": turns[:, :3],
        "body_pose": turns[:, 3:66],
        "left_hand_pose": turns[:, 66:111],
        "right_hand_pose": turns[:, 111:],
        "transl": transl,
        "poses": np.concatenate([turns[:, :66], face, turns[:, 66:]], axis=1),
        "trans": transl,
        "betas": np.zeros(10, np.float32) if body.betas is None else body.betas.cpu().numpy(),
        "gender": np.array(body.gender),
        "flat_hand_mean": np.array(True),
        "mocap_frame_rate": np.array(body.fps),
        OFFSETS: offsets.cpu().numpy(),
        UP: np.array(body.up),
    }
