"""BOTH57M clips: a joblib list of dicts with trans, root_orient, body_pose (T, 21, 3), hand_pose.

hand_pose (T, 30, 3) holds left, then right, absolute, relative to the wrists of an SMPL+H body
(male, zero betas, y up, 30 frames a second). The hands have no place of their own: the body is
posed first, which needs the user's SMPL+H model (--body). There is no object.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.readers import base, builders, foreign_files, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.records import Array, Record, as_record

WRISTS: dict[Side, int] = {"left": 20, "right": 21}
"""Joints of the body."""
FINGERS: dict[Side, slice] = {"left": slice(0, 15), "right": slice(15, 30)}
"""Joints of hand_pose."""
BODY_JOINTS = 22


@reads("*.p", "*.pkl")
def both57m(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands of each clip in a list, with the caller's object."""
    values = read_values(clip.path)
    if not isinstance(values, list) or not values:
        raise InputError(f"{clip.path}: expected a list of clips, got {type(values).__name__}")
    if options.body is None:
        raise InputError(
            f"{clip.path}: the hands are posed with an SMPL+H body, got no model of it; pass "
            "--body with your SMPL+H male model"
        )
    rest, parents = read_body(options.body)
    for index, value in enumerate(values):
        record = as_record(value, f"{clip.path} clip {index}")
        turns, places = pose_body(record, rest, parents)
        fingers = record.array("hand_pose", ("T", 30, 3))
        record.refuse_lengths("hand_pose", "root_orient")
        hands = []
        for side, joint in WRISTS.items():
            root = transforms.axis_angles(turns[:, joint])[:, None]
            pose = np.concatenate([root, fingers[:, FINGERS[side]]], axis=1)
            hands.append(builders.hand_track(side, pose=pose, wrist=places[:, joint]))
        name = f"{clip.name}_{index:03d}"
        yield base.ClipParts(f"BOTH57M {name}", hands, name=name)


def read_body(path: Path) -> tuple[Array, list[int]]:
    """(22, 3) joints of the mean body and the parent of each, from the official model's file."""
    record = foreign_files.read_record(path)
    verts = record.array("v_template", ("V", 3))
    regressor = record.numbers("J_regressor")
    if regressor.ndim != 2 or regressor.shape[1] != len(verts) or len(regressor) < BODY_JOINTS:
        raise record.refuse("J_regressor", "a matrix over the vertices")
    parents = record.array("kintree_table", (2, "J"))[0, 1:BODY_JOINTS]
    if len(parents) != BODY_JOINTS - 1 or not all(
        0 <= parent <= child for child, parent in enumerate(parents)
    ):
        raise record.refuse("kintree_table", "parents that stand before their children")
    return (regressor @ verts)[:BODY_JOINTS], [0, *parents.astype(np.int64).tolist()]


def pose_body(record: Record, rest: Array, parents: list[int]) -> tuple[Array, Array]:
    """Global rotations (T, 22, 3, 3) and places (T, 22, 3) of the body's joints."""
    root, trans = record.array("root_orient", ("T", 3)), record.array("trans", ("T", 3))
    body = record.array("body_pose", ("T", 21, 3))
    record.refuse_lengths("root_orient", "body_pose", "trans")
    local = transforms.rotation_matrices(np.concatenate([root[:, None], body], axis=1))
    turns, places = [local[:, 0]], [rest[0] + trans]
    for joint in range(1, BODY_JOINTS):
        parent = parents[joint]
        turns.append(turns[parent] @ local[:, joint])
        places.append(places[parent] + turns[parent] @ (rest[joint] - rest[parent]))
    return np.stack(turns, axis=1), np.stack(places, axis=1)
