"""HOI4D as it is distributed, and as GeneOH Diffusion prepares it: rigid and articulated objects.

Both: translation of MANO's origin, absolute pose, metres, 15 frames a second, the frame of a moving
camera.

Distributed: handpose/refinehandpose_{side}/{seq}/{frame}.pickle, HOI4D_annotations/{seq}/objpose/
{frame}.json and 3Dseg/output.log, HOI4D_CAD_Model_for_release/{rigid/{Category}/{NNN}.obj,
articulated/{Category}/{NNN}/objs/new-{k}-align.obj}. A missing hand file is a frame without that
hand. The camera's poses map everything to the world.

Prepared: {Category}/case{i}/merged_data.npy and meta_data.npy. One dict for each frame with theta
(1, 48), beta (1, 10), trans (1, 3), joints (63,) in MANO's order, obj_rot and obj_trans, of which
an articulated object has one for each part; torch tensors, right hands. meta_data.npy names HOI4D's
sequence, whose meshes are those of the data set itself.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.geometry.mesh import Mesh
from geneoh.readers import base, builders, foreign_files, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import by_frame, frame_number, read_record
from geneoh.readers.joint_orders import openpose_order
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, Notes, Record, as_record
from geneoh.readers.trajectories import read_trajectory
from geneoh.readers.transforms import refuse_bottom_row

ID_PARTS = 7
"""Parts of a sequence's name: camera, person, category, instance, room, layout, task."""
MODELS = "HOI4D_CAD_Model_for_release"
CATEGORIES = {
    **{1: "ToyCar", 2: "Mug", 3: "Laptop", 4: "StorageFurniture", 5: "Bottle", 6: "Safe"},
    **{7: "Bowl", 8: "Bucket", 9: "Scissors", 11: "Pliers", 12: "Kettle", 13: "Knife"},
    **{14: "TrashCan", 17: "Lamp", 18: "Stapler", 20: "Chair"},
}
SWAPPED = ("Laptop", "Scissors")
"""Categories whose first pose belongs to part 1, and whose second pose to part 0."""
GAP_LIMIT, GAP_GAIN = 0.02, 0.5
"""Gap in metres between two parts, and ratio of the gap with exchanged poses to it, that show that
the poses are exchanged."""
CAMERA_GAIN, CAMERA_SHARE = 0.002, 0.5
"""Decrease in metres a frame, and ratio, of the object's motion that show inverted camera poses."""

BOTH: dict[str, Any] = {
    **{"clip_is_folder": True, "fps": 15.0, "convention": base.ORIGIN},
    **{"takes": ("objects", "swap_parts")},
}
"""Fields that the readers of both formats share."""


