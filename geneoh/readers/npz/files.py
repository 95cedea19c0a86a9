"""Sequences to and from npz files: several layouts are read, geneoh's own is written."""

import logging
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from geneoh.arguments import checked_call
from geneoh.choices import SIDES, JointOrder, Side, Unit
from geneoh.errors import InputError, shortened
from geneoh.files.npz import Arrays, write_archive
from geneoh.geometry.mesh import METRES, Mesh
from geneoh.geometry.mesh_files import MeshInput, meshes_of
from geneoh.hand.mano import AS_SHIPPED, MENDED, mano_folder
from geneoh.readers.base import Place, place_of
from geneoh.readers.clock import timing_of
from geneoh.readers.joint_orders import ORDERS, in_openpose_order
from geneoh.readers.meshes import with_parts
from geneoh.readers.npz import layouts, objects
from geneoh.readers.npz.hands import read_hands
from geneoh.readers.npz.layouts import (
    CAMERA_FIELDS,
    CAMERA_POSES,
    FORMAT,
    OBJECT_FIELDS,
    own_names,
    quoted,
)
from geneoh.readers.object_poses import CAMERA_SHAPES, pose_field, poses_of
from geneoh.readers.pose_matching import PoseTrack
from geneoh.readers.recordings import read
from geneoh.readers.records import Array, Notes, Record, float32
from geneoh.sequence.camera import seen_from, with_rays
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.validation import check_sequence, check_tracks

LOG = logging.getLogger(__name__)

SOURCE_OF_ENDING = {".npy": "keypoints", **dict.fromkeys((".json", ".jsonl", ".csv"), "landmarks")}
"""Endings of files other than npz that are read without the name of their source."""

LAYOUT_NAMES: dict[layouts.Layout, str] = {
    "geneoh-sequence": f"{FORMAT} version {layouts.VERSION}",
    "smplx": "smplx names, absolute pose",
    "taco": "TACO names",
    "joints": "bare joints",
}
MOTION_FIELDS = ("rotation", "translation", "valid")
"""Fields of an object's track that a file keeps, with `object_` in front."""
RAYS = tuple(own_names(side)["camera_ray"] for side in SIDES)
CALLERS = {
    "obj_pose": ("the object's motion", "--object-pose", OBJECT_FIELDS, "one of them"),
    "camera_position": ("the camera", "--camera", (*CAMERA_FIELDS, *RAYS), "the option"),
    CAMERA_POSES: ("the camera's motion", "--camera-pose", (CAMERA_POSES,), "the option"),
}
"""For each field that the caller may pass: its meaning, the option, the file's fields of the same
meaning, and what to drop if both are there."""


@checked_call
def load(
    path: Path | str,
    *,
    obj: MeshInput = None,
    side: Side | None = None,
    fps: float | None = None,
    mano_dir: Path | str | None = None,
    unit: Unit = "m",
    joint_order: JointOrder = "openpose",
    keypoint_unit: Unit | None = None,
    object_pose: Path | str | Array | None = None,
    camera: Place | str | None = None,
    camera_pose: Path | str | Array | None = None,
) -> Sequence:
    """Read a sequence from an npz in any of the known layouts.

    `Sequence.source` names the layout and the assumptions made, which are also logged as warnings.

    Args:
        path: the npz of the sequence, which is never unpickled, a npy of keypoints, or landmarks
            as JSON or CSV.
        obj: the object's mesh or its file, or one per rigid part. By default the mesh files that
            the npz names, if they still exist and are unchanged; else `Sequence.source` says why
            there is no mesh.
        side: side of the hand, if the file does not state it; of two hands, the one to read.
        fps: frames a second, if the file does not state it.
        mano_dir: folder of the user's MANO files, for the exact wrist of smplx translations, poses
            relative to the mean pose, and the keypoints of files that hold MANO's parameters alone;
            GENEOH_MANO_DIR where it is None.
        unit: of the mesh files in `obj`.
        joint_order: order of the keypoints, where the file holds bare `joints`.
        keypoint_unit: unit of the lengths in a file of bare `joints`, including `camera_position`,
            and of `object_pose`; by default metres.
        object_pose: for a file without motion of the object: (T, 4, 4) or (T, Q, 4, 4) poses,
            object to the hand's frame; a file of them or of a trajectory (npy, npz, TUM, KITTI,
            CSV, JSON); or a folder with one text file per frame that holds its matrix.
        camera: position of the camera in the world, metres, for hands that were estimated from
            images, if the file does not state it; (0, 0, 0) or "origin" if the coordinates are in
            the camera's frame.
        camera_pose: poses of a camera that moves, camera to world, if hands and object are in its
            frame; as `object_pose`, and known in every frame.

    Raises:
        InputError: a file cannot be read as one interaction; the message says why.
    """
    camera = place_of(camera, "geneoh.load") if isinstance(camera, str) else camera
    mano_dir = mano_folder(mano_dir)
    if source := SOURCE_OF_ENDING.get(Path(path).suffix.lower()):
        bare = {"joint_order": joint_order, "keypoint_unit": keypoint_unit, "camera": camera}
        shared = {"side": side, "fps": fps, "mano_dir": mano_dir, "unit": unit}
        bare |= {"object_pose": object_pose, "camera_pose": camera_pose}
        given = {"obj": obj or (), **shared, **bare}
        sequence = read(source, path, **given)
        for note in sequence.assumed:
            LOG.warning("%s: %s", path, note)
        return sequence
    path, meshes = Path(path), None if obj is None else meshes_of(obj, unit) or None
    poses = poses_of(object_pose, "geneoh.load", keypoint_unit)
    cameras = poses_of(camera_pose, "geneoh.load", keypoint_unit, "camera")
    record = layouts.read_fields(path)
    layout = layouts.layout_of(record)
    record = with_joint_order(record, layout, joint_order)
    record = in_metres(record, layout, keypoint_unit)
    record = with_callers(record, "obj_pose", poses and poses.matrices)
    record = with_callers(record, "camera_position", camera)
    record = with_callers(record, CAMERA_POSES, cameras and cameras.matrices)
    if meshes is None:
        about_mesh, (meshes, missing) = (), objects.find_meshes(record, path)
    else:
        about_mesh, missing = objects.notes_on_meshes(record, meshes), ""
    # before the reading, because a misspelt field may be why it fails
    misspelt = tuple(layouts.misspelt_fields(record, layout))
    for note in misspelt:
        LOG.warning("%s: %s", path, note)
    sequence, notes = sequence_in(record, layout, meshes, side, fps, mano_dir, poses, cameras)
    notes = (*notes, *about_mesh, *([missing] if missing else []))
    for note in notes:
        LOG.warning("%s: %s", path, note)
    made_from = record.optional_text("source") if layout == FORMAT else None
    source = f"{path.name} ({'; '.join((LAYOUT_NAMES[layout], *notes))})"
    if made_from:
        source = f"{source} made from {shortened(made_from, 300)}"
    motion = replace(sequence.object, missing=missing)
    left_out = layouts.BODY_LEFT_OUT if "body_pose" in record else ""
    assumed = (*misspelt, *notes)
    sequence = replace(sequence, object=motion, source=source, left_out=left_out, assumed=assumed)
    check_sequence(sequence, str(path))
    return sequence


