"""Tracks out of a source's numbers: dialects of MANO, rigid frames, objects, gaps.

Numbers stay float64 in numpy until here, so that units and frames cost no accuracy.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.hand.mano import AS_SHIPPED, ManoName, name_of
from geneoh.readers.base import CrossChecks, ReaderOptions, Recording, finite_frames, runs
from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.mano import Mano
from geneoh.readers.npz_hands import MEAN_WRIST_OFFSET
from geneoh.readers.records import Array
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

OPENPOSE_FROM_M = ORDERS["mano"].entries
"""Keypoint i is entry i of this among 16 MANO joints and the tips of thumb, index, middle, ring,
pinky: the order of ARCTIC and HO-3D."""

FLIP_X = np.array([-1.0, 1.0, 1.0])
"""Reflection of points x -> -x."""

OFFSET_NOTE = (
    "the wrist was placed with the offset of MANO's mean hand, some 5 mm off for other hands; "
    "pass --mano to have it exact"
)


@dataclass(frozen=True)
class ManoConvention:
    """How a source uses MANO."""

    origin: bool
    """True: the translation is that of the model's origin (O), False: of the wrist (W)."""
    mean_added: bool = False
    """True: MANO's mean pose belongs on top of the numbers (flat_hand_mean=False)."""
    hand: ManoName = AS_SHIPPED
    """Whose left hand its betas mean."""


@dataclass(frozen=True)
class ManoParameters:
    """One hand as a source has it; frames that are NaN were not observed."""

    side: Side
    pose: Array
    """(T, 48) axis-angle."""
    trans: Array
    """(T, 3) metres."""
    betas: Array | None = None
    """(10,)"""
    joints: Array | None = None
    """(T, 21, 3) as the source stores them, OpenPose order, the frame of `trans`."""
    confidence: Array | None = None
    """(T, 21)"""


Track = tuple[HandTrack, tuple[str, ...]]
"""A hand and what had to be assumed about it."""


def mano_track(
    numbers: ManoParameters,
    dialect: ManoConvention,
    known: ReaderOptions,
    where: str,
    *,
    template: Array | None = None,
) -> Track:
    """A track from MANO's numbers in a source's dialect, with keypoints where they can be had.

    Args:
        numbers: what the source has.
        dialect: how it means them.
        known: the caller's MANO files, if any.
        where: the file, for messages.
        template: (778, 3) the person's own mesh, which stands in for betas.

    Raises:
        InputError: the dialect cannot be read without MANO.
    """
    mano = None if known.mano is None else known.mano(numbers.side, dialect.hand)
    if mano is None and dialect.mean_added:
        if numbers.joints is None:
            raise InputError(
                f"{where}: the pose is relative to MANO's mean pose, got no MANO files; pass "
                "--mano with the folder of your MANO_RIGHT.pkl and MANO_LEFT.pkl"
            )
        note = "the pose is relative to MANO's mean pose and was left out; pass --mano to have it"
        return joints_track(numbers.side, numbers.joints, numbers.confidence), (note,)
    pose, notes = numbers.pose.reshape(-1, 16, 3), ()
    if mano is not None and dialect.mean_added:
        pose = pose + np.concatenate([np.zeros(3), mano.mean]).reshape(16, 3)
    betas = np.zeros(10) if numbers.betas is None else numbers.betas
    if template is not None and mano is not None:
        mano = replace(mano, model=replace(mano.model, template=tensor(template)))
        betas = np.zeros(10)
    wrist = numbers.trans
    if dialect.origin:
        if mano is None and numbers.joints is not None:
            wrist = numbers.joints[:, 0]
        else:
            offset, notes = offset_of(mano, numbers.side, betas)
            wrist = wrist + offset
    joints = numbers.joints
    if joints is None and mano is not None:
        joints = mano.keypoints(pose, wrist, betas)
    return hand_track(
        numbers.side,
        pose=pose,
        wrist=wrist,
        joints=joints,
        betas=numbers.betas,
        hand=dialect.hand,
        confidence=numbers.confidence,
    ), notes


