"""Build tracks and sequences from a source's numbers, following the source's convention.

Numbers stay float64 in numpy until here, so that changes of unit and frame lose no accuracy.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import torch

from geneoh.body.motion import PosedBody
from geneoh.body.skeleton import WRISTS
from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.hand.mano import AS_SHIPPED, ManoName, name_of
from geneoh.readers import transforms
from geneoh.readers.base import ManoConvention, ManoParameters, ReaderOptions, finite_frames
from geneoh.readers.foreign_files import field_by_frame
from geneoh.readers.mano import MEAN_OFFSET_NOTE, Mano, mean_wrist_offset, pose_of_coefficients
from geneoh.readers.records import Array, Notes, Record, float32
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence, without_unseen

CHAINS: dict[Side, slice] = {"left": slice(0, 15), "right": slice(15, 30)}
"""Slice of each hand among the 30 finger joints of a body."""

NO_MANO = "got no MANO files; pass --mano with the folder of your MANO_RIGHT.pkl and MANO_LEFT.pkl"


def mano_track(
    numbers: ManoParameters, convention: ManoConvention, options: ReaderOptions, where: str
) -> tuple[HandTrack, Notes]:
    """A track from MANO parameters, with keypoints if stored or computed by MANO; and notes."""
    refuse_other_lengths(where, numbers)
    mano = options.mano(numbers.side, convention.left_hand)
    if mano is None and convention.mean_added:
        if numbers.joints is None:
            raise InputError(f"{where}: the pose is relative to MANO's mean pose, {NO_MANO}")
        note = "the pose is relative to MANO's mean pose and was left out; pass --mano to have it"
        return hand_track(numbers.side, numbers.joints, numbers.confidence), (note,)
    pose = numbers.pose.reshape(-1, 16, 3)
    if mano is not None and convention.mean_added:
        pose = pose + np.concatenate([np.zeros(3), mano.mean]).reshape(16, 3)
    betas = np.zeros(10) if numbers.betas is None else numbers.betas
    if numbers.template is not None and mano is not None:
        mano = replace(mano, model=replace(mano.model, template=float32(numbers.template)))
        betas = np.zeros(10)
    wrist, notes = _wrist_of(numbers, convention, mano, betas)
    joints = numbers.joints
    if joints is None and mano is not None:
        joints = mano.keypoints(pose, wrist, betas)
    own = {"betas": numbers.betas, "left_hand": convention.left_hand}
    hand = hand_track(numbers.side, joints, numbers.confidence, pose=pose, wrist=wrist, **own)
    return hand if numbers.to_world is None else hand_in_frame(hand, numbers.to_world), notes


def mano_of_coefficients(
    options: ReaderOptions, side: Side, where: str, left_hand: ManoName = AS_SHIPPED
) -> Mano:
    """The user's MANO, to decode PCA coefficients into a pose; `InputError` without MANO files."""
    mano = options.mano(side, left_hand)
    if mano is None:
        raise InputError(f"{where}: the pose is coefficients of MANO's components, {NO_MANO}")
    return mano


def hand_of_rows(
    record: Record, name: str, side: Side, rows: Array, betas: Array, mano: Mano
) -> ManoParameters:
    """One hand in absolute pose, from (T, 51) rows: orientation, PCA coefficients, translation."""
    fingers = pose_of_coefficients(record, name, rows[:, 3:48], mano, add_mean=True)
    pose = np.concatenate([rows[:, :3], fingers], axis=1)
    return ManoParameters(side, pose, rows[:, 48:], betas)


def refuse_other_lengths(where: str, numbers: ManoParameters) -> None:
    """Refuse parameters of one hand that do not have the same number of frames."""
    names = ("pose", "translation", "joints", "confidence", "to_world")
    values = {name: getattr(numbers, name) for name in names}
    lengths = {name: len(value) for name, value in values.items() if value is not None}
    if len(set(lengths.values())) > 1:
        got = ", ".join(f"{length} of the {name}" for name, length in lengths.items())
        raise InputError(
            f"{where}: expected the same number of frames in all that is stored of the "
            f"{numbers.side} hand, got {got}; its files are of different clips or versions"
        )


def _wrist_of(
    numbers: ManoParameters, convention: ManoConvention, mano: Mano | None, betas: Array
) -> tuple[Array, Notes]:
    """(T, 3) wrist positions: exact with MANO or stored keypoints, else with the mean hand's J0."""
    if convention.translation == "wrist":
        return numbers.translation, ()
    if mano is not None:
        return numbers.translation + mano.wrist_offset(betas), ()
    if numbers.joints is not None:
        return numbers.joints[:, 0], ()
    return numbers.translation + mean_wrist_offset(numbers.side), (MEAN_OFFSET_NOTE,)


