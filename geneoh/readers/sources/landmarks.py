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

import numpy as np

from geneoh.choices import OTHER_SIDE, SIDES, JointOrder, Side
from geneoh.errors import InputError
from geneoh.files.journal import JOURNALS
from geneoh.geometry.mesh import METRES
from geneoh.readers import base, builders, foreign_files, joint_orders
from geneoh.readers.clock import timing_of
from geneoh.readers.dataset_reader import reads
from geneoh.readers.hand_checks import curls_backward
from geneoh.readers.landmark_tables import read_points
from geneoh.readers.mediapipe import Landmarks, Tracks, read_results
from geneoh.readers.npz_hands import side_of
from geneoh.readers.npz_layouts import quoted
from geneoh.readers.records import Array, Record, as_record, float32

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
    if clip.path.suffix.lower() == ".csv":
        found = read_points(clip.path, options.side, options.joint_order)
        yield foreign_parts(clip, found, options)
        return
    if options.joint_order != "openpose":
        raise InputError(
            f"{clip.path}: --joint-order is for tables of numbered points (CSV) and for npy, got "
            "JSON, which says its order; drop it"
        )
    value, where = foreign_files.read_json(clip.path), str(clip.path)
    found = read_results(value, where, options.side)
    if found:
        yield foreign_parts(clip, found, options)
    else:
        yield own_parts(value, clip.path.name, where, options)


def own_parts(value: object, name: str, where: str, options: base.ReaderOptions) -> base.ClipParts:
    """The interaction in a JSON of our own schema."""
    record = own_record(value, where)
    order = record.optional_text("order") or "openpose"
    if order not in joint_orders.ORDERS:
        raise record.refuse("order", f"one of {', '.join(joint_orders.ORDERS)}")
    hands = record.record("hands")
    frames = frames_of_hands(record, hands)
    scale = METRES[options.keypoint_unit or "m"]
    read: dict[Side, tuple[Array, Array]] = {
        side: _read_frames(steps, order, scale, hands.where) for side, steps in frames.items()
    }
    rate, clock, about_time = timing_of(record, len(next(iter(frames.values()))), options.fps)
    camera = scale * record.array("camera", (3,)) if "camera" in record else None
    return base.ClipParts(
        name,
        [builders.hand_track(side, *points) for side, points in read.items()],
        fps=rate,
        clock=clock,
        notes=about_time,
        cross_checks=base.CrossChecks({side: joints for side, (joints, _) in read.items()}),
        camera=None if camera is None else tuple(camera.tolist()),
    )


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


def foreign_parts(
    clip: base.SourceClip, found: Landmarks, options: base.ReaderOptions
) -> base.ClipParts:
    """The interaction of landmarks whose file need not say a side."""
    tracks: Tracks = found.tracks
    notes = found.notes
    if len(tracks) == 1:  # the label of a side is a guess: the caller's word counts
        ((label, track),) = tracks.items()
        side = options.side or label or side_of(Record(str(clip.path), {}), None)
        tracks = {side: track}
    elif None in tracks:
        raise InputError(f"{clip.path}: expected the side of each hand, got one without; add it")
    elif all(side and curls_backward(float32(t.points), side) for side, t in tracks.items()):
        tracks = {OTHER_SIDE[side]: track for side, track in tracks.items() if side}
        notes = (*notes, SWAPPED_NOTE)
    frames = max((len(track.points) for track in tracks.values()), default=0)
    rate, clock, about_time = timing_of(found.stamps, frames, options.fps)
    scale = METRES[options.keypoint_unit or "m"]
    return base.ClipParts(
        clip.path.name,
        [
            builders.hand_track(side, scale * track.points, np.tile(track.trust[:, None], 21))
            for side, track in tracks.items()
            if side is not None
        ],
        fps=rate,
        first=found.first,
        clock=clock,
        notes=(*notes, *about_time),
    )


def _read_frames(
    frames: list[object], order: JointOrder, scale: float, where: str
) -> tuple[Array, Array]:
    """(T, 21, 3) keypoints in metres, a unit being `scale`, NaN for none, and (T, 21) trust."""
    count = joint_orders.ORDERS[order].count
    points, trust = np.full((len(frames), count, 3), np.nan), np.zeros(len(frames))
    for index, frame in enumerate(frames):
        if frame is None:
            continue
        values = as_record(frame, f"{where} frame {index}", AS_DESCRIBED)
        points[index] = scale * values.array("points", (count, 3))
        trust[index] = values.finite("confidence") if "confidence" in values else 1.0
    if ((trust < 0) | (trust > 1)).any():
        raise InputError(f"{where}: expected a confidence from 0 to 1; rescale it")
    joints, there = joint_orders.openpose_order(points, order)
    return joints, trust[:, None] * there
