"""Hand landmarks of MediaPipe, WebXR or OpenXR.

MediaPipe's results as JSON are read by `geneoh.readers.keypoints.mediapipe`, other JSON with points
of hands by `geneoh.readers.keypoints.json_hands`, and tables of points as CSV by
`geneoh.readers.keypoints.tables`. JSON may also be in a small schema of our own:

    {"format": "geneoh-landmarks", "version": 1, "order": "openpose" | "webxr" | "openxr",
     "fps": 30, "camera": [0, 0, 0], "hands": {"right": [frame, ...], "left": [frame, ...]}}

A frame is null where the hand was not seen, else {"points": [[x, y, z], ...], "confidence": 0.9}
with the points in metres and one common frame of reference; MediaPipe's landmarks are in OpenPose's
order. Sides are the subject's own. "camera", the position of the camera in that frame, may be left
out. "timestamps" or "frame_ids", one a frame, may stand beside "fps" or in its place
(`geneoh.readers.clock`).
"""

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from geneoh.choices import OTHER_SIDE, SIDES, JointOrder, Side
from geneoh.errors import InputError
from geneoh.files.journal import JOURNALS
from geneoh.geometry.mesh import METRES
from geneoh.readers import base, builders, foreign_files, joint_orders
from geneoh.readers.checks.hands import curls_backward
from geneoh.readers.column_names import words_of
from geneoh.readers.dataset_reader import reads
from geneoh.readers.keypoints.json_hands import read_hands
from geneoh.readers.keypoints.mediapipe import (
    NOTES,
    Landmarks,
    LandmarkTrack,
    Tracks,
    frames_in,
    read_results,
)
from geneoh.readers.keypoints.missing import without_missing
from geneoh.readers.keypoints.picture import camera_of, placed_before_camera
from geneoh.readers.keypoints.tables import as_rows, points_in_rows, read_rows
from geneoh.readers.npz.hands import side_of
from geneoh.readers.npz.layouts import quoted
from geneoh.readers.records import Notes, Record, as_record, described, float32

FORMAT, VERSION = "geneoh-landmarks", 1
OF_OPENPOSE = re.compile(r".*?(\d+)_keypoints\.json")
"""Name of a file of OpenPose, with the number of its frame."""
SWAPPED_NOTE = (
    "both hands bend backward for the sides that the file names: the sides were exchanged"
)
TURNED_NOTE = "by its fingers it is a {} hand, which is taken for its side; --side says otherwise"
OF_OBJECT = {"object", "objects", "obj"}
"""Words in names of fields about an object."""
AS_DESCRIBED = "write it as the page on estimators says (Headsets)"


def _clips(found: Iterable[Path], path: Path) -> Iterable[Path]:
    """The clips: single files, and folders of OpenPose, which writes one file per frame."""
    files = [file for file in found if file == path or file.name not in JOURNALS]
    inside = {f: f.parent for f in files if f != path and OF_OPENPOSE.fullmatch(f.name)}
    return dict.fromkeys(inside.get(file, file) for file in files)