def hand_by_frame(
    side: Side,
    records: Mapping[int, Record],
    frames: int,
    pose: str,
    translation: str,
    betas: str | None = None,
    *,
    quaternions: bool = False,
) -> ManoParameters:
    """One hand from records by frame number; NaN in those of the `frames` without a record.

    The pose is 48 numbers, or 16 quaternions wxyz; the betas are averaged over the frames.
    """
    turns = field_by_frame(records, pose, frames, *((16, 4) if quaternions else (48,)))
    places = field_by_frame(records, translation, frames, 3)
    shapes = [record.array(betas, (10,)) for record in records.values()] if betas else []
    angles = transforms.axis_angles_of_wxyz(turns) if quaternions else turns
    return ManoParameters(side, angles, places, np.mean(shapes, axis=0) if shapes else None)


def joints_if_complete(joints: Array, pose: Array) -> Array | None:
    """Stored keypoints; None if a frame with a pose lacks them, so that MANO computes them all."""
    return joints if bool(np.isfinite(joints[finite_frames(pose)]).all()) else None


def hand_track(
    side: Side,
    joints: Array | None = None,
    confidence: Array | None = None,
    *,
    pose: Array | None = None,
    wrist: Array | None = None,
    betas: Array | None = None,
    left_hand: ManoName = AS_SHIPPED,
) -> HandTrack:
    """A track of keypoints, MANO parameters, or both; a frame with NaN counts as not observed.

    The pose is (T, 16, 3) absolute axis-angle. Wrist (T, 3) and joints (T, 21, 3, OpenPose order)
    are in metres. `left_hand` is the variant of the left hand that the (10,) betas belong to.
    """
    parts = [part for part in (pose, wrist, joints) if part is not None]
    valid = np.asarray(np.stack([finite_frames(part) for part in parts]).all(axis=0))
    return HandTrack(
        side=side,
        valid=torch.from_numpy(valid),
        joints=masked(joints, valid),
        pose=masked(pose, valid),
        wrist=masked(wrist, valid),
        betas=None if betas is None else float32(betas),
        hand_model=None if pose is None else name_of(side, left_hand),
        confidence=None if confidence is None else float32(np.nan_to_num(confidence)),
    )


def hands_of_body(posed: PosedBody, fingers: Array) -> list[HandTrack]:
    """Both hands of a body, with (T, 30, 3) absolute axis-angle of the fingers, left then right."""
    hands = []
    for side, joint in WRISTS.items():
        root = transforms.axis_angles(posed.rotations[:, joint].double().numpy())[:, None]
        pose = np.concatenate([root, fingers[:, CHAINS[side]]], axis=1)
        wrist = posed.positions[:, joint].double().numpy()
        hands.append(hand_track(side, pose=pose, wrist=wrist))
    return hands


def masked(values: Array | None, valid: Array) -> torch.Tensor | None:
    """Values with NaN in every frame without a hand, because a zero would look like a position."""
    if values is None:
        return None
    values = np.array(values, dtype=np.float64)
    values[~valid] = np.nan
    return float32(values)


def object_track(meshes: Iterable[Mesh], motion: Array) -> ObjectTrack:
    """An object of Q parts, from (T, 4, 4) or (T, Q, 4, 4) poses, object to world, in metres."""
    parts = motion if motion.ndim == 4 else motion[:, None]
    rotation, translation = float32(parts[..., :3, :3]), float32(parts[..., :3, 3])
    return fill_object(ObjectTrack(tuple(meshes), rotation, translation))


def hand_in_frame(hand: HandTrack, frame: Array) -> HandTrack:
    """A hand transformed to another frame by (T, 4, 4) matrices; the wrist is moved as a point."""
    rotation, shift = (torch.from_numpy(part) for part in (frame[:, :3, :3], frame[:, :3, 3]))
    joints, pose, wrist = hand.joints, hand.pose, hand.wrist
    if joints is not None:
        joints = (joints.double() @ rotation.transpose(-1, -2) + shift[:, None]).float()
    if wrist is not None:
        wrist = ((rotation @ wrist.double()[..., None])[..., 0] + shift).float()
    if pose is not None:
        root = frame[:, :3, :3] @ transforms.rotation_matrices(pose[:, 0].double().numpy())
        pose = torch.cat([float32(transforms.axis_angles(root))[:, None], pose[:, 1:]], dim=1)
    return replace(hand, joints=joints, pose=pose, wrist=wrist)


def stretch_of(sequence: Sequence, span: slice) -> Sequence:
    """The sequence cut to a slice of frames, without hands that are observed in none of them."""
    source = f"{sequence.source}, frames {span.start} to {span.stop - 1}"
    return replace(without_unseen(sequence[span]), source=source)