@reads("objpose/", name_parts=ID_PARTS, **BOTH)
def hoi4d(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the object's parts, in the world if there are camera poses."""
    sequence = clip.path.parts[-ID_PARTS:]
    if len(clip.path.parents) < ID_PARTS + 2:
        raise InputError(f"{clip.path}: expected .../HOI4D_annotations/ZY.../H*/C*/N*/S*/s*/T*")
    root = clip.path.parents[ID_PARTS]
    files = foreign_files.numbered_files(clip.path / "objpose", "*.json")
    hands: dict[Side, dict[int, Path]] = {}
    for side in ("right", "left"):
        folder = root / "handpose" / f"refinehandpose_{side}" / Path(*sequence)
        hands[side] = foreign_files.numbered_files(folder, "*.pickle")
    numbers = [frame for found in (files, *hands.values()) for frame in found]
    if not numbers:
        raise InputError(f"{clip.path}: expected frames in objpose, got none; download them")
    frames = max(numbers) + 1
    motion = _read_poses(files, frames)
    present = base.finite_frames(motion)
    cameras, notes = read_cameras(clip.path / "3Dseg/output.log", frames)
    category, meshes = read_meshes(sequence, motion.shape[1], root, options)
    notes += _idle_options(motion.shape[1], options)
    contradictions = ()
    if cameras is not None:
        contradictions = inverted_cameras(cameras[present], motion[present], str(clip.path))
        motion = cameras[:, None] @ motion
    contradictions += _exchanged_parts(meshes, motion[present])
    tracks = []
    for side, found in hands.items():
        records = {frame: read_record(path) for frame, path in found.items()}
        if records:
            hand = builders.hand_by_frame(side, records, frames, "poseCoeff", "trans", "beta")
            tracks.append(replace(hand, to_world=cameras))
    named = {f"hoi4d_{category}_{sequence[3]}_{k}": mesh for k, mesh in enumerate(meshes)}
    checks = base.CrossChecks(contradictions=contradictions)
    yield base.ClipParts(
        f"HOI4D {clip.name}", tracks, named, motion, notes=notes, cross_checks=checks
    )


@reads("merged_data.npy", name_parts=2, **BOTH)
def hoi4d_cases(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The right hand and the object's parts, in the camera's frame."""
    steps = read_steps(clip.path / "merged_data.npy")
    frames = max(steps) + 1
    hand = builders.hand_by_frame("right", steps, frames, "theta", "trans", "beta")
    joints = _read_joints(steps, frames)
    motion = _read_motion(steps, frames)
    category, meshes = _meshes_of(clip.path, motion.shape[1], options)
    if options.mano_dir is None:  # stored keypoints place the wrist if MANO cannot
        hand = replace(hand, joints=builders.joints_if_complete(joints, hand.pose))
    named = {f"hoi4d_{category}_{clip.path.name}_{k}": mesh for k, mesh in enumerate(meshes)}
    found = _exchanged_parts(meshes, motion[base.finite_frames(motion)])
    stated = base.by_side("right", joints if np.isfinite(joints).any() else None)
    checks = base.CrossChecks(stated, contradictions=found)
    notes = ("camera frame", *_idle_options(motion.shape[1], options))
    source = f"HOI4D {clip.name} (GeneOH)"
    yield base.ClipParts(source, [hand], named, motion, notes=notes, cross_checks=checks)


def _read_poses(files: dict[int, Path], frames: int) -> Array:
    """(T, Q, 4, 4) poses of the parts, part to camera; NaN in frames without a file."""
    parts = {frame: pose_list(path) for frame, path in files.items()}
    count = max((len(found) for found in parts.values()), default=0)
    if not count:
        raise InputError("objpose: expected files with 'dataList', got none; download them")
    complete = {frame: found for frame, found in parts.items() if len(found) == count}
    poses = {frame: np.stack([part_pose(p) for p in found]) for frame, found in complete.items()}
    return by_frame(poses, frames, count, 4, 4)


def pose_list(path: Path) -> list[Record]:
    """The parts in one annotation, `dataList` or `objects`; empty if `isEffective` is 0."""
    record = as_record(foreign_files.read_json(path), str(path))
    if "isEffective" in record and record.finite("isEffective") == 0:
        return []
    items = record.items("dataList" if "dataList" in record else "objects")
    return [as_record(item, f"{path} part {index}") for index, item in enumerate(items)]


def part_pose(part: Record) -> Array:
    """(4, 4) of one part: v_camera = R v + centre, R from intrinsic XYZ angles."""
    centre, turn = part.record("center"), part.record("rotation")
    angles, place = ([field.finite(axis) for axis in "xyz"] for field in (turn, centre))
    rotation = Rotation.from_euler("XYZ", angles).as_matrix()
    return transforms.rigid_matrices(rotation, np.array(place))


def read_cameras(path: Path, frames: int) -> tuple[Array | None, Notes]:
    """(T, 4, 4) camera to world, out of a log of Open3D."""
    if not path.is_file():
        return None, ("camera frame: there are no camera poses",)
    cameras = read_trajectory(path).matrices
    if len(cameras) < frames:
        return None, (f"camera frame: camera poses of {len(cameras)} of {frames} frames",)
    refuse_bottom_row(str(path), "the camera's poses", cameras)
    return cameras[:frames], ()


def read_meshes(
    sequence: tuple[str, ...], count: int, root: Path, options: base.ReaderOptions
) -> tuple[str, list[Mesh]]:
    """The category and the mesh of each pose, in the order of the poses."""
    category = CATEGORIES.get(frame_number(Path(sequence[2])), sequence[2])
    models = options.objects or root / MODELS
    instance = f"{frame_number(Path(sequence[3])):03d}"
    if count == 1:
        rigid = [models / kind / category / f"{instance}.obj" for kind in ("rigid", ".")]
        return category, [find_mesh(rigid, f"{category} {instance}")]
    swapped = (category in SWAPPED) != options.swap_parts
    order = reversed(range(count)) if swapped else range(count)
    folder = models / "articulated" / category / instance / "objs"
    files = [folder / f"new-{k}-align.obj" for k in order]
    return category, [find_mesh([file], f"{category} {instance}") for file in files]


def _idle_options(count: int, options: base.ReaderOptions) -> Notes:
    """A note where --swap-parts changes nothing, for an object of `count` parts."""
    if not options.swap_parts or (count > 1 and not options.meshes):
        return ()
    why = "the meshes of --obj are in the order of the parts" if count > 1 else "it has one part"
    return (f"--swap-parts changes nothing about this object: {why}",)


def _exchanged_parts(meshes: list[Mesh], poses: Array) -> tuple[str, ...]:
    """A contradiction if two parts stay close only with their poses exchanged."""
    if len(meshes) != 2 or not len(poses):
        return ()
    apart, exchanged = (widest_gap(pair, poses) for pair in (meshes, meshes[::-1]))
    if apart > GAP_LIMIT and exchanged < GAP_GAIN * apart:
        return (
            f"parts: the two parts come {1000 * apart:.0f} mm apart, and {1000 * exchanged:.0f} mm "
            "with their poses exchanged: the order of the parts is the other one here, "
            "pass --swap-parts",
        )
    return ()


def inverted_cameras(cameras: Array, poses: Array, where: str) -> tuple[str, ...]:
    """A contradiction if the object moves less with camera poses taken as world to camera."""
    if len(cameras) < 3:
        return ()
    read, other = (
        float(np.linalg.norm(np.diff((way @ poses[:, 0])[:, :3, 3], axis=0), axis=1).mean())
        for way in (cameras, transforms.inverse(cameras, where))
    )
    if other < CAMERA_SHARE * read and read - other > CAMERA_GAIN:
        return (
            f"cameras: the object moves {1000 * read:.1f} mm a frame, and {1000 * other:.1f} mm "
            "with the camera's poses inverted: output.log holds world to camera here",
        )
    return ()


def widest_gap(meshes: list[Mesh], poses: Array) -> float:
    """Largest distance in metres between the nearest vertices of two parts, over some frames."""
    gaps = []
    for pose in poses[:: max(1, len(poses) // 5)]:
        first, second = (
            mesh.some_verts(500).double().numpy() @ part[:3, :3].T + part[:3, 3]
            for mesh, part in zip(meshes, pose, strict=True)
        )
        gaps.append(np.linalg.norm(first[:, None] - second[None], axis=-1).min())
    return float(max(gaps))


def read_steps(path: Path) -> dict[int, Record]:
    """The fields of each frame, from a list in order or from a dict by frame number."""
    value: Any = read_values(path)
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = value.tolist()
    if isinstance(value, list):
        value = dict(enumerate(value))
    steps = {}
    for key, step in value.items() if isinstance(value, dict) else ():
        number = str(key)[:40]
        if not number.isdecimal() or int(number) >= FRAME_LIMIT:
            raise InputError(f"{path}: expected frames by number, got {number!r}; check it")
        steps[int(number)] = as_record(step, f"{path} frame {number}")
    if not steps:
        raise InputError(f"{path}: expected frames with 'theta' and 'obj_rot', got none; check it")
    return steps


def _read_joints(steps: dict[int, Record], frames: int) -> Array:
    """(T, 21, 3) stored keypoints; NaN in frames without."""
    stated = {frame: step for frame, step in steps.items() if "joints" in step}
    shapes = (63,), (21, 3)
    found = {t: step.array("joints", *shapes).reshape(21, 3) for t, step in stated.items()}
    return openpose_order(by_frame(found, frames, 21, 3), "mano")[0]


def _read_motion(steps: dict[int, Record], frames: int) -> Array:
    """(T, Q, 4, 4) poses of the parts, part to camera; NaN in missing frames."""
    poses = {}
    for frame, step in steps.items():
        turn = step.array("obj_rot", (3, 3), ("Q", 3, 3), ("Q", 1, 3, 3)).reshape(-1, 3, 3)
        shift = step.array("obj_trans", (3,), ("Q", 3), ("Q", 1, 3)).reshape(-1, 3)
        if len(turn) != len(shift):
            raise step.refuse("obj_trans", f"one for each of {len(turn)} parts")
        poses[frame] = transforms.rigid_matrices(turn, shift)
    count = max(len(pose) for pose in poses.values())
    complete = {frame: pose for frame, pose in poses.items() if len(pose) == count}
    return by_frame(complete, frames, count, 4, 4)


def _meshes_of(case: Path, count: int, options: base.ReaderOptions) -> tuple[str, list[Mesh]]:
    """The category and the mesh of each part: the caller's, or the data set's own."""
    if options.meshes:
        return case.parent.name, list(options.meshes)
    meta = case / "meta_data.npy"
    if not meta.is_file():
        raise InputError(
            f"{meta}: expected the name of HOI4D's sequence, got no such file; copy it, or pass "
            "the object's meshes with --obj"
        )
    record = read_record(meta)
    sequence = tuple(record.text("case_flag").strip("/").split("/"))[-ID_PARTS:]
    if len(sequence) != ID_PARTS:
        raise record.refuse("case_flag", "a sequence such as ZY20210800001/H1/C1/N1/S1/s01/T1")
    return read_meshes(sequence, count, case.parents[1], options)