@reads(
    *("*.json", "*.jsonl", "*.csv"),
    choose=_clips,
    takes=("joint_order", "keypoint_unit", "object_pose", "camera_pose", "focal", "image_size"),
)
def landmarks(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands, with the caller's object."""
    camera = camera_of(options)
    placing = camera is not None
    found = read_landmarks(clip.path, options.side, options.joint_order, in_picture=placing)
    scale = METRES[options.keypoint_unit or found.unit]
    if camera is not None:
        found, scale = placed_before_camera(found, *camera, str(clip.path)), 1.0
    hands, notes = [], list(found.notes)
    for side, track in found.tracks.items():
        assert side is not None, "with_sides gives each hand a side"
        points, trust = torch.from_numpy(scale * track.points), float32(track.confidence)
        joints, confidence, missed = without_missing(points, trust)
        sure = None if confidence is None else confidence.numpy()
        hands.append(builders.hand_track(side, joints.numpy(), sure))
        notes += missed
    yield base.ClipParts(
        clip.path.name,
        hands,
        first=found.first,
        stamps=found.stamps,
        notes=tuple(notes),
        camera=None if found.camera is None else scale * found.camera,
    )


def read_landmarks(
    path: Path, side: Side | None, order: JointOrder, *, in_picture: bool = False
) -> Landmarks:
    """The hands of a file in any supported format, each with its side.

    `side` is the caller's, `order` is the keypoint order of points without names, and `in_picture`
    allows MediaPipe's landmarks of the picture alone.
    """
    if path.suffix.lower() == ".csv":
        rows, names = read_rows(path)
        found = with_sides(points_in_rows(rows, names, path, side, order), str(path), side)
    else:
        value = read_value(path)
        found = landmarks_in(value, path, side, order, in_picture=in_picture)
        frames = [each for each in (value, *frames_in(value)) if isinstance(each, dict)]
        names = list(dict.fromkeys(str(name) for frame in frames for name in frame))
    return replace(found, notes=(*found.notes, *notes_on_object(names)))


def landmarks_in(
    value: Any, path: Path, side: Side | None, order: JointOrder, *, in_picture: bool = False
) -> Landmarks:
    """As `read_landmarks`, from the value of a JSON file."""
    where = str(path)
    found = read_results(value, where, side, in_picture=in_picture)
    if order != "openpose" and (found or is_own(value)):
        raise InputError(
            f"{path}: --joint-order is for points in a list or with numbers, got JSON, which says "
            "its order; drop it"
        )
    if found is None and not is_own(value):
        table = as_rows(value)
        found = points_in_rows(*table, path, side, order) if table else None
        found = found or read_hands(value, where, side, order)
    return with_sides(found, where, side) if found else own_landmarks(value, where)


def notes_on_object(names: Iterable[str]) -> Notes:
    """A note on fields or columns about an object, which are not read."""
    unread = [name for name in names if not OF_OBJECT.isdisjoint(words_of(name))]
    cure = "a file of the object's poses alone can be given as --object-pose"
    return (f"not read of this file: {quoted(unread)}; {cure}",) if unread else ()


def read_value(path: Path) -> Any:
    """The value of a JSON file, or the frames in a folder of OpenPose by frame number."""
    if path.is_file():
        return foreign_files.read_json(path)
    named = ((OF_OPENPOSE.fullmatch(file.name), file) for file in sorted(path.iterdir()))
    return {str(int(name[1])): foreign_files.read_json(file) for name, file in named if name}


def is_own(value: Any) -> bool:
    """Whether JSON states that it has our own schema, or holds the frames of a stream."""
    first = value[0] if isinstance(value, list) and value else value
    stream = {f"{side}_{name}" for side in SIDES for name in ("joints", "pose")}
    return isinstance(first, dict) and bool({"format", *stream} & first.keys())


def own_landmarks(value: Any, where: str) -> Landmarks:
    """The hands in a JSON of our own schema."""
    record = own_record(value, where)
    order = record.optional_text("order") or "openpose"
    if order not in joint_orders.ORDERS:
        raise record.refuse("order", f"one of {', '.join(joint_orders.ORDERS)}")
    hands = record.record("hands")
    tracks: Tracks = {
        side: _read_frames(steps, order, hands.where)
        for side, steps in frames_of_hands(record, hands).items()
    }
    return Landmarks(tracks, (), record, camera=record.optional_array("camera", (3,)))


def own_record(value: Any, where: str) -> Record:
    """The fields of a JSON of our own schema, of a version that is read."""
    if not is_own(value):
        got = quoted(value) if isinstance(value, dict) else described(value)
        raise InputError(
            f"{where}: expected hands, as results of MediaPipe (hand_world_landmarks or "
            "worldLandmarks) or frames with points by their names (wrist, thumb_cmc, ...), got "
            f"{got} without any; see the page on estimators"
        )
    if "format" not in value:
        raise InputError(
            f"{where}: these are frames of a stream; pipe them through geneoh denoise --stream, "
            "or save their fields in one npz (the page on the file format)"
        )
    record = as_record(value, where, AS_DESCRIBED)
    if record.text("format") != FORMAT:
        raise record.refuse("format", f"'{FORMAT}'")
    if record.finite("version") != VERSION:
        raise record.refuse("version", f"{VERSION}")
    return record


def frames_of_hands(record: Record, hands: Record) -> dict[Side, list[object]]:
    """The frames in the field `hands` for each side; both sides must have the same number."""
    sides: list[Side] = [side for side in ("right", "left") if side in hands]
    if not sides:
        raise record.refuse("hands", "a dict with 'right', 'left' or both")
    frames: dict[Side, list[object]] = {side: hands.items(side) for side in sides}
    lengths = {len(steps) for steps in frames.values()}
    if len(lengths) != 1 or lengths == {0}:
        counts = ", ".join(f"{len(steps)} {side}" for side, steps in frames.items())
        raise InputError(
            f"{hands.where}: expected as many frames for each hand, one or more, got {counts}; "
            "write null in frames where a hand was not seen"
        )
    return frames


def with_sides(found: Landmarks, where: str, given: Side | None) -> Landmarks:
    """The landmarks with a side for each hand, from the file or from the caller."""
    tracks = found.tracks
    if len(tracks) == 1:  # a detector guesses the side: the caller's has priority
        ((label, track),) = tracks.items()
        guessed = None if given or NOTES[0] not in found.notes else label
        if guessed and curls_backward(float32(track.points), guessed):
            label = OTHER_SIDE[guessed]
            found = replace(found, notes=(*found.notes, TURNED_NOTE.format(label)))
        return replace(found, tracks={given or label or side_of(Record(where, {}), None): track})
    if None in tracks:
        raise InputError(f"{where}: expected the side of each hand, got one without; add it")
    if all(side and curls_backward(float32(t.points), side) for side, t in tracks.items()):
        swapped: Tracks = {OTHER_SIDE[side]: track for side, track in tracks.items() if side}
        return replace(found, tracks=swapped, notes=(*found.notes, SWAPPED_NOTE))
    return found


def _read_frames(frames: list[object], order: JointOrder, where: str) -> LandmarkTrack:
    """The keypoints of one hand in OpenPose's order, with the confidence of each."""
    count = joint_orders.ORDERS[order].count
    points, trust = np.full((len(frames), count, 3), np.nan), np.zeros(len(frames))
    for index, frame in enumerate(frames):
        if frame is None:
            continue
        values = as_record(frame, f"{where} frame {index}", AS_DESCRIBED)
        points[index] = values.array("points", (count, 3))
        trust[index] = values.finite("confidence") if "confidence" in values else 1.0
    if ((trust < 0) | (trust > 1)).any():
        raise InputError(f"{where}: expected a confidence from 0 to 1; rescale it")
    joints, there = joint_orders.openpose_order(points, order)
    return LandmarkTrack(joints, trust[:, None] * there)