def with_joint_order(record: Record, layout: layouts.Layout, order: JointOrder) -> Record:
    """The fields, with bare joints reordered from the caller's order to OpenPose's."""
    if order == "openpose":
        return record
    refuse_layout(record, layout, "--joint-order", "in OpenPose order")
    shape, unit = ("T", ORDERS[order].count, 3), f"in metres, in the order {order}"
    points = record.array("joints", shape, unit=unit)
    return in_openpose_order(record, points, order)


def refuse_layout(record: Record, layout: layouts.Layout, option: str, always: str) -> None:
    """Refuse an option for bare joints if the file has another layout, which leaves no choice."""
    if layout != "joints":
        raise InputError(
            f"{record.where}: {option} is for bare 'joints', got {LAYOUT_NAMES[layout]}, which is "
            f"always {always}; drop the option"
        )


def with_callers(record: Record, name: str, value: Array | Place | None) -> Record:
    """The fields with one added by the caller; `InputError` if the file states the same already."""
    if value is None:
        return record
    what, option, names, which = CALLERS[name]
    if own := [name for name in names if name in record]:
        raise InputError(
            f"{record.where}: {what} must be given once, got {option} and {quoted(own)}; "
            f"drop {which}"
        )
    return replace(record, values={**record.values, name: np.asarray(value)})


def in_metres(record: Record, layout: layouts.Layout, unit: Unit | None) -> Record:
    """The fields of a file of bare joints, with lengths converted to metres."""
    if unit is None:
        return record
    refuse_layout(record, layout, "--keypoint-unit", "in metres")
    values = dict(record.values)
    for name in {"joints", "object_translation", "camera_position"} & values.keys():
        values[name] = METRES[unit] * record.numbers(name)
    for name in {"obj_pose", CAMERA_POSES} & values.keys():
        values[name] = pose_field(record, name).copy()
        values[name][..., :3, 3] *= METRES[unit]
    return replace(record, values=values)


def sequence_in(
    record: Record,
    layout: layouts.Layout,
    meshes: tuple[Mesh, ...],
    side: Side | None = None,
    fps: float | None = None,
    mano_dir: Path | str | None = None,
    object_poses: PoseTrack | None = None,
    camera_poses: PoseTrack | None = None,
) -> tuple[Sequence, Notes]:
    """The sequence in the fields of a layout, and notes on what was assumed.

    The caller's `object_poses` replace the field 'obj_pose', and `camera_poses` the field
    'camera_to_world', matched with the hand's frames.
    """
    hands, about_hands = read_hands(record, layout, side, mano_dir)
    rate, clock, notes = timing_of(record, hands[0].frames, fps)
    set_poses = object_poses and object_poses.without_unset(meshes)
    for name, track in (("obj_pose", set_poses), (CAMERA_POSES, camera_poses)):
        if track is not None:
            poses, about_poses = track.of_frames(hands[0].frames, record.where, clock)
            record = replace(record, values={**record.values, name: poses})
            notes = (*about_poses, *notes)
    motion, about_object = with_parts(objects.read_object(record, meshes, hands[0].frames))
    about_object += objects.notes_on_gaps(motion)
    sequence = with_camera_fields(record, Sequence(hands, motion, rate))
    if clock is not None and sequence.frames == hands[0].frames:
        sequence, _ = clock.even(sequence)
    return sequence, (*about_hands, *about_object, *notes)


