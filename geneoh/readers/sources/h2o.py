"""H2O as it is distributed: subject{k}/{place}/{n}/cam{0-4}/ with one text file for each frame.

hand_pose_mano: 124 numbers, left then right, each a flag, translation (convention O), absolute pose
and betas; hand_pose: the same hands as 21 keypoints; obj_pose_rt: class and 4x4 object to camera;
cam_pose: 4x4 camera to world. Metres, 30 frames a second, MANO_LEFT as shipped.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clip_name,
    finite_frames,
)
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    Track,
    hand_in,
    mano_track,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, frame_number, read_numbers

CONVENTION = ManoConvention(origin=True)
FPS = 30.0
OBJECTS = ("book", "espresso", "lotion", "spray", "milk", "cocoa", "chips", "cappuccino")
"""Classes 1 to 8; 0 is no object."""
SIDES: tuple[Side, Side] = ("left", "right")
FIT_TOLERANCE = 0.02
"""Metres between the annotated keypoints and the fit of MANO to them."""
HAND = 62
"""Numbers of one hand: flag, 3 of translation, 48 of pose, 10 betas."""


def find(path: Path) -> list[SourceClip]:
    """Every camera of every sequence that has hand parameters."""
    names = ("hand_pose_mano", "hand_pose_MANO")
    found = {p.parent for name in names for p in path.rglob(name)} if path.is_dir() else set()
    return [SourceClip(clip_name(folder, 4), folder) for folder in sorted(found)]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands and the object, in the world; one recording for each object and stretch of it."""
    hands = read_frames(clip.path, ("hand_pose_mano", "hand_pose_MANO"), 124)
    objects = read_frames(clip.path, ("obj_pose_rt", "obj_pose_RT"), 17)
    cameras = read_frames(clip.path, ("cam_pose",), 16)
    points = read_frames(clip.path, ("hand_pose",), 128, missing_ok=True)
    frames = max(*hands, *objects) + 1
    to_world = dense(cameras, frames, 16).reshape(frames, 4, 4)
    values, placed = dense(hands, frames, 124), dense(objects, frames, 17)
    joints = dense(points, frames, 128)
    tracks, stored = [], {}
    for index, side in enumerate(SIDES):
        camera_joints = joints_of(joints[:, 64 * index : 64 * index + 64])
        stored[side] = moved(camera_joints, to_world)
        numbers = values[:, HAND * index : HAND * index + HAND]
        hand, notes = read_hand(numbers, camera_joints, side, known, str(clip.path))
        if bool(hand.valid.any()):
            tracks.append((hand_in(hand, to_world), notes))
    poses = to_world @ placed[:, 1:].reshape(frames, 4, 4)
    root = clip.path.parents[3] if len(clip.path.parents) > 3 else clip.path
    found = []
    for kind in sorted({int(k) for k in placed[:, 0] if np.isfinite(k) and k >= 1}):
        if kind > len(OBJECTS):
            raise InputError(f"{clip.path}: expected objects 1 to 8, got {kind}; copy it again")
        name = OBJECTS[kind - 1]
        folder = (known.objects or root / "object") / name
        mesh = read_mesh(find_mesh([*sorted(folder.glob("*.obj")), folder / f"{name}.obj"], name))
        present = (placed[:, 0] == kind) & finite_frames(poses)
        sequence = sequence_of(
            tracks, object_track([mesh], poses[:, None]), known.rate(FPS), f"H2O {clip.name} {name}"
        )
        found += recordings(
            f"{clip.name}_{name}",
            sequence,
            object_known=present,
            mesh_names=(f"h2o_{name}",),
            evidence=CrossChecks(joints=stored, tolerance=FIT_TOLERANCE),
        )
    if not found:
        raise InputError(f"{clip.path}: expected an object in some frame, got none")
    return found


def read_frames(
    folder: Path, names: tuple[str, ...], count: int, *, missing_ok: bool = False
) -> dict[int, Array]:
    """The numbers of each frame's file, from the first of some folders that is there."""
    for name in names:
        files = sorted((folder / name).glob("*.txt"))
        if files:
            return {frame_number(path): whole(path, count) for path in files}
    if missing_ok:
        return {}
    raise InputError(f"{folder}: expected frames in '{names[0]}', got none; download the labels")


def whole(path: Path, count: int) -> Array:
    """All numbers of a file, which may stand in one row or in several."""
    values = read_numbers(path, count, 4, 3).ravel()
    if len(values) != count:
        raise InputError(f"{path}: expected {count} numbers, got {len(values)}; copy it again")
    return values


def dense(frames: dict[int, Array], count: int, width: int) -> Array:
    """(T, width) with NaN where there is no file."""
    result = np.full((count, width), np.nan)
    for frame, values in frames.items():
        if frame < count:
            result[frame] = values
    return result


def joints_of(values: Array) -> Array:
    """(T, 21, 3) of one hand's flag and keypoints; NaN where the flag says none."""
    joints = values[:, 1:].reshape(-1, 21, 3).copy()
    joints[values[:, 0] != 1] = np.nan
    return joints


def moved(points: Array, frame: Array) -> Array:
    """Points taken into another frame."""
    return points @ frame[:, :3, :3].transpose(0, 2, 1) + frame[:, None, :3, 3]


def read_hand(values: Array, joints: Array, side: Side, known: ReaderOptions, where: str) -> Track:
    """One hand in the camera's frame, with the stored keypoints where there are any."""
    values = values.copy()
    values[values[:, 0] != 1] = np.nan
    present = np.isfinite(values).all(1)
    betas = values[present, 52:].mean(0) if present.any() else None
    complete = np.isfinite(joints[present]).all() and present.any()
    return mano_track(
        ManoParameters(
            side, values[:, 4:52], values[:, 1:4], betas, joints=joints if complete else None
        ),
        CONVENTION,
        known,
        where,
    )
