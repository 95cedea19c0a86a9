"""HOT3D as it is distributed: {recording}/ with mano_hand_pose_trajectory.jsonl and
dynamic_objects.csv, the meshes in assets/{object}.glb beside the recordings.

A line of JSON for each moment: timestamp_ns, hand_poses "0" (left) and "1" (right), if there is
one, with 15 coefficients of MANO's components relative to its mean pose, wrist_xform (quaternion
wxyz, translation of MANO's origin) and betas, left hand with mirrored shape directions. The table
has a row per object and moment: quaternion wxyz and position in the world. Metres. Each of Aria's
cameras has its own timestamps, a tenth of a millisecond apart: the first one is taken.
"""

import re
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.hand.mano import MENDED
from geneoh.readers import base, builders, foreign_files, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.mano import pose_of_coefficients
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import Array, Record, as_record

KEYS: dict[Side, str] = {"right": "1", "left": "0"}
SAME_MOMENT = 5e6
"""Nanoseconds within which timestamps belong to the same moment."""
TABLE = re.compile(r"object_uid|timestamp\[ns\]|t_wo_[xyz]\[m\]|q_wo_[wxyz]")
"""Columns of the objects that are read."""
COEFFICIENTS = 15


# `mean_added` stays False: `pose_of_coefficients` has added the mean pose already.
@reads(
    "mano_hand_pose_trajectory.jsonl",
    clip_is_folder=True,
    convention=base.ManoConvention("origin", left_hand=MENDED),
    content="an object with poses",
    takes=("objects",),
)
def hot3d(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands with each object that moves; objects at rest are left out."""
    lines = _moments(clip.path / "mano_hand_pose_trajectory.jsonl")
    times = np.array([time for time, _ in lines])
    hands = [_read_hand([line for _, line in lines], side, options) for side in KEYS]
    stamps = Record(str(clip.path), {"timestamp_ns": times - times[0]})
    motions = read_objects(clip.path / "dynamic_objects.csv", times)
    folder = options.objects or base.ancestor(clip.path, 1) / "assets"
    for name in base.moving_objects(motions):
        meshes = {f"hot3d_{name}": find_mesh([folder / f"{name}.glb"], f"object {name}")}
        source, part = f"HOT3D {clip.name} {name}", f"{clip.name}_{name}"
        yield base.ClipParts(source, hands, meshes, motions[name], name=part, stamps=stamps)


def _moments(path: Path) -> list[tuple[float, Record]]:
    """Time in nanoseconds and hands of each moment; of lines of the same moment, the first."""
    lines = enumerate(foreign_files.read_json(path), 1)
    records = [as_record(value, f"{path} line {number}") for number, value in lines]
    found: list[tuple[float, Record]] = []
    for record in sorted(records, key=lambda record: record.number("timestamp_ns")):
        time = record.number("timestamp_ns")
        if not found or time - found[-1][0] > SAME_MOMENT:
            found.append((time, record.record("hand_poses")))
    if not found:
        raise InputError(f"{path}: expected a line for each moment, got none; download it again")
    return found


def _read_hand(lines: list[Record], side: Side, options: base.ReaderOptions) -> base.ManoParameters:
    """One hand, whose coefficients need the user's MANO; NaN in moments without it."""
    hands = {t: line.record(KEYS[side]) for t, line in enumerate(lines) if KEYS[side] in line}
    wrists = {t: hand.record("wrist_xform") for t, hand in hands.items()}
    orient = foreign_files.field_by_frame(wrists, "q_wxyz", len(lines), 4)
    places = foreign_files.field_by_frame(wrists, "t_xyz", len(lines), 3)
    values = foreign_files.field_by_frame(hands, "pose", len(lines), COEFFICIENTS)
    mano = builders.mano_of_coefficients(options, side, lines[0].where, MENDED)
    fingers = pose_of_coefficients(lines[0], "pose", values, mano, add_mean=True)
    pose = np.concatenate([transforms.axis_angles_of_wxyz(orient), fingers], axis=1)
    betas = [hand.array("betas", (10,)) for hand in hands.values()]
    return base.ManoParameters(side, pose, places, np.mean(betas, axis=0) if betas else None)


def read_objects(path: Path, times: Array) -> dict[str, Array]:
    """(T, 4, 4) object to world of each object by its name; NaN in moments without it."""
    table = foreign_files.read_table(path, TABLE)
    columns = [f"q_wo_{axis}" for axis in "xyzw"] + [f"t_wo_{axis}[m]" for axis in "xyz"]
    poses = np.stack([table.array(name, ("N",)) for name in columns], axis=1)
    names, at = table.array("object_uid", ("N",)), table.array("timestamp[ns]", ("N",))
    frames = np.searchsorted(times, at - SAME_MOMENT).clip(max=len(times) - 1)
    seen = np.abs(times[frames] - at) <= SAME_MOMENT
    motions: dict[str, Array] = {}
    for name in np.unique(names[np.isfinite(names)]):
        own = np.flatnonzero(seen & (names == name))[::-1]  # of two rows of a moment, the first
        motion = np.full((len(times), 7), np.nan)
        motion[frames[own]] = poses[own]
        motions[f"{name:.0f}"] = transforms.rigid_of_xyzw(motion)
    return motions
