"""Hand tracks and the object's motion out of the fields of an npz, in each of its layouts.

What only the file's owner knows, such as the side of the hand, must come from the caller when the
file leaves it open; what had to be assumed is noted.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.hand.library import load_hand
from geneoh.hand.mano import AS_SHIPPED, MENDED, load_pose_space, name_of
from geneoh.readers import mano, npz_layouts
from geneoh.readers.base import finite_frames
from geneoh.readers.foreign_files import AS_MATRICES, POSE_SHAPES
from geneoh.readers.missing_keypoints import without_missing
from geneoh.readers.npz_layouts import JOINT_NAMES, OBJECT_FIELDS, SMPLX_PARAMETERS, Layout, quoted
from geneoh.readers.records import Array, Notes, Record, float32
from geneoh.readers.transforms import read_turns, refuse_bottom_row
from geneoh.sequence.camera import unit_rays
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import HandTrack, ObjectTrack, refuse_unknown_model

MOTION_MISSING = (
    "neither; add them, for an object that does not move the identity and zeros in every frame; "
    "`geneoh denoise`, `generate --body` and `batch` also take --object-pose POSES.npy"
)

IN_CONFIDENCE = "write 0 where nothing is known of a keypoint, or leave the field out"
"""What to do about NaN in a confidence."""


def read_hands(
    record: Record, layout: Layout, side: Side | None = None, mano_dir: Path | str | None = None
) -> tuple[tuple[HandTrack, ...], Notes]:
    """The hand tracks of a file in a known layout, and what had to be assumed; see `load`."""
    if layout == "geneoh-sequence":
        return read_own(record, side)
    side = side_of(record, side)
    if layout == "smplx":
        hand, notes = read_smplx(record, side, mano_dir)
    elif layout == "taco":  # which used the official left file as it is
        shipped = name_of(side, AS_SHIPPED)
        hand, notes = read_track(record, side, npz_layouts.TACO_NAMES, hand_model=shipped)
    else:
        hand, notes = read_track(record, side, JOINT_NAMES)
    return (hand,), notes


def side_of(record: Record, given: Side | None) -> Side:
    """Which hand a file of one hand holds, by its field 'side' or the caller, who must agree."""
    side = record.optional_text("side")
    if side not in (None, "left", "right"):
        raise record.refuse("side", "'left' or 'right'", "correct it")
    if side is None and given is None:
        raise InputError(
            f"{record.where}: a field 'side' must say which hand it holds, got none; "
            "pass --side left or --side right"
        )
    if side is not None and given not in (None, side):
        raise InputError(
            f"{record.where}: 'side' says {side}, where the {given} hand is asked for; correct one "
            "of the two"
        )
    return given or ("left" if side == "left" else "right")


def read_own(record: Record, given: Side | None) -> tuple[tuple[HandTrack, ...], Notes]:
    """Our own layout: up to two hands, each field with its side in front."""
    names: dict[Side, dict[str, str]] = {s: npz_layouts.own_names(s) for s in ("right", "left")}
    sides: list[Side] = [s for s in names if record.values.keys() & names[s].values()]
    if not sides or given not in (None, *sides):
        wanted = f"a {given} hand" if given else "at least one hand"
        cure = "drop --side" if sides else f"add '{given or 'right'}_joints'"
        raise InputError(
            f"{record.where}: expected {wanted}, got {' and '.join(sides) or 'none'}; {cure}"
        )
    sides = [given] if given else sides
    # where none is seen, reading refuses all of them
    seen: list[Side] = [side for side in sides if is_seen(record, names[side])] or sides
    unseen = tuple(f"the {s} hand is in no frame and was left out" for s in sides if s not in seen)
    found = [read_track(record, s, names[s], hand_model=_read_model(record, s)) for s in seen]
    notes = (note for _, about in found for note in about)
    return tuple(hand for hand, _ in found), (*unseen, *notes)


def _read_model(record: Record, side: Side, default: str | None = None) -> str | None:
    """Whose betas of one side a file has: MANO's right hand has one form only."""
    model = record.optional_text("hand_model")
    refuse_unknown_model(model, record.where)
    model = model or default
    return name_of(side, model) if model in (MENDED, AS_SHIPPED) else model


