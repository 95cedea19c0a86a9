"""HO-3D v3 and H2O-3D as they are distributed: {train,evaluation}/{SEQ}/meta/{frame}.pkl.

HO-3D has handPose (48,) absolute, handTrans (of MANO's origin), handBeta, handJoints3D in MANO's
order, of a right hand; H2O-3D has rightHandPose, leftHandPose and so on, with one handBeta for both
hands, the left one as shipped. Both have objRot (axis-angle) and objTrans. Metres, in OpenGL camera
axes (y up, z backward), which become OpenCV's here. None means not annotated. Objects are YCB
models. 30 frames a second.
"""

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers import base, builders, foreign_files, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.joint_orders import openpose_order
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import Array, Record

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""From the camera's axes of OpenGL to those of OpenCV."""

reads_metas = reads(
    "meta/", clip_is_folder=True, name_parts=2, convention=base.ORIGIN, takes=("objects",)
)


@reads_metas
def ho3d(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The right hand and the object, in the camera's frame."""
    yield parts_of(clip, options, "HO-3D", {"right": "hand"})


@reads_metas
def h2o3d(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the object, in the camera's frame."""
    yield parts_of(clip, options, "H2O-3D", {"right": "rightHand", "left": "leftHand"})


def parts_of(
    clip: base.SourceClip, options: base.ReaderOptions, title: str, prefixes: dict[Side, str]
) -> base.ClipParts:
    """The hands whose fields have these prefixes, and the object."""
    files = foreign_files.numbered_files(clip.path / "meta", "*.pkl")
    records = {frame: foreign_files.read_record(path) for frame, path in files.items()}
    if not records:
        raise InputError(f"{clip.path}: expected frames in 'meta', got none; download them")
    frames = max(records) + 1
    wanted = {f"{prefix}{name}" for prefix in prefixes.values() for name in ("Pose", "Joints3D")}
    if not any(wanted & record.values.keys() for record in records.values()):
        raise InputError(
            f"{clip.path}: expected the fields of {title}, such as {min(wanted)}, got frames "
            "without them; choose ho3d for files of one hand, and h2o3d for those of two"
        )
    joints: dict[Side, Array] = {}
    for side, prefix in prefixes.items():  # in MANO's order, and in OpenGL's axes
        stored = field(records, f"{prefix}Joints3D", frames, 63).reshape(frames, 21, 3)
        joints[side], _ = openpose_order(stored, "mano")
    hands = [hand_of(records, side, prefix, joints[side]) for side, prefix in prefixes.items()]
    turn = transforms.rotation_matrices(field(records, "objRot", frames, 3))
    name = object_name(records)
    folder = options.objects or base.ancestor(clip.path, 2) / "models"
    motion = transforms.rigid_matrices(turn, field(records, "objTrans", frames, 3))
    checks = base.CrossChecks(
        {side: own @ OPENCV_FROM_OPENGL[:3, :3] for side, own in joints.items()}
    )
    meshes = {f"ho3d_{name}": find_mesh([folder / name / "textured_simple.obj"], name)}
    motion = OPENCV_FROM_OPENGL @ motion
    return base.ClipParts(f"{title} {clip.name}", hands, meshes, motion, cross_checks=checks)


def hand_of(
    records: dict[int, Record], side: Side, prefix: str, joints: Array
) -> base.ManoParameters:
    """One hand with its stored keypoints, and the mean of the betas of its frames."""
    frames = len(joints)
    pose = field(records, f"{prefix}Pose", frames, 48)
    betas = field(records, "handBeta", frames, 10)
    betas = betas[np.isfinite(betas).all(1)]
    places = field(records, f"{prefix}Trans", frames, 3)
    stored = builders.joints_if_complete(joints, pose)
    about = {"joints": stored, "to_world": np.tile(OPENCV_FROM_OPENGL, (frames, 1, 1))}
    mean = betas.mean(0) if len(betas) else None
    return base.ManoParameters(side, pose, places, mean, **about)


def field(records: dict[int, Record], name: str, frames: int, count: int) -> Array:
    """(T, count) of one field; NaN where it is missing, None, or shorter (the root alone)."""
    found = {}
    for frame, record in records.items():
        if record.values.get(name) is None:
            continue
        values = record.numbers(name).ravel()
        if len(values) == count:
            found[frame] = values
        elif not name.endswith("Joints3D") or len(values) != 3:
            raise record.refuse(name, f"{count} numbers")
    return foreign_files.by_frame(found, frames, count)


def object_name(records: dict[int, Record]) -> str:
    """The object of the sequence, by the first frame that names it."""
    for record in records.values():
        if record.values.get("objName") is not None:
            return record.text("objName").replace("/", "_")
    raise InputError(f"{next(iter(records.values())).where}: expected 'objName', got none")
