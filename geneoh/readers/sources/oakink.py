"""OakInk's image set as it is distributed:
image/anno/general_info/{seq}__{ts}__{sbj}__{frame}__{cam}.

hand_anno holds hand_pose (16, 4) quaternions with the real part first, hand_shape and hand_tsl in
the world (translation of the wrist, absolute pose); obj_anno is object to world, for the mesh with
its bounding box centred; cam_extr is world to camera, which is the frame of hand_j. Right hands
only, metres, 30 frames a second.
"""

from collections.abc import Iterator
from glob import escape
from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.readers.base import CrossChecks, ReaderOptions, SourceClip
from geneoh.readers.builders import ManoConvention, ManoParameters, joints_if_complete
from geneoh.readers.dataset_reader import ClipParts, DatasetReader
from geneoh.readers.foreign_files import by_frame, field_by_frame, read_array, read_record
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, Record
from geneoh.readers.transforms import axis_angles_of_wxyz, inverse


class OakInkReader(DatasetReader):
    """One person's hand and the object, in the world, from whichever camera has each frame."""

    patterns = ("*__*__*__*__*.pkl",)
    convention = ManoConvention("wrist")

    def accepts(self, match: Path) -> bool:
        """Annotations of frames."""
        return match.parent.name == "general_info" and len(words_of(match)) == 5

    def clip_at(self, match: Path) -> SourceClip:
        """The sequence and person that a frame belongs to."""
        path = match.with_name("__".join(words_of(match)[:3]))
        return super().clip_at(path)

    def parts(self, clip: SourceClip, options: ReaderOptions) -> Iterator[ClipParts]:
        """The one interaction of a sequence."""
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
        quaternions = field_by_frame(hands, "hand_pose", frames, 16, 4)
        translation = field_by_frame(hands, "hand_tsl", frames, 3)
        joints = by_frame(
            {
                frame: read_joints(folder.parent / "hand_j" / file.name, records[frame])
                for frame, file in files.items()
            },
            *(frames, 21, 3),
        )
        item = words_of(clip.path)[0].split("_")[0]
        models = options.objects or folder.parents[1] / "obj"
        places = [models / f"{item}{ending}" for ending in (".obj", ".ply")]
        hand = ManoParameters(
            "right",
            axis_angles_of_wxyz(quaternions),
            translation,
            np.mean([hand.array("hand_shape", (10,)) for hand in hands.values()], axis=0),
            joints=joints_if_complete(joints, translation),
        )
        yield ClipParts(
            f"OakInk {name}",
            [hand],
            {f"oakink_{item}": read_mesh(find_mesh(places, item), centred=True)},
            field_by_frame(records, "obj_anno", frames, 4, 4),
            cross_checks=CrossChecks(joints={"right": joints}),
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


READER = OakInkReader()
