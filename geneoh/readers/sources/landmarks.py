"""Hand landmarks of MediaPipe, WebXR or OpenXR as JSON: our own small schema, as there is no
standard.

    {"format": "geneoh-landmarks", "version": 1, "order": "openpose" | "webxr" | "openxr",
     "fps": 30, "camera": [0, 0, 0], "hands": {"right": [frame, ...], "left": [frame, ...]}}

A frame is null where the hand was not seen, else {"points": [[x, y, z], ...], "confidence": 0.9}
with the points in metres and one common frame of reference; MediaPipe's landmarks are in OpenPose's
order. Sides are the subject's own. "camera", the position of the camera in that frame, may be left
out.
"""

from collections.abc import Iterator

import numpy as np

from geneoh.choices import JointOrder, Side
from geneoh.errors import InputError
from geneoh.readers.base import CrossChecks, ReaderOptions, SourceClip
from geneoh.readers.builders import keypoint_track
from geneoh.readers.dataset_reader import ClipParts, DatasetReader
from geneoh.readers.foreign_files import read_json
from geneoh.readers.joint_orders import ORDERS, openpose_order
from geneoh.readers.records import Array, as_record

FORMAT, VERSION = "geneoh-landmarks", 1


class LandmarksReader(DatasetReader):
    """Up to two hands."""

    patterns = ("*.json",)

    def parts(self, clip: SourceClip, options: ReaderOptions) -> Iterator[ClipParts]:
        """The one interaction of a file, with the caller's object."""
        record = as_record(read_json(clip.path), str(clip.path))
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
        yield ClipParts(
            clip.path.name,
            [keypoint_track(side, *read[side]) for side in read],
            fps=record.finite("fps"),
            cross_checks=CrossChecks(joints={side: read[side][0] for side in read}),
            camera=tuple(record.array("camera", (3,)).tolist()) if "camera" in record else None,
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


READER = LandmarksReader()