def offset_of(mano: Mano | None, side: Side, betas: Array) -> tuple[Array, tuple[str, ...]]:
    """From MANO's origin to its wrist: exact with the model, else that of the mean hand."""
    if mano is not None:
        return mano.wrist_offset(betas), ()
    x, y, z = MEAN_WRIST_OFFSET
    return np.array([x if side == "right" else -x, y, z]), (OFFSET_NOTE,)


def hand_track(
    side: Side,
    *,
    pose: Array,
    wrist: Array,
    joints: Array | None = None,
    betas: Array | None = None,
    hand: ManoName = AS_SHIPPED,
    confidence: Array | None = None,
) -> HandTrack:
    """A track of MANO's numbers, of which every frame with NaN counts as not observed."""
    parts = [part for part in (pose, wrist, joints) if part is not None]
    valid = np.asarray(np.stack([finite_frames(part) for part in parts]).all(axis=0))
    return HandTrack(
        side=side,
        valid=torch.from_numpy(valid),
        joints=None if joints is None else blanked(joints, valid),
        pose=blanked(pose, valid),
        wrist=blanked(wrist, valid),
        betas=None if betas is None else tensor(betas),
        hand_model=name_of(side, hand),
        confidence=None if confidence is None else tensor(np.nan_to_num(confidence)),
    )


def joints_track(side: Side, joints: Array, confidence: Array | None = None) -> HandTrack:
    """A track of keypoints alone, of which every frame with NaN counts as not observed."""
    valid = finite_frames(joints)
    trust = None if confidence is None else tensor(np.nan_to_num(confidence))
    return HandTrack(side, torch.from_numpy(valid), joints=blanked(joints, valid), confidence=trust)


def blanked(values: Array, valid: Array) -> torch.Tensor:
    """Values with NaN wherever nothing was observed: never a zero that looks like a place."""
    values = np.array(values, dtype=np.float64)
    values[~valid] = np.nan
    return tensor(values)


def tensor(values: Array) -> torch.Tensor:
    """float32, as all tracks are; what is too large for it becomes infinite, and is refused."""
    with np.errstate(over="ignore"):
        return torch.from_numpy(np.array(values, dtype=np.float32))


def object_track(meshes: Iterable[Mesh], matrices: Array) -> ObjectTrack:
    """An object from (T, Q, 4, 4) object-to-world matrices in metres, one mesh for each part."""
    return ObjectTrack(tuple(meshes), tensor(matrices[..., :3, :3]), tensor(matrices[..., :3, 3]))


def object_of(known: ReaderOptions, frames: int, where: str) -> tuple[ObjectTrack, tuple[str, ...]]:
    """The caller's object beside a source that has none; without one, nothing that moves."""
    if known.object_pose is None:
        note = () if known.meshes else ("the source has no object; give one with --obj",)
        count = max(1, len(known.meshes))
        still = np.tile(np.eye(4), (frames, count, 1, 1))
        return object_track(known.meshes, still), note
    pose = known.object_pose if known.object_pose.ndim == 4 else known.object_pose[:, None]
    if len(pose) != frames:
        raise InputError(
            f"{where}: the object's poses must be one for each of the {frames} frames, "
            f"got {len(pose)}; cut them to the same frames"
        )
    return object_track(known.meshes, pose), ()


def matrices(rotation: Array, translation: Array) -> Array:
    """(T, 4, 4) from (T, 3, 3) and (T, 3)."""
    result = np.tile(np.eye(4), (len(rotation), 1, 1))
    result[:, :3, :3], result[:, :3, 3] = rotation, translation
    return result


def turned(vectors: Array) -> Array:
    """(T, 3, 3) matrices of axis-angle vectors; frames of NaN stay NaN."""
    known = np.isfinite(vectors).all(-1)
    result = np.full((*vectors.shape[:-1], 3, 3), np.nan)
    if known.any():
        result[known] = Rotation.from_rotvec(vectors[known]).as_matrix()
    return result


def axis_angles(rotations: Array) -> Array:
    """(..., 3) axis-angle vectors of (..., 3, 3) matrices; NaN stays NaN."""
    flat = rotations.reshape(-1, 3, 3)
    known = np.isfinite(flat).all((-1, -2))
    sound = np.zeros(len(flat), dtype=bool)
    sound[known] = np.linalg.det(flat[known]) > 0.5
    result = np.full((len(flat), 3), np.nan)
    if sound.any():
        result[sound] = Rotation.from_matrix(flat[sound]).as_rotvec()
    return result.reshape(*rotations.shape[:-2], 3)