def is_seen(record: Record, names: dict[str, str]) -> bool:
    """Whether some frame holds a hand: by its mask, else by numbers that are finite and not 0."""
    if names["valid"] in record:
        return bool(record.flags(names["valid"]).any())
    placed = [names[name] for name in ("joints", "pose", "wrist") if names[name] in record]
    if names["joints"] in placed and not record.numbers(names["joints"]).any():
        return False
    arrays = (np.atleast_1d(record.numbers(name)) for name in placed)
    return not placed or any(finite_frames(array).any() for array in arrays)


def read_smplx(record: Record, side: Side, mano_dir: Path | str | None) -> tuple[HandTrack, Notes]:
    """The names of smplx: pose in two parts (matrices too), translation of MANO's origin."""
    for name in SMPLX_PARAMETERS[:2]:
        if name not in record:
            raise InputError(
                f"{record.where}: the smplx layout needs 'global_orient' and 'hand_pose', "
                f"got no '{name}'; add it"
            )
    model = _read_model(record, side, AS_SHIPPED)
    root = read_rotations(record, "global_orient", 1)
    fingers = read_rotations(record, "hand_pose", 15)
    record.refuse_lengths(*SMPLX_PARAMETERS)
    mean, about_mean = mean_to_add(record, side, mano_dir)
    wrist, notes = None, ()
    transl = record.tensor("transl", ("T", 3), unit="in metres")
    joints = record.tensor("joints", ("T", 21, 3), unit="in metres")
    if joints is not None:
        wrist = joints[:, 0]
    elif transl is not None:
        betas = read_betas(record, "betas")[0] if model in (MENDED, AS_SHIPPED) else None
        offset, notes = offset_of_wrist(side, betas, mano_dir)
        wrist = transl + offset
    names = {**JOINT_NAMES, "betas": "betas"}
    pose = torch.cat([root, fingers + mean], dim=1)
    made = {"parameters": SMPLX_PARAMETERS, "pose": pose, "wrist": wrist}
    hand, more = read_track(record, side, names, hand_model=model, **made)
    return hand, (*about_mean, *notes, *more)


def mean_to_add(
    record: Record, side: Side, mano_dir: Path | str | None
) -> tuple[Float[Tensor, "15 3"], Notes]:
    """MANO's mean pose where a file's poses are relative to it, else zeros; and what was assumed.

    smplx makes hands so (`flat_hand_mean=False`) where nobody asks for anything else.
    """
    said = record.optional_number("flat_hand_mean")
    if said == 0 and mano_dir is None:
        raise record.refuse(
            "flat_hand_mean",
            "true (zero is the flat hand) without MANO",
            "pass --mano, by which the mean pose is added, or add hands_mean to 'hand_pose'",
        )
    if said == 0:
        return load_pose_space(side, mano_dir).mean.reshape(15, 3), ()
    note = "the pose is taken as absolute; 'flat_hand_mean' says otherwise"
    return torch.zeros(15, 3), () if said else (note,)


def read_rotations(record: Record, name: str, count: int) -> Float[Tensor, "T R 3"]:
    """`count` rotations per frame as axis-angle, from axis-angle or from matrices."""
    remedy = "decode PCA coefficients to 15 axis-angle triples first" if count > 1 else ""
    turns = float32(read_turns(record, name, count, remedy=remedy))
    return turns if turns.ndim < 4 else matrix_to_axis_angle(turns)


def offset_of_wrist(
    side: Side, betas: Float[Tensor, " 10"] | None, mano_dir: Path | str | None
) -> tuple[Float[Tensor, " 3"], Notes]:
    """From MANO's origin to the wrist, with the left hand of smplx; or the mean hand's."""
    if mano_dir is None:
        return float32(mano.mean_wrist_offset(side)), (mano.MEAN_OFFSET_NOTE,)
    hand = load_hand(side, source=AS_SHIPPED, mano_dir=mano_dir)
    return hand.rest_wrist(torch.zeros(10) if betas is None else betas), ()


def read_betas(
    record: Record, name: str, mask: str = "valid"
) -> tuple[Float[Tensor, " 10"] | None, Notes]:
    """Shape coefficients; one set per frame is averaged over those of the mask, which is noted."""
    betas, notes = record.tensor(name, (10,), ("T", 10)), ()
    if betas is not None and betas.ndim == 2:
        observed = betas[frames_with_shape(record, betas, mask)]
        notes = (f"'{name}' averaged over {len(observed)} frames",) if len(betas) > 1 else ()
        betas = observed.mean(0)
    if betas is not None and not bool(betas.isfinite().all()):
        raise InputError(
            f"{record.where}: the betas must be finite, got {betas.tolist()}; fix them"
        )
    return betas, notes


