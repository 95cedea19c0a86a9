"""Hand landmarks of MediaPipe, WebXR or OpenXR.

MediaPipe's results as JSON and tables of points as CSV are read as `geneoh.readers.mediapipe` says.
For the others there is no standard, so that we have our own small schema:

    {"format": "geneoh-landmarks", "version": 1, "order": "openpose" | "webxr" | "openxr",
     "fps": 30, "camera": [0, 0, 0], "hands": {"right": [frame, ...], "left": [frame, ...]}}

A frame is null where the hand was not seen, else {"points": [[x, y, z], ...], "confidence": 0.9}
with the points in metres and one common frame of reference; MediaPipe's landmarks are in OpenPose's
order. Sides are the subject's own. "camera", the position of the camera in that frame, may be left
out.
"""

import numpy as np

from geneoh.choices import JointOrder, Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import METRES
from geneoh.readers import base
from geneoh.readers.builders import keypoint_track
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import read_json
from geneoh.readers.joint_orders import ORDERS, openpose_order
from geneoh.readers.mediapipe import (
    SIDE_NOTE,
    WORLD_NOTE,
    Track,
    is_results,
    read_points,
    read_results,
)
from geneoh.readers.npz_layouts import quoted
from geneoh.readers.records import Array, Record, as_record

FORMAT, VERSION = "geneoh-landmarks", 1


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands, with the caller's object."""
    where = str(clip.path)
    if clip.path.suffix == ".csv":
        yield from foreign_parts(clip, read_points(clip.path, options.side), options, ())
        return
    value = read_json(clip.path)
    if is_results(value):
        tracks = read_results(value, where, options.side)
        yield from foreign_parts(clip, tracks, options, (WORLD_NOTE, SIDE_NOTE))
        return
    record = as_record(value, where)
    if "format" not in record:
        raise InputError(
            f"{where}: expected results of MediaPipe (hand_world_landmarks or worldLandmarks), "
            f"or '{FORMAT}' as its format, got {quoted(map(str, record.values))}; see the page on "
            "estimators"
        )
    if record.text("format") != FORMAT or record.finite("version") != VERSION:
        raise record.refuse("format", f"'{FORMAT}' of version {VERSION}")
    order = record.optional_text("order") or "openpose"
    if order not in ORDERS:
        raise record.refuse("order", f"one of {', '.join(ORDERS)}")
    hands = record.record("hands")
    sides: list[Side] = [side for side in ("right", "left") if side in hands]
    frames = {side: hands.items(side) for side in sides}
    lengths = {len(steps) for steps in frames.values()}
    if len(lengths) != 1 or lengths == {0}:
        raise InputError(f"{clip.path}: expected as many frames for each hand, got {lengths}")
    read: dict[Side, tuple[Array, Array]] = {
        side: read_frames(frames[side], order, hands.where) for side in sides
    }
    yield base.ClipParts(
        clip.path.name,
        [keypoint_track(side, *read[side]) for side in read],
        fps=record.finite("fps"),
        cross_checks=base.CrossChecks(joints={side: read[side][0] for side in read}),
        camera=tuple(record.array("camera", (3,)).tolist()) if "camera" in record else None,
    )


def foreign_parts(
    clip: base.SourceClip,
    tracks: dict[Side | None, Track],
    options: base.ReaderOptions,
    notes: tuple[str, ...],
) -> base.Parts:
    """The interaction of tracks whose file knows no rate, and perhaps no side."""
    if len(tracks) == 1:  # the label of a side is a guess: the caller's word counts
        ((label, track),) = tracks.items()
        stated = {} if label is None else {"side": label}
        tracks = {options.side_of(Record(str(clip.path), stated)): track}
    elif None in tracks:
        raise InputError(f"{clip.path}: expected the side of each hand, got one without; add it")
    if options.fps is None:
        notes = (*notes, "30 frames a second assumed; --fps says otherwise")
    scale = METRES[options.keypoint_unit or "m"]
    yield base.ClipParts(
        clip.path.name,
        [
            keypoint_track(side, scale * track.points, np.tile(track.trust[:, None], 21))
            for side, track in tracks.items()
            if side is not None
        ],
        notes=notes,
    )


def read_frames(frames: list[object], order: JointOrder, where: str) -> tuple[Array, Array]:
    """(T, 21, 3) keypoints, NaN where there are none, and (T, 21) trust."""
    count = ORDERS[order].count
    points, trust = np.full((len(frames), count, 3), np.nan), np.zeros(len(frames))
    for index, frame in enumerate(frames):
        if frame is None:
            continue
        values = as_record(frame, f"{where} frame {index}")
        points[index] = values.array("points", (count, 3))
        trust[index] = values.finite("confidence") if "confidence" in values else 1.0
    if ((trust < 0) | (trust > 1)).any():
        raise InputError(f"{where}: expected a confidence from 0 to 1; rescale it")
    joints, there = openpose_order(points, order)
    return joints, trust[:, None] * there


READER = DatasetReader(parts, ("*.json", "*.jsonl", "*.csv"))