def quats_wxyz(quats: Array) -> Array:
    """(..., 3) axis-angle vectors of (..., 4) quaternions, real part first; zeros become NaN."""
    flat = quats.reshape(-1, 4)
    sound = np.isfinite(flat).all(-1) & (np.abs(flat).sum(-1) > 0.1)
    result = np.full((len(flat), 3), np.nan)
    if sound.any():
        result[sound] = Rotation.from_quat(flat[sound][:, [1, 2, 3, 0]]).as_rotvec()
    return result.reshape(*quats.shape[:-1], 3)


def hand_in(hand: HandTrack, frame: Array) -> HandTrack:
    """A hand taken into another frame by (T, 4, 4) matrices; the wrist moves as a point does."""
    rotation, shift = (torch.from_numpy(part) for part in (frame[:, :3, :3], frame[:, :3, 3]))
    joints, pose, wrist = hand.joints, hand.pose, hand.wrist
    if joints is not None:
        joints = (joints.double() @ rotation.transpose(-1, -2) + shift[:, None]).float()
    if wrist is not None:
        wrist = ((rotation @ wrist.double()[..., None])[..., 0] + shift).float()
    if pose is not None:
        root = frame[:, :3, :3] @ turned(pose[:, 0].double().numpy())
        pose = torch.cat([tensor(axis_angles(root))[:, None], pose[:, 1:]], dim=1)
    return replace(hand, joints=joints, pose=pose, wrist=wrist)


def mirrored_x(pose: Array) -> Array:
    """(T, 16, 3) axis-angle of the other hand: the reflection x -> -x."""
    return pose * np.array([1.0, -1.0, -1.0])


def recordings(
    name: str,
    sequence: Sequence,
    *,
    object_known: Array,
    after_jump: Array | None = None,
    mesh_names: tuple[str, ...] = (),
    evidence: CrossChecks | None = None,
) -> list[Recording]:
    """One recording for each stretch of frames in which the object's place is known.

    Args:
        name: of the clip; with several stretches the first frame of each is added.
        sequence: all frames of the clip.
        object_known: (T,) the frames that have the object's place.
        after_jump: (T,) frames that do not follow in time from the one before them.
        mesh_names: what the files of the object's meshes are called.
        evidence: over all frames.

    Raises:
        InputError: it is known in no frame, or in none with a hand.
    """
    if not object_known.any():
        raise InputError(f"{name}: expected the object's pose in some frame, got none")
    evidence = evidence or CrossChecks()
    stretches = runs(object_known, after_jump)
    if len(stretches) == 1 and object_known.all():
        return [Recording(name, sequence, mesh_names, evidence)]
    found = [
        Recording(
            f"{name}_{span.start:05d}",
            part_of(sequence, span),
            mesh_names,
            evidence[span],
        )
        for span in stretches
        if any(bool(hand.valid[span].any()) for hand in sequence.hands)
    ]
    if not found:
        raise InputError(f"{name}: expected a hand and the object in one frame, got none")
    return found


def part_of(sequence: Sequence, span: slice) -> Sequence:
    """The frames of a slice; hands that were observed in none of them are left out."""
    part = sequence[span]
    hands = tuple(hand for hand in part.hands if bool(hand.valid.any()))
    source = f"{sequence.source}, frames {span.start} to {span.stop - 1}"
    return replace(part, hands=hands, source=source)


def sequence_of(
    tracks: Iterable[Track], motion: ObjectTrack, fps: float, source: str, *notes: str
) -> Sequence:
    """A sequence of the hands that were observed at all, with what was assumed in its source.

    Raises:
        InputError: no hand was observed.
    """
    observed = [track for track in tracks if bool(track[0].valid.any())]
    if not observed:
        raise InputError(f"{source}: expected a hand in some frame, got none; nothing to clean")
    said = dict.fromkeys([*notes, *(note for _, more in observed for note in more)])
    words = f"{source} ({'; '.join(said)})" if said else source
    return Sequence(tuple(hand for hand, _ in observed), motion, fps, words)
