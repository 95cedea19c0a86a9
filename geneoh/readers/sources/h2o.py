"""H2O as it is distributed: subject{k}/{place}/{n}/cam{0-4}/ with one text file for each frame.

hand_pose_mano: 124 numbers, left then right, each a flag, translation (of MANO's origin), absolute
pose and betas; hand_pose: the same hands as 21 keypoints; obj_pose_rt: class and 4x4 object to
camera; cam_pose: 4x4 camera to world. Metres, 30 frames a second, left hand as shipped.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers import base, builders, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import by_frame, numbered_files, read_numbers
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import Array

OBJECTS = ("book", "espresso", "lotion", "spray", "milk", "cocoa", "chips", "cappuccino")
"""Classes 1 to 8; 0 is no object."""
HANDS: dict[Side, int] = {"left": 0, "right": 1}
"""Index of each hand in a row of numbers."""
HAND, POINTS = 62, 64
"""Numbers of one hand: flag, 3 of translation, 48 of pose, 10 betas; flag and 63 of keypoints."""
PARAMETER_FOLDERS = ("hand_pose_mano", "hand_pose_MANO")
FIT_TOLERANCE = 0.02
"""Largest distance in metres of the annotated keypoints from the fit of MANO to them."""


@reads(
    *(f"{name}/" for name in PARAMETER_FOLDERS),
    clip_is_folder=True,
    name_parts=4,
    convention=base.ORIGIN,
    content="an object in some frame",
    takes=("objects",),
)
def h2o(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands with each object, in the world; the object may change from frame to frame."""
    hands = _read_frames(clip.path, PARAMETER_FOLDERS, 2 * HAND)
    objects = _read_frames(clip.path, ("obj_pose_rt", "obj_pose_RT"), 17)
    cameras = _read_frames(clip.path, ("cam_pose",), 16)
    points = _read_frames(clip.path, ("hand_pose",), 2 * POINTS, missing_ok=True)
    frames = max(*hands, *objects) + 1
    to_world = by_frame(cameras, frames, 16).reshape(frames, 4, 4)
    values, placed = by_frame(hands, frames, 2 * HAND), by_frame(objects, frames, 17)
    stored = by_frame(points, frames, 2 * POINTS)
    joints = {side: _hand_of(stored, side, POINTS)[:, 1:].reshape(-1, 21, 3) for side in HANDS}
    tracks = [_read_hand(_hand_of(values, s, HAND), joints[s], s, to_world) for s in HANDS]
    motion = to_world @ placed[:, 1:].reshape(frames, 4, 4)
    stated: dict[Side, Array] = {s: transforms.moved_points(joints[s], to_world) for s in HANDS}
    checks = base.CrossChecks(stated, tolerance=FIT_TOLERANCE)
    root = base.ancestor(clip.path, 4)
    for number in sorted({int(k) for k in placed[:, 0] if np.isfinite(k) and k >= 1}):
        if number > len(OBJECTS):
            raise InputError(f"{clip.path}: expected objects 1 to 8, got {number}; copy it")
        name = OBJECTS[number - 1]
        folder = (options.objects or root / "object") / name
        files = [*sorted(folder.glob("*.obj")), folder / f"{name}.obj"]
        meshes = {f"h2o_{name}": find_mesh(files, name)}
        known = (placed[:, 0] == number) & base.finite_frames(motion)
        how = {"name": f"{clip.name}_{name}", "object_known": known, "cross_checks": checks}
        yield base.ClipParts(f"H2O {clip.name} {name}", tracks, meshes, motion, **how)


def _read_frames(
    folder: Path, names: tuple[str, ...], count: int, *, missing_ok: bool = False
) -> dict[int, Array]:
    """The numbers of each frame's file, from the first of some folders that has files."""
    for name in names:
        files = numbered_files(folder / name, "*.txt")
        if files:
            return {frame: all_numbers(path, count) for frame, path in files.items()}
    if missing_ok:
        return {}
    raise InputError(f"{folder}: expected frames in '{names[0]}', got none; download the labels")


def all_numbers(path: Path, count: int) -> Array:
    """All numbers of a file, which may stand in one row or in several."""
    values = read_numbers(path, count, 4, 3).ravel()
    if len(values) != count:
        raise InputError(f"{path}: expected {count} numbers, got {len(values)}; copy it again")
    return values


def _hand_of(rows: Array, side: Side, width: int) -> Array:
    """(T, width) the numbers of one hand; NaN in frames where its flag is not 1."""
    values = rows[:, width * HANDS[side] :][:, :width].copy()
    values[values[:, 0] != 1] = np.nan
    return values


def _read_hand(values: Array, joints: Array, side: Side, to_world: Array) -> base.ManoParameters:
    """One hand in the camera's frame, with the stored keypoints where there are any."""
    present = base.finite_frames(values)
    betas = values[present, 52:].mean(0) if present.any() else None
    stored = builders.joints_if_complete(joints, values)
    places = {"translation": values[:, 1:4], "joints": stored, "to_world": to_world}
    return base.ManoParameters(side, values[:, 4:52], betas=betas, **places)
