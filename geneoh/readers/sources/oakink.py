"""OakInk's image set as it is distributed:
image/anno/general_info/{seq}__{ts}__{sbj}__{frame}__{cam}.

hand_anno holds hand_pose (16, 4) quaternions with the real part first, hand_shape and hand_tsl in
the world (translation of the wrist, absolute pose); obj_anno is object to world, for the mesh with
its bounding box centred; cam_extr is world to camera, which is the frame of hand_j. Right hands
only, metres, 30 frames a second.
"""

from collections.abc import Iterable
from dataclasses import replace
from glob import escape
from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.readers import base
from geneoh.readers.builders import hand_by_frame, joints_if_complete
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import by_frame, field_by_frame, read_array, read_record
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, Record
from geneoh.readers.transforms import inverse


def sequences(found: Iterable[Path], path: Path) -> Iterable[Path]:
    """The sequence and person that each annotation of a frame belongs to."""
    for file in found:
        words = words_of(file)
        if file.parent.name == "general_info" and len(words) == 5:
            yield file.with_name("__".join(words[:3]))


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """One person's hand and the object, in the world, from whichever camera has each frame."""
    folder, name = clip.path.parent, clip.path.name
    files: dict[int, Path] = {}
    for file in sorted(folder.glob(f"{escape(name)}__*.pkl")):
        frame = words_of(file)[3]
        if frame.isdecimal() and int(frame) < FRAME_LIMIT:
            files.setdefault(int(frame), file)
    if not files:
        raise InputError(f"{clip.path}: expected frames of this sequence, got none")
    frames = max(files) + 1
    records = {frame: read_record(file) for frame, file in files.items()}
    hands = {frame: record.record("hand_anno") for frame, record in records.items()}
    stored = {
        frame: read_joints(folder.parent / "hand_j" / file.name, records[frame])
        for frame, file in files.items()
    }
    joints = by_frame(stored, frames, 21, 3)
    hand = hand_by_frame(
        "right", hands, frames, "hand_pose", "hand_tsl", "hand_shape", quaternions=True
    )
    item = words_of(clip.path)[0].split("_")[0]
    models = options.objects or folder.parents[1] / "obj"
    places = [models / f"{item}{ending}" for ending in (".obj", ".ply")]
    yield base.ClipParts(
        f"OakInk {name}",
        [replace(hand, joints=joints_if_complete(joints, hand.translation))],
        {f"oakink_{item}": find_mesh(places, item, centred=True)},
        field_by_frame(records, "obj_anno", frames, 4, 4),
        cross_checks=base.CrossChecks(joints={"right": joints}),
    )


def words_of(path: Path) -> list[str]:
    """Sequence, time stamp, person, frame and camera out of a file's name."""
    return path.stem.split("__")


def read_joints(file: Path, record: Record) -> Array:
    """(21, 3) keypoints in the world; NaN without the file of them."""
    if not file.is_file():
        return np.full((21, 3), np.nan)
    joints = read_array(file, (21, 3))
    to_world = inverse(record.array("cam_extr", (4, 4)), record.where)
    return joints @ to_world[:3, :3].T + to_world[:3, 3]


READER = DatasetReader(parts, ("*__*__*__*__*.pkl",), choose=sequences)
