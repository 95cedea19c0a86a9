"""Read the hands of an npz in each of the layouts.

The caller must pass what the file leaves open and only its owner knows, such as the side of the
hand. Assumptions are noted.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import Side
from geneoh.errors import InputError, MissingAssetError
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.library import hand_of_betas, load_hand
from geneoh.hand.mano import AS_SHIPPED, MANO_NAMES, find_mano, load_pose_space, name_of
from geneoh.readers import mano
from geneoh.readers.base import finite_frames
from geneoh.readers.keypoints.missing import without_missing
from geneoh.readers.npz import layouts
from geneoh.readers.npz.layouts import JOINT_NAMES, SMPLX_PARAMETERS, Layout
from geneoh.readers.npz.tracks import read_betas, read_hand_model, read_track
from geneoh.readers.records import Notes, Record, float32
from geneoh.readers.transforms import read_turns
from geneoh.sequence.sequence import HandTrack


def read_hands(
    record: Record, layout: Layout, side: Side | None = None, mano_dir: Path | str | None = None
) -> tuple[tuple[HandTrack, ...], Notes]:
    """The hand tracks of a file in a known layout, and notes on what was assumed; see `load`."""
    hands, notes = read_layout(record, layout, side, mano_dir)
    return tuple(with_keypoints(hand, mano_dir) for hand in hands), notes


def with_keypoints(hand: HandTrack, mano_dir: Path | str | None) -> HandTrack:
    """A track of pose and MANO's betas alone with its keypoints, by the MANO hand of the betas.

    Other hand models ignore these betas, and would pose their mean hand. Unchanged without MANO's
    file of that side.
    """
    pose, wrist, betas, model = hand.pose, hand.wrist, hand.betas, hand.hand_model
    if hand.joints is not None or pose is None or wrist is None or betas is None:
        return hand
    if mano_dir is None or model not in MANO_NAMES:
        return hand
    with suppress(MissingAssetError):
        shaped = load_hand(hand.side, source=model, mano_dir=mano_dir).shaped(betas)
        joints = shaped.joints_from_rotations(axis_angle_to_matrix(pose), wrist)
        return replace(hand, joints=joints)
    return hand


def read_layout(
    record: Record, layout: Layout, side: Side | None, mano_dir: Path | str | None
) -> tuple[tuple[HandTrack, ...], Notes]:
    """As `read_hands`, with the keypoints that the file holds."""
    if layout == "geneoh-sequence":
        return read_own(record, side)
    side = side_of(record, side)
    if layout == "smplx":
        hand, notes = read_smplx(record, side, mano_dir)
    elif layout == "taco":  # TACO used MANO's official left hand unchanged
        shipped = name_of(side, AS_SHIPPED)
        hand, notes = read_track(record, side, layouts.TACO_NAMES, hand_model=shipped)
    else:
        hand, notes = read_track(record, side, JOINT_NAMES)
    return (hand,), notes


def side_of(record: Record, given: Side | None) -> Side:
    """Side of the hand in a file of one hand: its field 'side' or the caller's; both must agree."""
    side = record.optional_text("side")
    side = side and side.strip().lower()
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
    """Geneoh's own layout: one or two hands, the side in front of each field name."""
    names: dict[Side, dict[str, str]] = {s: layouts.own_names(s) for s in ("right", "left")}
    sides: list[Side] = [s for s in names if record.values.keys() & names[s].values()]
    if not sides or given not in (None, *sides):
        wanted = f"a {given} hand" if given else "at least one hand"
        cure = "drop --side" if sides else f"add '{given or 'right'}_joints'"
        raise InputError(
            f"{record.where}: expected {wanted}, got {' and '.join(sides) or 'none'}; {cure}"
        )
    sides = [given] if given else sides
    # if no hand is observed, `read_track` below raises the error
    seen: list[Side] = [side for side in sides if is_seen(record, names[side])] or sides
    unseen = tuple(f"the {s} hand is in no frame and was left out" for s in sides if s not in seen)
    found = [read_track(record, s, names[s], hand_model=read_hand_model(record, s)) for s in seen]
    notes = (note for _, about in found for note in about)
    return tuple(hand for hand, _ in found), (*unseen, *notes)


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
    """The smplx layout: orientation and finger pose (or matrices), translation of MANO's origin."""
    for name in SMPLX_PARAMETERS[:2]:
        if name not in record:
            raise InputError(
                f"{record.where}: the smplx layout needs 'global_orient' and 'hand_pose', "
                f"got no '{name}'; add it"
            )
    model = read_hand_model(record, side, AS_SHIPPED)
    root = read_rotations(record, "global_orient", 1)
    fingers = read_fingers(record, side, mano_dir)
    record.refuse_lengths(*SMPLX_PARAMETERS)
    mean, about_mean = mean_to_add(record, side, mano_dir)
    wrist, notes = None, ()
    transl = record.tensor("transl", ("T", 3), unit="in metres")
    joints = record.tensor("joints", ("T", 21, 3), unit="in metres")
    if transl is not None and (joints is None or knows_wrist(record, side, model, mano_dir)):
        offset, notes = offset_of_wrist(side, model, read_betas(record, "betas")[0], mano_dir)
        wrist = transl + offset
    elif joints is not None:
        wrist = without_missing(joints, None)[0][:, 0]
    names = {**JOINT_NAMES, "betas": "betas"}
    pose = torch.cat([root, fingers + mean], dim=1)
    made = {"parameters": SMPLX_PARAMETERS, "pose": pose, "wrist": wrist}
    hand, more = read_track(record, side, names, hand_model=model, **made)
    return hand, (*about_mean, *notes, *more)


