"""Any array of keypoints, or of MANO parameters. NaN means not observed.

A file with fields may also hold 'side', 'fps', 'valid' (T), 'confidence' (T) or (T, N), timestamps
or frame numbers (T), and the object's motion, with the same meaning as in an npz that is read
without --from.

Keypoints: (T, 21, 3) in a npy, or 'joints' in an npz, in a named order (--joint-order); the orders
of WebXR and OpenXR have 25 and 26 points. Metres unless --keypoint-unit says otherwise. --side says
which hand, --obj and --object-pose add the object.

Parameters: 'pose' (T, 48), 'trans' (T, 3) and 'betas' in an npz or a pickle; a bare npy holds them
side by side in this order, 51 or 61 numbers a frame. What the translation moves is never guessed
(--translation wrist or origin); the pose is taken as absolute unless --mean-pose.
"""

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.geometry.mesh import METRES
from geneoh.readers import base, builders
from geneoh.readers.dataset_reader import reads
from geneoh.readers.joint_orders import ORDERS, in_openpose_order
from geneoh.readers.keypoints.mediapipe import refuse_image_landmarks
from geneoh.readers.keypoints.missing import without_missing
from geneoh.readers.npz import layouts
from geneoh.readers.npz.files import in_metres
from geneoh.readers.npz.hands import side_of
from geneoh.readers.npz.objects import read_object
from geneoh.readers.npz.tracks import frames_with_shape, observed_frames, read_confidence
from geneoh.readers.records import IN_RADIANS, Array, Notes, Record

KEYPOINTS_REMEDY = "save them in that shape, or name their order with --joint-order"
PARAMETERS_REMEDY = "save 'pose', 'trans' and 'betas' in these shapes, or side by side in a npy"
"""What to do about a wrong field, which is in a file of the caller's own."""
IN_ORDER = "its columns are taken for pose (48), trans (3) and betas (10), in this order"
POSES = ("object_pose", "camera_pose")


@reads("*.npy", "*.npz", takes=("joint_order", "keypoint_unit", *POSES))
def keypoints(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The one hand of a file, with the caller's object."""
    order = options.joint_order
    count = ORDERS[order].count
    fields = _fields_of(clip.path, lambda array: {"joints": array})
    record = Record(str(clip.path), fields, KEYPOINTS_REMEDY)
    side = side_of(record, options.side)
    points = record.array("joints", ("T", count, 3), ("T", 3 * count), (count, 3))
    if order == "openpose":
        refuse_image_landmarks(points.reshape(-1, count, 3), str(clip.path))
    points = METRES[options.keypoint_unit or "m"] * points.reshape(-1, count, 3)
    record = in_openpose_order(record, points, order)
    record.refuse_lengths("joints", "valid", "confidence")
    points = torch.from_numpy(record.array("joints", ("T", 21, 3)))
    points, confidence, missed = without_missing(points, read_confidence(record, "confidence"))
    joints, notes = observed(record, side, "joints", points.numpy())
    hand = builders.hand_track(side, joints, None if confidence is None else confidence.numpy())
    yield base.ClipParts(
        f"{clip.path.name} (keypoints in the order {order})",
        [hand],
        **beside_hand(record, options, (*missed, *notes)),
    )


@reads("*.npy", "*.npz", "*.pkl", takes=("translation", "mean_pose", *POSES))
def parameters(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The one hand of a file, with the caller's object."""
    fields = _fields_of(clip.path, partial(_columns, clip.path))
    record = Record(str(clip.path), fields, PARAMETERS_REMEDY)
    side = side_of(record, options.side)
    if options.translation is None:
        raise InputError(
            f"{clip.path}: the file does not say what its translation moves; pass --translation "
            "wrist, or --translation origin for that of smplx and manopth"
        )
    betas = record.optional_array("betas", (10,), ("T", 10))
    if betas is not None and betas.ndim == 2:
        betas = betas[frames_with_shape(record, torch.from_numpy(betas)).numpy()].mean(0)
    pose = record.array("pose", ("T", 48), ("T", 16, 3), unit=IN_RADIANS).reshape(-1, 48)
    record.refuse_lengths("pose", "trans", "valid", "confidence")
    pose, notes = observed(record, side, "pose", pose)
    confidence = read_confidence(record, "confidence")
    trust = None if confidence is None else confidence.numpy()
    place = record.array("trans", ("T", 3))
    hand = base.ManoParameters(side, pose, place, betas, confidence=trust)
    if "columns" in record:
        notes = (*notes, IN_ORDER)
    if options.mean_pose is None:
        notes = (*notes, "the pose is taken as absolute axis-angle vectors, not PCA coefficients")
    yield base.ClipParts(
        f"{clip.path.name} (MANO parameters)",
        [hand],
        convention=base.ManoConvention(options.translation, mean_added=bool(options.mean_pose)),
        **beside_hand(record, options, notes),
    )


def _fields_of(path: Path, named: Callable[[Array], dict[str, Array]]) -> dict[str, Array]:
    """The fields of a file; `named` gives those of a bare array. A geneoh-sequence is refused."""
    value = read_values(path)
    if not isinstance(value, dict):
        return named(value)
    if str(value.get("format")) == layouts.FORMAT:
        raise InputError(
            f"{path}: expected bare arrays, got a {layouts.FORMAT}, which needs no source; "
            "give it to `geneoh denoise` without --from"
        )
    return value


def beside_hand(record: Record, options: base.ReaderOptions, notes: Notes) -> dict[str, Any]:
    """Fields of `ClipParts` other than the hand: timestamps, the file's object unless the caller
    passes poses, and notes, also on fields that are ignored."""
    motion, fields = None, layouts.OBJECT_FIELDS[:3]
    if options.object_pose is not None:
        notes = (*notes, *unread(record, fields, "--object-pose"))
    elif any(name in record for name in fields):
        of_object = in_metres(record, "joints", options.keypoint_unit)
        motion = read_object(of_object, options.meshes, 1)
    fields = (*layouts.CAMERA_FIELDS, layouts.CAMERA_POSES)
    camera = unread(record, fields, "--from; --camera and --camera-pose give the camera")
    return {"stamps": record, "object_track": motion, "notes": (*notes, *camera)}


def unread(record: Record, names: Iterable[str], beside: str) -> Notes:
    """A note on fields that are ignored with the option `beside`, but read without it."""
    found = [name for name in names if name in record]
    return (f"{layouts.quoted(found)} of the file: not read beside {beside}",) if found else ()


def observed(record: Record, side: Side, name: str, values: Array) -> tuple[Array, Notes]:
    """(T, ...) values of a field with NaN in the frames that are not observed, and notes."""
    finite = {name: torch.from_numpy(base.finite_frames(values))}
    valid, notes = observed_frames(record, side, layouts.JOINT_NAMES, finite)
    return np.where(valid.numpy().reshape(-1, *[1] * (values.ndim - 1)), values, np.nan), notes


def _columns(path: Path, value: object) -> dict[str, Array]:
    """The fields of a bare array."""
    record = Record(str(path), {"array": value}, PARAMETERS_REMEDY)
    array = record.array("array", ("T", 51), ("T", 61), ("T", 48))
    if array.shape[1] == 48:
        raise InputError(
            f"{path}: 48 parameters are a pose without a place, got no translation; save 'pose' "
            "and 'trans' together with numpy.savez"
        )
    fields = {"columns": array, "pose": array[:, :48], "trans": array[:, 48:51]}
    return {**fields, "betas": array[:, 51:]} if array.shape[1] == 61 else fields
