"""The layouts of npz files that are read: their fields, and how to recognise them.

A file that fits two layouts is refused.
"""

import difflib
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np

from geneoh.choices import SIDES, Side
from geneoh.errors import InputError, shortened
from geneoh.files.npz import read_archive
from geneoh.files.outputs import SEQUENCE_FORMAT
from geneoh.readers.records import RESHAPE, Record
from geneoh.readers.registry import SOURCES

Layout = Literal["geneoh-sequence", "smplx", "taco", "joints"]

FORMAT, VERSION = SEQUENCE_FORMAT, 1

HAND_FIELDS = ("pose", "wrist", "betas", "joints", "valid", "confidence")
HAND_FIELDS += ("joint_spread", "camera_ray")
"""Fields of a hand in geneoh's own layout, without the side that precedes each name."""
OBJECT_FIELDS = ("object_rotation", "object_translation", "obj_pose", "object_valid")
OBJECT_FIELDS += ("object_filled",)
"""Fields of the object in every layout."""
CAMERA_FIELDS = ("camera_ray", "camera_position")
"""Fields of the camera that saw all hands, in every layout."""
CAMERA_POSES = "camera_to_world"
"""Field of the poses of a moving camera, in every layout."""
CAMERA_NAMES = ("camera_pose", "camera_poses", "cam_pose", "cam_poses")
"""Names for the poses of a camera that are not read."""
MESH_FIELDS = ("object_files", "object_hashes")
"""Paths and hashes of the object's meshes, in files that geneoh wrote."""
SMPLX_PARAMETERS = ("global_orient", "hand_pose", "transl")
JOINT_NAMES = {name: name for name in ("joints", "valid", "confidence")}
TACO_NAMES = {
    **{"pose": "hand_pose", "wrist": "hand_trans", "betas": "hand_shape"},
    **{"joints": "hand_joints", "valid": "hand_valid"},
}
"""Names of a hand's fields in the layout of bare joints, and in TACO's."""


def own_names(side: Side) -> dict[str, str]:
    """Names of one hand's fields in geneoh's own layout, by `HAND_FIELDS`."""
    return {name: f"{side}_{name}" for name in HAND_FIELDS}


OWN_FIELDS = tuple(name for side in SIDES for name in own_names(side).values())
LAYOUTS: dict[Layout, tuple[str, ...]] = {
    "geneoh-sequence": ("format", "version", "fps", "hand_model", "source", *OWN_FIELDS),
    "smplx": (
        *(*SMPLX_PARAMETERS, "betas", "flat_hand_mean", "use_pca", "hand_model"),
        *(*JOINT_NAMES, "side", "fps"),
    ),
    "taco": (*TACO_NAMES.values(), "side", "fps"),
    "joints": (*JOINT_NAMES, "side", "fps"),
}
"""The fields that each layout knows, besides those of the object."""

MARKS: dict[Layout, tuple[str, ...]] = {
    "smplx": ("global_orient", "transl"),
    "taco": ("hand_trans", "hand_joints", "hand_shape", "hand_valid"),
}
"""Fields that identify a layout, because no other has them."""

BODY_MARKS = (("body_pose",), ("pose_body",), ("poses", "trans"))
"""Sets of fields that identify a body, by the names of smplx or AMASS."""

SOURCE_MARKS = {
    "dynhamr": ("root_orient", "pose_body", "is_right"),
    "egoallo": ("Ts_world_root", "body_quats"),
    "video_to_data": ("camera_to_world_transform", "hand_right_finger_pose"),
}
"""Sets of fields that identify a source of `geneoh.readers.registry.SOURCES`."""

POSE_NAMES = ("pose", "poses", "theta", "thetas", "fullpose", "full_pose", "mano_pose")
"""Common names of a single field with MANO's whole pose: global orientation and fingers."""

BODY_LEFT_OUT = (
    "the body that the hands belong to is left out: its arms would not meet hands that have moved"
)
"""Note on a file of hands by smplx's names that also holds a body pose."""

MOST_NAMES = 25
"""Largest number of field names that a message lists."""

OBJECT_NAMES = ("object_pose", "object_poses")
"""Names for the poses of the object that are not read; `obj_pose` is."""
TYPO_CUTOFF = 0.85
"""Similarity above which an unknown field name is taken for a misspelt one."""


def read_fields(path: Path) -> Record:
    """The fields of an npz; `InputError` for other files, and for anything but plain arrays."""
    remedy = f"{RESHAPE} or export the file again"
    return Record(str(path), read_archive(path), remedy, most_frames=sys.maxsize)


