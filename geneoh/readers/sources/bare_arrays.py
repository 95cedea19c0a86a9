"""Any array of keypoints, or of MANO parameters. NaN means not observed.

Keypoints: (T, 21, 3) in a npy, or 'joints' in an npz, in a named order (--joint-order); the orders
of WebXR and OpenXR have 25 and 26 points. Metres unless --keypoint-unit says otherwise. --side says
which hand, --obj and --object-pose add the object.

Parameters: 'pose' (T, 48), 'trans' (T, 3) and 'betas' in an npz or a pickle; a bare npy holds them
side by side, 51 or 61 numbers a frame. What the translation moves is never guessed (--translation
wrist or origin); the pose is taken as absolute unless --mean-pose.
"""

from pathlib import Path

import numpy as np

from geneoh.errors import ConfigError, InputError
from geneoh.files.values import read_values
from geneoh.geometry.mesh import METRES
from geneoh.readers import base, builders, joint_orders
from geneoh.readers.dataset_reader import reads
from geneoh.readers.records import Record


@reads("*.npy", "*.npz", fps_assumed=True)
def keypoints(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The one hand of a file, with the caller's object."""
    order = options.joint_order
    if order not in joint_orders.ORDERS:
        raise ConfigError(f"--joint-order {order}: expected {', '.join(joint_orders.ORDERS)}")
    value = read_values(clip.path)
    record = Record(str(clip.path), value if isinstance(value, dict) else {"joints": value})
    side = options.side_of(record)
    count = joint_orders.ORDERS[order].count
    points = record.array("joints", ("T", count, 3), ("T", 3 * count), (count, 3))
    points = METRES[options.keypoint_unit or "m"] * points.reshape(-1, count, 3)
    joints, trust = joint_orders.openpose_order(points, order)
    confidence = None if trust.all() else np.tile(trust, (len(joints), 1))
    hand, checks = builders.hand_track(side, joints, confidence), base.CrossChecks({side: joints})
    source = f"{clip.path.name} (keypoints in the order {order})"
    yield base.ClipParts(source, [hand], cross_checks=checks)


@reads("*.npy", "*.npz", "*.pkl", fps_assumed=True)
def parameters(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The one hand of a file, with the caller's object."""
    value = read_values(clip.path)
    record = Record(str(clip.path), value) if isinstance(value, dict) else columns(clip.path, value)
    side = options.side_of(record)
    if options.translation is None:
        raise InputError(
            f"{clip.path}: what the translation moves is not said; pass --translation wrist, "
            "or --translation origin for that of smplx and manopth"
        )
    betas = record.optional_array("betas", (10,), ("T", 10))
    pose = record.array("pose", ("T", 48), ("T", 16, 3)).reshape(-1, 48)
    betas = None if betas is None else betas.reshape(-1, 10).mean(0)
    hand = base.ManoParameters(side, pose, record.array("trans", ("T", 3)), betas)
    notes = () if options.mean_pose is not None else ("the pose is taken as absolute",)
    use = base.ManoConvention(options.translation, mean_added=bool(options.mean_pose))
    yield base.ClipParts(f"{clip.path.name} (MANO parameters)", [hand], notes=notes, convention=use)


def columns(path: Path, value: object) -> Record:
    """The fields of a bare array."""
    array = Record(str(path), {"array": value}).array("array", ("T", 51), ("T", 61), ("T", 48))
    if array.shape[1] == 48:
        raise InputError(
            f"{path}: 48 parameters are a pose without a place, got no translation; save 'pose' "
            "and 'trans' together with numpy.savez"
        )
    fields = {"pose": array[:, :48], "trans": array[:, 48:51]}
    return Record(str(path), {**fields, "betas": array[:, 51:]} if array.shape[1] == 61 else fields)
