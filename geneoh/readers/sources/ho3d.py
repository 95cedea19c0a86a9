"""HO-3D v3 as it is distributed: {train,evaluation}/{SEQ}/meta/{frame}.pkl.

handPose (48,) absolute, handTrans (of MANO's origin), handBeta, handJoints3D in MANO's order,
objRot (axis-angle), objTrans; right hand, metres, in OpenGL camera axes (y up, z backward), which
become OpenCV's here. None means not annotated. Objects are YCB models. 30 frames a
second.
"""

import numpy as np

from geneoh.errors import InputError
from geneoh.readers import base, builders, foreign_files, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import Array, Record

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])


@reads("meta/", clip_is_folder=True, name_parts=2, convention=base.ORIGIN, takes=("objects",))
def ho3d(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The right hand and the object, in the camera's frame."""
    files = foreign_files.numbered_files(clip.path / "meta", "*.pkl")
    records = {frame: foreign_files.read_record(path) for frame, path in files.items()}
    if not records:
        raise InputError(f"{clip.path}: expected frames in 'meta', got none; download them")
    frames = max(records) + 1
    pose, betas = field(records, "handPose", frames, 48), field(records, "handBeta", frames, 10)
    betas = betas[np.isfinite(betas).all(1)]
    joints = field(records, "handJoints3D", frames, 63).reshape(frames, 21, 3)
    joints = joints[:, builders.OPENPOSE_FROM_MANO]
    to_opencv = np.tile(np.eye(4), (frames, 1, 1))
    to_opencv[:, :3, :3] = OPENCV_FROM_OPENGL
    mean = betas.mean(0) if len(betas) else None
    places = {"joints": builders.joints_if_complete(joints, pose), "to_world": to_opencv}
    wrist = field(records, "handTrans", frames, 3)
    hand = base.ManoParameters("right", pose, wrist, mean, **places)
    turn = transforms.rotation_matrices(field(records, "objRot", frames, 3))
    name = object_name(records)
    folder = options.objects or base.ancestor(clip.path, 2) / "models"
    motion = to_opencv @ transforms.rigid_matrices(turn, field(records, "objTrans", frames, 3))
    checks = base.CrossChecks({"right": joints @ OPENCV_FROM_OPENGL})
    meshes = {f"ho3d_{name}": find_mesh([folder / name / "textured_simple.obj"], name)}
    yield base.ClipParts(f"HO-3D {clip.name}", [hand], meshes, motion, cross_checks=checks)


def field(records: dict[int, Record], name: str, frames: int, count: int) -> Array:
    """(T, count) of one field; NaN where it is missing, None, or shorter (the root alone)."""
    found = {}
    for frame, record in records.items():
        if record.values.get(name) is None:
            continue
        values = record.numbers(name).ravel()
        if len(values) == count:
            found[frame] = values
        elif name != "handJoints3D" or len(values) != 3:
            raise record.refuse(name, f"{count} numbers")
    return foreign_files.by_frame(found, frames, count)


def object_name(records: dict[int, Record]) -> str:
    """The object of the sequence, by the first frame that names it."""
    for record in records.values():
        if record.values.get("objName") is not None:
            return record.text("objName").replace("/", "_")
    raise InputError(f"{next(iter(records.values())).where}: expected 'objName', got none")
