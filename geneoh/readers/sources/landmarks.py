"""Hand landmarks of MediaPipe, WebXR or OpenXR.

MediaPipe's results as JSON are read as `geneoh.readers.mediapipe` says, tables of points as CSV as
`geneoh.readers.landmark_tables` says. For the others there is no standard, so that we have our own
small schema:

    {"format": "geneoh-landmarks", "version": 1, "order": "openpose" | "webxr" | "openxr",
     "fps": 30, "camera": [0, 0, 0], "hands": {"right": [frame, ...], "left": [frame, ...]}}

A frame is null where the hand was not seen, else {"points": [[x, y, z], ...], "confidence": 0.9}
with the points in metres and one common frame of reference; MediaPipe's landmarks are in OpenPose's
order. Sides are the subject's own. "camera", the position of the camera in that frame, may be left
out. "timestamps" or "frame_ids", one a frame, may stand beside "fps" or in its place
(`geneoh.readers.clock`).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from geneoh.choices import OTHER_SIDE, SIDES, JointOrder, Side
from geneoh.errors import InputError
from geneoh.files.journal import JOURNALS
from geneoh.geometry.mesh import METRES
from geneoh.readers import base, builders, foreign_files, joint_orders
from geneoh.readers.dataset_reader import reads
from geneoh.readers.hand_checks import curls_backward
from geneoh.readers.landmark_tables import read_points
from geneoh.readers.mediapipe import Landmarks, LandmarkTrack, Tracks, read_results
from geneoh.readers.npz_hands import side_of
from geneoh.readers.npz_layouts import quoted
from geneoh.readers.records import Record, as_record, float32

FORMAT, VERSION = "geneoh-landmarks", 1
SWAPPED_NOTE = "both hands are bent backward as of the sides that are named: sides are exchanged"
AS_DESCRIBED = "write it as the page on estimators says (Headsets)"


@reads(
    *("*.json", "*.jsonl", "*.csv"),
    choose=lambda found, path: (f for f in found if f == path or f.name not in JOURNALS),
    takes=("joint_order", "keypoint_unit", "object_pose"),
)
def landmarks(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands, with the caller's object."""
    found = read_landmarks(clip.path, options.side, options.joint_order)
    scale = METRES[options.keypoint_unit or "m"]
    hands = [
        builders.hand_track(side, scale * track.points, track.confidence)
        for side, track in found.tracks.items()
        if side is not None
    ]
    yield base.ClipParts(
        clip.path.name,
        hands,
        first=found.first,
        stamps=found.stamps,
        notes=found.notes,
        camera=None if found.camera is None else scale * found.camera,
    )


def read_landmarks(path: Path, side: Side | None, order: JointOrder) -> Landmarks:
    """The hands of a file in any of the forms, each with its side.

    `side` is the caller's, and `order` that of points with numbers in a table.
    """
    if path.suffix.lower() == ".csv":
        return with_sides(read_points(path, side, order), str(path), side)
    if order != "openpose":
        raise InputError(
            f"{path}: --joint-order is for tables of numbered points (CSV) and for npy, got JSON, "
            "which says its order; drop it"
        )
    value = foreign_files.read_json(path)
    found = read_results(value, str(path), side)
    return with_sides(found, str(path), side) if found else own_landmarks(value, str(path))


def own_landmarks(value: object, where: str) -> Landmarks:
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


def own_record(value: object, where: str) -> Record:
    """The fields of a JSON of our own schema, of a version that is read."""
    first = value[0] if isinstance(value, list) and value else None
    if isinstance(first, dict) and {f"{side}_joints" for side in SIDES} & first.keys():
        raise InputError(
            f"{where}: these are frames of a stream; pipe them through geneoh denoise --stream, "
            "or save their fields in one npz (the page on the file format)"
        )
    record = as_record(value, where, AS_DESCRIBED)
    if "format" not in record:
        raise InputError(
            f"{where}: expected results of MediaPipe (hand_world_landmarks or worldLandmarks), "
            f"or '{FORMAT}' as its format, got {quoted(record.values)}; see the page on "
            "estimators"
        )
    if record.text("format") != FORMAT:
        raise record.refuse("format", f"'{FORMAT}'")
    if record.finite("version") != VERSION:
        raise record.refuse("version", f"{VERSION}")
    return record


def frames_of_hands(record: Record, hands: Record) -> dict[Side, list[object]]:
    """What the field `hands` holds in each frame, as many frames for each hand."""
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
    """The landmarks of a file that need not say a side, with that of each hand."""
    tracks = found.tracks
    if len(tracks) == 1:  # the label of a side is a guess: the caller's word counts
        ((label, track),) = tracks.items()
        return replace(found, tracks={given or label or side_of(Record(where, {}), None): track})
    if None in tracks:
        raise InputError(f"{where}: expected the side of each hand, got one without; add it")
    if all(side and curls_backward(float32(t.points), side) for side, t in tracks.items()):
        swapped: Tracks = {OTHER_SIDE[side]: track for side, track in tracks.items() if side}
        return replace(found, tracks=swapped, notes=(*found.notes, SWAPPED_NOTE))
    return found


def _read_frames(frames: list[object], order: JointOrder, where: str) -> LandmarkTrack:
    """The keypoints of one hand in OpenPose's order, with a trust in each of them."""
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
