"""Hand landmarks of MediaPipe, WebXR or OpenXR as JSON: our own small schema, as there is no
standard.

    {"format": "geneoh-landmarks", "version": 1, "order": "openpose" | "webxr" | "openxr",
     "fps": 30, "hands": {"right": [frame, ...], "left": [frame, ...]}}

A frame is null where the hand was not seen, else {"points": [[x, y, z], ...], "confidence": 0.9}
with the points in metres and one common frame of reference; MediaPipe's landmarks are in OpenPose's
order. Sides are the subject's own.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers.base import CrossChecks, ReaderOptions, Recording, SourceClip, clips
from geneoh.readers.builders import joints_track, object_of, recordings, sequence_of
from geneoh.readers.joint_orders import ORDERS, ordered
from geneoh.readers.records import Array, as_record, read_json

FORMAT, VERSION = "geneoh-landmarks", 1


def find(path: Path) -> list[SourceClip]:
    """Every JSON file."""
    return clips(path, "*.json", 1)


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Up to two hands."""
    record = as_record(read_json(clip.path), str(clip.path))
    if record.text("format") != FORMAT or record.number("version") != VERSION:
        raise record.refuse("format", f"'{FORMAT}' of version {VERSION}")
    order = record.text("order") if "order" in record else "openpose"
    if order not in ORDERS:
        raise record.refuse("order", f"one of {', '.join(ORDERS)}")
    hands = record.record("hands")
    sides: list[Side] = [side for side in ("right", "left") if side in hands]
    frames = {side: hands.items(side) for side in sides}
    lengths = {len(steps) for steps in frames.values()}
    if len(lengths) != 1 or lengths == {0}:
        raise InputError(f"{clip.path}: expected as many frames for each hand, got {lengths}")
    motion, notes = object_of(known, lengths.pop(), str(clip.path))
    stored, tracks = {}, []
    for side in sides:
        points, trust = read_frames(frames[side], order, hands.where)
        stored[side] = points
        tracks.append((joints_track(side, points, trust), notes))
    sequence = sequence_of(tracks, motion, known.rate(record.number("fps")), clip.path.name)
    names = tuple(f"{clip.name}_{index}" for index in range(len(motion.meshes)))
    return recordings(
        clip.name,
        sequence,
        object_known=np.ones(sequence.frames, dtype=bool),
        mesh_names=names,
        evidence=CrossChecks(joints=stored),
    )


def read_frames(frames: list[object], order: str, where: str) -> tuple[Array, Array]:
    """(T, 21, 3) keypoints, NaN where there are none, and (T, 21) trust."""
    count = ORDERS[order].count
    points, trust = np.full((len(frames), count, 3), np.nan), np.zeros(len(frames))
    for index, frame in enumerate(frames):
        if frame is None:
            continue
        values = as_record(frame, f"{where} frame {index}")
        points[index] = values.array("points", (count, 3))
        trust[index] = values.number("confidence") if "confidence" in values else 1.0
    if ((trust < 0) | (trust > 1)).any():
        raise InputError(f"{where}: expected a confidence from 0 to 1; rescale it")
    joints, there = ordered(points, order)
    return joints, trust[:, None] * there
