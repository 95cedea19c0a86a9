"""BOTH57M clips: a joblib list of dicts with trans, root_orient, body_pose (T, 21, 3), hand_pose.

hand_pose (T, 30, 3) holds left, then right, absolute, relative to the wrists of an SMPL+H body
(male, zero betas, y up, 30 frames a second). The hands have no place of their own: the body is run
first, which needs the user's SMPL+H model (--body). There is no object.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.pickles.files import read_values
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clips
from geneoh.readers.builders import (
    axis_angles,
    hand_track,
    object_of,
    recordings,
    sequence_of,
    turned,
)
from geneoh.readers.records import Array, Record, as_record, read_record

FPS = 30.0
WRISTS: dict[Side, int] = {"left": 20, "right": 21}
"""Joints of the body."""
BODY_JOINTS = 22


def find(path: Path) -> list[SourceClip]:
    """Every list of clips."""
    return [clip for ending in ("p", "pkl") for clip in clips(path, f"*.{ending}", 1)]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands of every clip in the list."""
    values = read_values(clip.path)
    if not isinstance(values, list) or not values:
        raise InputError(f"{clip.path}: expected a list of clips, got {type(values).__name__}")
    if known.body is None:
        raise InputError(
            f"{clip.path}: the hands hang on an SMPL+H body, got no model of it; pass --body with "
            "your SMPL+H male model"
        )
    rest, parents = read_body(known.body)
    found = []
    for index, value in enumerate(values):
        record = as_record(value, f"{clip.path} clip {index}")
        turns, places = pose_body(record, rest, parents)
        hands = record.array("hand_pose", ("T", 30, 3))
        tracks = []
        for order, side in enumerate(("left", "right")):
            joint = WRISTS[side]
            root = axis_angles(turns[:, joint])[:, None]
            pose = np.concatenate([root, hands[:, 15 * order : 15 * order + 15]], axis=1)
            tracks.append((hand_track(side, pose=pose, wrist=places[:, joint]), ()))
        motion, notes = object_of(known, len(hands), record.where)
        name = f"{clip.name}_{index:03d}"
        sequence = sequence_of(tracks, motion, known.rate(FPS), f"BOTH57M {name}", *notes)
        everywhere = np.ones(len(hands), dtype=bool)
        meshes = tuple(f"{clip.name}_{part}" for part in range(len(motion.meshes)))
        found += recordings(name, sequence, object_known=everywhere, mesh_names=meshes)
    return found


def read_body(path: Path) -> tuple[Array, list[int]]:
    """(22, 3) joints of the mean body and the parent of each, from the official model's file."""
    record = read_record(path)
    verts = record.array("v_template", ("V", 3))
    regressor = record.numbers("J_regressor")
    if regressor.ndim != 2 or regressor.shape[1] != len(verts) or len(regressor) < BODY_JOINTS:
        raise record.refuse("J_regressor", "a matrix over the vertices")
    parents = record.array("kintree_table", (2, "J"))[0, :BODY_JOINTS].astype(np.int64)
    if any(not 0 <= parent < child for child, parent in enumerate(parents) if child):
        raise record.refuse("kintree_table", "parents that stand before their children")
    return (regressor @ verts)[:BODY_JOINTS], parents.tolist()


def pose_body(record: Record, rest: Array, parents: list[int]) -> tuple[Array, Array]:
    """Global rotations (T, 22, 3, 3) and places (T, 22, 3) of the body's joints."""
    root = record.array("root_orient", ("T", 3))[:, None]
    local = turned(np.concatenate([root, record.array("body_pose", ("T", 21, 3))], axis=1))
    turns, places = [local[:, 0]], [rest[0] + record.array("trans", ("T", 3))]
    for joint in range(1, BODY_JOINTS):
        parent = parents[joint]
        turns.append(turns[parent] @ local[:, joint])
        places.append(places[parent] + turns[parent] @ (rest[joint] - rest[parent]))
    return np.stack(turns, axis=1), np.stack(places, axis=1)
