"""Aria MPS hand tracking: hand_tracking/hand_tracking_results.csv, slam/closed_loop_trajectory.csv.

tracking_timestamp_us, {side}_tracking_confidence (-1: none) and
t{x,y,z}_{side}_landmark_{0-20}_device in the device's frame, metres; the trajectory maps them to
the world. Aria has no joint at the base of the thumb: one is estimated, with confidence 0. Frames
below a confidence of 0.7 count as not observed.
"""

import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from geneoh.choices import Side
from geneoh.readers import base, builders, foreign_files, joint_orders, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.records import Array, Notes, Record

MICROSECONDS = 1e-6
LEAST_CONFIDENCE = 0.7
"""Below it landmarks are unusable; the threshold that EgoAllo uses."""
LONGEST_WAIT = 0.1
"""Longest time in seconds between a hand's frame and the nearest pose of the device."""
TRACKING = re.compile(
    r"tracking_timestamp_us|(left|right)_tracking_confidence"
    r"|t[xyz]_(left|right)_landmark_\d+_device"
)
"""Columns of the hands that are read."""
TRAJECTORY = re.compile(r"tracking_timestamp_us|[tq][xyzw]_world_device")
"""Columns of the device's poses that are read."""


@reads("hand_tracking_results.csv", name_above=2, takes=("object_pose",))
def aria(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands at even steps of time, in the world if there is a trajectory."""
    record = foreign_files.read_table(clip.path, TRACKING)
    seconds = record.array("tracking_timestamp_us", ("T",)) * MICROSECONDS
    device, notes = read_device(base.ancestor(clip.path, 2), seconds)
    hands = []
    for side in ("right", "left"):
        points, trust = read_side(record, side)
        points = points if device is None else transforms.moved_points(points, device)
        hands.append(builders.hand_track(side, points, trust))
    yield base.ClipParts(f"Aria MPS {clip.name}", hands, notes=notes, stamps=record)


def read_side(record: Record, side: Side) -> tuple[Array, Array]:
    """(N, 21, 3) keypoints in the device's frame, NaN if unreliable, and (N, 21) confidence."""
    confidence = record.array(f"{side}_tracking_confidence", ("N",))
    columns = [f"t{axis}_{side}_landmark_{k}_device" for k in range(21) for axis in "xyz"]
    points = np.stack([record.array(column, ("N",)) for column in columns], axis=-1)
    points[~(confidence >= LEAST_CONFIDENCE)] = np.nan
    joints, there = joint_orders.openpose_order(points.reshape(-1, 21, 3), "aria")
    return joints, np.clip(np.nan_to_num(confidence), 0, 1)[:, None] * there


def read_device(root: Path, seconds: Array) -> tuple[Array | None, Notes]:
    """(N, 4, 4) device to world at some times, NaN where unknown; None without a trajectory."""
    path = root / "slam/closed_loop_trajectory.csv"
    if not path.is_file():
        return None, ("frame of the moving device: there is no closed_loop_trajectory.csv",)
    device = foreign_files.read_table(path, TRAJECTORY)
    times = device.array("tracking_timestamp_us", ("N",)) * MICROSECONDS
    quats = np.stack([device.array(f"q{c}_world_device", ("N",)) for c in "xyzw"], axis=-1)
    places = np.stack([device.array(f"t{c}_world_device", ("N",)) for c in "xyz"], axis=-1)
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise device.refuse("tracking_timestamp_us", "two times or more that rise")
    sound = transforms.are_rotations(quats) & np.isfinite(places).all(1) & np.isfinite(times)
    times, quats, places = times[sound], quats[sound], places[sound]
    if len(times) < 2:
        raise device.refuse("qw_world_device", "two poses of the device or more")
    inside = np.clip(seconds, times[0], times[-1])
    turn = Slerp(times, Rotation.from_quat(quats))(inside).as_matrix()
    shift = np.stack([np.interp(inside, times, places[:, axis]) for axis in range(3)], axis=-1)
    after = np.clip(np.searchsorted(times, seconds), 1, len(times) - 1)
    nearest = np.minimum(np.abs(seconds - times[after - 1]), np.abs(times[after] - seconds))
    shift[nearest > LONGEST_WAIT] = np.nan
    return transforms.rigid_matrices(turn, shift), ()