def frames_with_shape(
    record: Record, betas: Float[Tensor, "T 10"], mask: str = "valid"
) -> Bool[Tensor, " T"]:
    """Frames of the mask with betas that are not all 0; all finite ones where there is none."""
    finite = all_finite(betas)
    seen = finite & betas.any(1)
    if mask in record and len(flags := record.flags(mask)) == len(betas):
        seen &= flags
    return seen if bool(seen.any()) else finite


def read_confidence(record: Record, name: str) -> Float[Tensor, "T 21"] | None:
    """Trust in each keypoint, from one number per frame or per keypoint."""
    values = record.tensor(name, ("T", 21), ("T",), unit="from 0 to 1")
    if values is None:
        return None
    if bool(((values < 0) | (values > 1)).any()):
        low, high = float(values.nan_to_num().min()), float(values.nan_to_num().max())
        raise InputError(
            f"{record.where}: '{name}' must be between 0 and 1, got {low:g} to {high:g}; rescale it"
        )
    return values if values.ndim == 2 else values[:, None].repeat(1, 21)


def read_track(
    record: Record,
    side: Side,
    names: dict[str, str],
    *,
    hand_model: str | None = None,
    parameters: Sequence[str] = (),
    pose: Float[Tensor, "T 16 3"] | None = None,
    wrist: Float[Tensor, "T 3"] | None = None,
) -> tuple[HandTrack, Notes]:
    """One hand from its fields, with the frames that can be used marked as valid.

    `names` has the file's name of each of `HAND_FIELDS` that its layout has; `parameters` are
    further fields, from which `pose` and `wrist` were made.
    """
    field = {name: names.get(name, "") for name in npz_layouts.HAND_FIELDS}
    joints = record.tensor(field["joints"], ("T", 21, 3), unit="in metres, in OpenPose order")
    if pose is None:
        pose = record.tensor(field["pose"], ("T", 48), ("T", 16, 3), unit="in radians")
        pose = None if pose is None else pose.reshape(-1, 16, 3)
    if wrist is None:
        wrist = record.tensor(field["wrist"], ("T", 3), unit="in metres")
    betas, notes = read_betas(record, field["betas"], field["valid"])
    confidence, missed = read_confidence(record, field["confidence"]), ()
    spread = record.tensor(field["joint_spread"], ("T", 21), unit="in metres")
    ray = record.tensor(field["camera_ray"], ("T", 3), unit="as directions")
    if ray is not None:
        ray = unit_rays(ray, len(ray), f"{record.where}: '{field['camera_ray']}'")
    per_frame = [*parameters, *(field[name] for name in npz_layouts.HAND_FIELDS if name != "betas")]
    there = [name for name in per_frame if name in record]
    record.refuse_lengths(*there)
    if joints is None and (pose is None or wrist is None):
        raise InputError(
            f"{record.where}: the {side} hand needs its joints, or its pose with the wrist's "
            f"place, got {quoted(there) or 'neither'}; add the rest"
        )
    if joints is not None:
        joints, confidence, missed = without_missing(joints, confidence)
    parts = {"joints": joints, "pose": pose, "wrist": wrist, "confidence": confidence}
    parts["joint_spread"] = spread
    known = {n: all_finite(part) for n, part in parts.items() if part is not None}
    finite = {field[name] or name: frames for name, frames in known.items()}
    valid, more = observed_frames(record, side, field, finite)
    if confidence is not None and not bool(confidence[valid].any()):
        ignored = f"'{field['confidence']}' is 0 everywhere: it is ignored, and all keypoints count"
        more = (*more, ignored)
    hand = HandTrack(side, valid, joints, pose, wrist, betas, hand_model, confidence, spread, ray)
    return hand, (*notes, *missed, *more)


def observed_frames(
    record: Record, side: Side, field: dict[str, str], finite: dict[str, Bool[Tensor, " T"]]
) -> tuple[Bool[Tensor, " T"], Notes]:
    """Frames that hold a hand: those of the file's mask, which must be finite, else the finite."""
    mask, whole = field["valid"], torch.stack(list(finite.values())).all(0)
    if mask in record:
        return masked_frames(record, side, field, finite), ()
    lost = int((~whole).sum())
    names = [name for name, frames in finite.items() if not bool(frames.all())]
    if lost == len(whole):
        cure = IN_CONFIDENCE if names == [field["confidence"]] else "there is nothing to clean"
        raise InputError(
            f"{record.where}: at least one frame must hold the {side} hand, got {lost} frames with "
            f"NaN in {quoted(names)}; {cure}"
        )
    note = f"{lost} of {len(whole)} frames hold NaN in {quoted(names)} and count as not observed"
    return whole, (note,) if lost else ()