def mean_to_add(
    record: Record, side: Side, mano_dir: Path | str | None
) -> tuple[Float[Tensor, "15 3"], Notes]:
    """MANO's mean pose if the file's poses are relative to it, else zeros; and notes.

    Relative poses (`flat_hand_mean=False`) are the default of smplx.
    """
    flat = record.optional_number("flat_hand_mean")
    if flat == 0 and mano_dir is None:
        raise record.refuse(
            "flat_hand_mean",
            "true (zero is the flat hand) without MANO",
            "pass --mano, by which the mean pose is added, or add hands_mean to 'hand_pose'",
        )
    mean = load_pose_space(side, mano_dir).mean if flat == 0 else torch.zeros(45)
    return mean.reshape(15, 3), () if flat else tuple(pose_assumed(record))


def pose_assumed(record: Record) -> Iterator[str]:
    """A note on how the pose is read, where fields that say so are missing."""
    meanings = {"flat_hand_mean": "absolute"}
    if record.numbers("hand_pose").ndim == 2:  # coefficients have one axis as well
        meanings["use_pca"] = "axis-angle vectors"
    untold = [name for name in meanings if name not in record]
    if untold:
        taken = " ".join(meanings[name] for name in untold)
        verb = "says" if len(untold) == 1 else "say"
        yield f"the pose is taken as {taken}; {' and '.join(map(repr, untold))} {verb} otherwise"


def read_fingers(
    record: Record, side: Side, mano_dir: Path | str | None
) -> Float[Tensor, "T 15 3"]:
    """Finger poses as axis-angle, from rotations or, where the file says `use_pca`, from
    coefficients of MANO's first pose components; the mean pose is not in them."""
    if not record.optional_number("use_pca"):
        return read_rotations(record, "hand_pose", 15)
    if mano_dir is None:
        raise record.refuse(
            "use_pca",
            "false (the pose is rotations) without MANO",
            "pass --mano, by which the coefficients are decoded, or decode them first",
        )
    components = load_pose_space(side, mano_dir).components
    coefficients = float32(record.array("hand_pose", ("T", "C")))
    if coefficients.shape[1] > len(components):
        raise record.refuse("hand_pose", f"at most {len(components)} coefficients")
    return (coefficients @ components[: coefficients.shape[1]]).unflatten(1, (15, 3))


def read_rotations(record: Record, name: str, count: int) -> Float[Tensor, "T R 3"]:
    """`count` rotations per frame as axis-angle, from axis-angle or from matrices."""
    remedy = "of PCA coefficients say 'use_pca' and pass --mano" if count > 1 else ""
    turns = float32(read_turns(record, name, count, remedy=remedy))
    return turns if turns.ndim < 4 else matrix_to_axis_angle(turns)


def knows_wrist(record: Record, side: Side, model: str | None, mano_dir: Path | str | None) -> bool:
    """Whether the translation gives the exact wrist: the file names its hand model, and it is
    there. The first keypoint of a result may be millimetres from the wrist of its hand."""
    if "hand_model" not in record:
        return False
    if mano_dir is not None:
        with suppress(MissingAssetError):
            return bool(find_mano(side, mano_dir))
    return model not in MANO_NAMES


def offset_of_wrist(
    side: Side,
    model: str | None,
    betas: Float[Tensor, " 10"] | None,
    mano_dir: Path | str | None,
) -> tuple[Float[Tensor, " 3"], Notes]:
    """Offset from the origin to the wrist of the hand that the betas belong to; that of MANO's mean
    hand without its files."""
    if model in MANO_NAMES and mano_dir is None:
        return float32(mano.mean_wrist_offset(side)), (mano.MEAN_OFFSET_NOTE,)
    hand = hand_of_betas(side, model, mano_dir=mano_dir)
    return hand.rest_wrist(torch.zeros(10) if betas is None else betas), ()