def with_camera_fields(record: Record, sequence: Sequence) -> Sequence:
    """The sequence with the camera's ray or position from a file, which holds for all hands, and
    with its motion."""
    if CAMERA_POSES in record:
        poses = float32(pose_field(record, CAMERA_POSES, shapes=CAMERA_SHAPES))
        sequence = replace(sequence, camera_to_world=poses)
    there = [name for name in CAMERA_FIELDS if name in record]
    if len(there) > 1:
        raise InputError(f"{record.where}: got {quoted(there)}; remove one of them")
    known = {"camera_ray": with_rays, "camera_position": seen_from}
    for name in there:
        values = float32(record.array(name, (3,), ("T", 3)).reshape(-1, 3))
        sequence = known[name](sequence, values, f"{record.where}: '{name}'")
    return sequence


def save_sequence(
    sequence: Sequence, path: Path | str, *, extra: Mapping[str, np.ndarray] | None = None
) -> None:
    """Write a sequence as a geneoh-sequence npz, atomically; equal sequences give equal bytes.

    Of the object's meshes it stores hashes, and paths relative to the npz. A mesh that is in no
    file is not stored, which is logged as a warning. `extra` arrays are stored under their names;
    `load` ignores them.

    Raises:
        InputError: the path cannot be written, or the sequence has no hand, two hands of one side,
            another number of frames than its object, or betas of two hand models.
        ValueError: an extra array has the name of a field of the layout, or holds objects.
    """
    path = Path(path)
    check_tracks(sequence)
    meshes = objects.mesh_arrays(sequence.object.meshes, path)
    arrays = sequence_arrays(sequence) | meshes
    if taken := arrays.keys() & (extra or {}).keys():
        raise ValueError(f"extra arrays need names of their own, got {sorted(taken)}")
    write_archive(path, {**arrays, **(extra or {})})
    if objects.HASHES in meshes and objects.FILES not in meshes:
        LOG.warning(
            "%s: %s; give it again, as obj, when the file is read", path, objects.IN_NO_FILE
        )


def sequence_arrays(sequence: Sequence) -> Arrays:
    """The fields of the geneoh-sequence layout."""
    motion, about = sequence.object, {"format": FORMAT, "version": layouts.VERSION}
    about |= {"fps": sequence.fps, "source": sequence.source}
    arrays: Arrays = {name: np.array(value) for name, value in about.items()}
    arrays |= motion_arrays(motion)
    if sequence.camera_to_world is not None:
        arrays[CAMERA_POSES] = plain(sequence.camera_to_world)
    models = {hand.hand_model for hand in sequence.hands if hand.hand_model is not None}
    if AS_SHIPPED in models:  # the right hand is the same in both variants
        models.discard(MENDED)
    if len(models) > 1:
        raise InputError(
            f"{sequence.source or 'the sequence'}: the betas of both hands must be of one hand "
            f"model, got {quoted(sorted(models))}; leave 'betas' and 'hand_model' of one hand out"
        )
    if models:
        arrays["hand_model"] = np.array(models.pop())
    for hand in sequence.hands:
        arrays.update(hand_arrays(hand))
    rays = [hand.camera_ray for hand in sequence.hands]
    if rays[0] is not None and all(ray is not None and rays[0].equal(ray) for ray in rays):
        for hand in sequence.hands:
            arrays["camera_ray"] = arrays.pop(own_names(hand.side)["camera_ray"])
    return arrays


def motion_arrays(motion: ObjectTrack) -> Arrays:
    """The fields of the object's motion; none where there is no object."""
    if not motion.is_known:
        return {}
    known = [name for name in MOTION_FIELDS if getattr(motion, name) is not None]
    arrays = {f"object_{name}": plain(getattr(motion, name)) for name in known}
    if motion.valid is not None:
        arrays["object_filled"] = plain(~motion.valid & motion.valid.any(0))
    return arrays


def hand_arrays(hand: HandTrack) -> Arrays:
    """The fields of one hand, its side in front of each name."""
    names = own_names(hand.side)
    known = [name for name in names if getattr(hand, name) is not None]
    arrays = {names[name]: plain(getattr(hand, name)) for name in known}
    if hand.pose is not None:
        arrays[names["pose"]] = plain(hand.pose.reshape(-1, 48))
    return arrays


def plain(values: Tensor) -> np.ndarray:
    """A tensor as a numpy array, detached and on the CPU; float32 if it is floating point."""
    return values.detach().to("cpu", torch.float32 if values.is_floating_point() else None).numpy()