def layout_of(record: Record) -> Layout:
    """The one layout that a file is in; `InputError` where none fits, or more than one does."""
    if "format" in record:
        refuse_other_format(record)
        return FORMAT
    if any(name in record for name in OWN_FIELDS):
        raise InputError(
            f"{record.where}: has fields of the geneoh-sequence layout, got no 'format'; "
            f"add format='{FORMAT}' and version={VERSION}"
        )
    for source, names in SOURCE_MARKS.items():
        if all(name in record for name in names):
            raise InputError(
                f"{record.where}: has the fields of {SOURCES[source].title} ({quoted(names)}), got "
                f"no --from; pass --from {source}"
            )
    found: dict[Layout, list[str]] = {
        layout: [name for name in marks if name in record] for layout, marks in MARKS.items()
    }
    # smplx has no name for keypoints, so `joints` may stand beside it; TACO has `hand_joints`.
    if "joints" in record and not found["smplx"]:
        found["joints"] = ["joints"]
    found = {layout: names for layout, names in found.items() if names}
    if not found and (pose := next((name for name in POSE_NAMES if is_of_hand(record, name)), "")):
        raise InputError(
            f"{record.where}: '{pose}' must be called global_orient and hand_pose, beside transl "
            "(smplx), got MANO's parameters by another name; rename them, or call them 'pose' and "
            "'trans' and pass --from parameters with --translation wrist or origin"
        )
    bodies = [name for name in BODY_MARKS if all(part in record for part in name)]
    if bodies and found.keys() <= {"smplx"} and "hand_pose" not in record:
        raise InputError(
            f"{record.where}: expected a hand, got a body ({quoted(bodies[0])}); save "
            "'hand_pose' with 'global_orient' and 'transl' of the hand itself, not of the pelvis, "
            "or give the body to `geneoh generate --body`"
        )
    if len(found) == 1:
        return next(iter(found))
    if not found:
        raise InputError(
            f"{record.where}: expected a hand as 'right_joints' or 'right_pose' (geneoh-sequence), "
            "'global_orient' (smplx), 'hand_trans' (TACO) or 'joints', got "
            f"{quoted(record.values) or 'no field at all'}; rename the fields"
        )
    choices = " or ".join(f"{quoted(names)} ({layout})" for layout, names in found.items())
    raise InputError(
        f"{record.where}: the hand must come in one layout, got the fields of {len(found)}; "
        f"remove {choices}"
    )


def is_of_hand(record: Record, name: str) -> bool:
    """Whether a field has MANO's pose in each frame: 48 numbers, or 16 axis-angle vectors."""
    value = record.values.get(name)
    return isinstance(value, np.ndarray) and value.shape[1:] in ((48,), (16, 3))


def refuse_other_format(record: Record) -> None:
    """Raise unless the file is in our own layout, of a version that can be read."""
    if record.text("format") != FORMAT:
        raise record.refuse("format", f"'{FORMAT}'", "remove it to have the other fields read")
    if record.optional_number("version") != VERSION:
        remedy = "write it with this geneoh, or install the geneoh that wrote it"
        raise record.refuse("version", str(VERSION), remedy)


def misspelt_fields(record: Record, layout: Layout) -> list[str]:
    """Warnings for unknown fields whose names resemble a known field that the file lacks."""
    known = {*LAYOUTS[layout], *OBJECT_FIELDS, *CAMERA_FIELDS, CAMERA_POSES, *MESH_FIELDS}
    missing = sorted(known - set(record.values))
    unknown = [name for name in record.values if name not in known]
    has_poses = any(name in record for name in OBJECT_FIELDS[:3])
    meant = {} if has_poses else {name: ["obj_pose"] for name in OBJECT_NAMES}
    if CAMERA_POSES not in record:
        meant |= {name: [CAMERA_POSES] for name in CAMERA_NAMES}
    close = [
        (name, meant.get(name) or difflib.get_close_matches(name, missing, 1, TYPO_CUTOFF))
        for name in unknown
    ]
    warning = "'{}' is not read; is it '{}'?"
    return [warning.format(shortened(str(name), 40), match[0]) for name, match in close if match]


def quoted(names: Iterable[object]) -> str:
    """Field names for a message, the first `MOST_NAMES` of them."""
    listed = list(names)
    more = [f"and {len(listed) - MOST_NAMES} more"] if len(listed) > MOST_NAMES else []
    return ", ".join([*(f"'{shortened(str(name), 40)}'" for name in listed[:MOST_NAMES]), *more])