def masked_frames(
    record: Record, side: Side, field: dict[str, str], finite: dict[str, Bool[Tensor, " T"]]
) -> Bool[Tensor, " T"]:
    """Frames that hold a hand by the file's mask, in which all must be finite."""
    mask = field["valid"]
    valid = record.flags(mask)
    if not bool(valid.any()):
        raise InputError(
            f"{record.where}: at least one frame must hold the {side} hand, got {len(valid)} "
            f"frames without by '{mask}'; there is nothing to clean"
        )
    wrong = valid & ~torch.stack(list(finite.values())).all(0)
    if bool(wrong.any()):
        names = [name for name, frames in finite.items() if bool((valid & ~frames).any())]
        cure = IN_CONFIDENCE if names == [field["confidence"]] else "mark them as not valid"
        raise InputError(
            f"{record.where}: {quoted(names)} of the {side} hand must be finite where '{mask}' is "
            f"true, got NaN or infinity in {int(wrong.sum())} frames, the first is "
            f"{int(wrong.nonzero()[0])}; {cure}"
        )
    return valid


def all_finite(values: Float[Tensor, "T ..."]) -> Bool[Tensor, " T"]:
    """For each frame, whether all of its numbers are finite."""
    return values.isfinite().flatten(1).all(1) if values.ndim > 1 else values.isfinite()


def read_object(record: Record, meshes: tuple[Mesh, ...], frames: int) -> ObjectTrack:
    """The motion from rotation and translation or 4x4 matrices; without mesh and motion none."""
    pair = [name for name in OBJECT_FIELDS[:2] if name in record]
    if not (pair or meshes or "obj_pose" in record):
        return ObjectTrack.resting((), frames)
    if ("obj_pose" in record) == bool(pair):
        raise InputError(
            f"{record.where}: the object's motion must be given once, as 'object_rotation' with "
            f"'object_translation' or as 'obj_pose', got "
            + (f"{quoted(pair)} and 'obj_pose'; remove one of them" if pair else MOTION_MISSING)
        )
    if "obj_pose" in record:
        unit = "object to world"
        matrix = record.array("obj_pose", *POSE_SHAPES, unit=unit, remedy=AS_MATRICES)
        matrix = matrix if matrix.ndim == 4 else matrix[:, None]
        refuse_bottom_row(record.where, "'obj_pose'", matrix)
        rotation, translation = matrix[..., :3, :3], matrix[..., :3, 3]
        return observed_object(record, meshes, rotation, translation)
    if len(pair) == 1:
        (other,) = {*OBJECT_FIELDS[:2]} - {*pair}
        raise InputError(f"{record.where}: '{pair[0]}' needs '{other}', got none; add it")
    cure = "turn axis-angle or quaternions into matrices"
    shapes = (("T", "Q", 3, 3), ("T", 3, 3))
    rotation = record.array("object_rotation", *shapes, unit="as matrices", remedy=cure)
    translation = record.array("object_translation", ("T", "Q", 3), ("T", 3), unit="in metres")
    record.refuse_lengths(*pair)
    rotation = rotation if rotation.ndim == 4 else rotation[:, None]
    translation = translation if translation.ndim == 3 else translation[:, None]
    if rotation.shape[1] != translation.shape[1]:
        raise InputError(
            f"{record.where}: rotation and translation must have the same number of parts, got "
            f"{rotation.shape[1]} in 'object_rotation' and {translation.shape[1]} in "
            "'object_translation'; give one of each per part"
        )
    return observed_object(record, meshes, rotation, translation)


def observed_object(
    record: Record, meshes: tuple[Mesh, ...], rotation: Array, translation: Array
) -> ObjectTrack:
    """The track with poses that are NaN, or not in `object_valid`, marked and filled."""
    frames, parts = translation.shape[:2]
    seen = record.optional_array("object_valid", ("T", "Q"), ("T",))
    if seen is not None:
        if len(seen) != frames:
            raise record.refuse("object_valid", f"{frames} frames", "give one for each pose")
        seen = np.broadcast_to(seen.reshape(frames, -1) > 0, (frames, parts))
        seen = torch.from_numpy(np.array(seen))
    return fill_object(ObjectTrack(meshes, float32(rotation), float32(translation)), seen)
