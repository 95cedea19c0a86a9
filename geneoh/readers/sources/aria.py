"""Aria MPS hand tracking: hand_tracking/hand_tracking_results.csv, slam/closed_loop_trajectory.csv.

tracking_timestamp_us, {side}_tracking_confidence (-1: none) and
t{x,y,z}_{side}_landmark_{0-20}_device in the device's frame, metres; the trajectory takes them to
the world. Aria has no joint at the base of the thumb: one is put in, with confidence 0. Frames
below a confidence of 0.7 are not taken.
"""

import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from geneoh.choices import Side
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clip_name, clips
from geneoh.readers.builders import joints_track, object_of, recordings, sequence_of
from geneoh.readers.joint_orders import ordered
from geneoh.readers.records import FRAME_LIMIT, Array, Record, read_table

LEAST_CONFIDENCE = 0.7
"""Below it landmarks are unusable; the cut that EgoAllo makes."""
LONGEST_WAIT = 0.1
"""Seconds between a hand's frame and the nearest pose of the device."""
TRACKING = re.compile(
    r"tracking_timestamp_us|(left|right)_tracking_confidence"
    r"|t[xyz]_(left|right)_landmark_\d+_device"
)
TRAJECTORY = re.compile(r"tracking_timestamp_us|[tq][xyzw]_world_device")
"""Columns that are read."""


def find(path: Path) -> list[SourceClip]:
    """Every tracking result."""
    return [
        SourceClip(clip_name(clip.path.parents[1], 1), clip.path)
        for clip in clips(path, "hand_tracking_results.csv", 3)
    ]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands on an even clock, in the world where the trajectory is there."""
    record = read_table(clip.path, TRACKING)
    seconds = record.array("tracking_timestamp_us", ("T",)) * 1e-6
    steps = np.diff(seconds)
    if not np.isfinite(seconds).all() or not (steps > 0).all():
        raise record.refuse("tracking_timestamp_us", "times that rise")
    rate = known.rate(float(1 / np.median(steps)) if len(steps) else 10.0)
    clock = np.rint((seconds - seconds[0]) * rate).astype(int)
    if clock[-1] >= FRAME_LIMIT:
        raise record.refuse("tracking_timestamp_us", f"less than {FRAME_LIMIT} frames in all")
    frames = int(clock[-1]) + 1
    device, notes = read_trajectory(clip.path.parents[1] / "slam/closed_loop_trajectory.csv")
    tracks = []
    for side in ("right", "left"):
        points, trust = read_side(record, side)
        if device is not None:
            turn, shift = device_at(device, seconds)
            points = points @ turn.transpose(0, 2, 1) + shift[:, None]
        dense, sure = np.full((frames, 21, 3), np.nan), np.zeros((frames, 21))
        dense[clock], sure[clock] = points, trust
        tracks.append((joints_track(side, dense, sure), notes))
    motion, more = object_of(known, frames, str(clip.path))
    sequence = sequence_of(tracks, motion, rate, f"Aria MPS {clip.name}", *more)
    names = tuple(f"{clip.name}_{index}" for index in range(len(motion.meshes)))
    everywhere = np.ones(frames, dtype=bool)
    return recordings(clip.name, sequence, object_known=everywhere, mesh_names=names)


def read_side(record: Record, side: Side) -> tuple[Array, Array]:
    """(N, 21, 3) keypoints in the device's frame and (N, 21) trust; NaN where it is too low."""
    confidence = record.numbers(f"{side}_tracking_confidence")
    points = np.stack(
        [
            np.stack([record.numbers(f"t{x}_{side}_landmark_{k}_device") for x in "xyz"], axis=-1)
            for k in range(21)
        ],
        axis=1,
    )
    points[~(confidence >= LEAST_CONFIDENCE)] = np.nan
    joints, there = ordered(points, "aria")
    return joints, np.clip(np.nan_to_num(confidence), 0, 1)[:, None] * there


def read_trajectory(path: Path) -> tuple[Record | None, tuple[str, ...]]:
    """The device's poses, if they are there."""
    if not path.is_file():
        return None, ("frame of the moving device: there is no closed_loop_trajectory.csv",)
    return read_table(path, TRAJECTORY), ()


def device_at(device: Record, seconds: Array) -> tuple[Array, Array]:
    """Rotation and place of the device in the world at some times; NaN where it is unknown."""
    times = device.numbers("tracking_timestamp_us") * 1e-6
    quats = np.stack([device.numbers(f"q{c}_world_device") for c in "xyzw"], axis=-1)
    places = np.stack([device.numbers(f"t{c}_world_device") for c in "xyz"], axis=-1)
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise device.refuse("tracking_timestamp_us", "two times or more that rise")
    sound = np.isfinite(quats).all(1) & np.isfinite(places).all(1)
    sound &= np.abs(quats).sum(1) > 0.5
    times, quats, places = times[sound], quats[sound], places[sound]
    if len(times) < 2:
        raise device.refuse("qw_world_device", "two poses of the device or more")
    inside = np.clip(seconds, times[0], times[-1])
    turn = Slerp(times, Rotation.from_quat(quats))(inside).as_matrix()
    shift = np.stack([np.interp(inside, times, places[:, axis]) for axis in range(3)], axis=-1)
    after = np.clip(np.searchsorted(times, seconds), 1, len(times) - 1)
    nearest = np.minimum(np.abs(seconds - times[after - 1]), np.abs(times[after] - seconds))
    shift[nearest > LONGEST_WAIT] = np.nan
    return turn, shift
