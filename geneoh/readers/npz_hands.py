"""Hand tracks out of the fields of a file, one reader per layout.

What only the file's owner knows, such as the side of the hand, is asked for when the file leaves it
open; what had to be assumed is noted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.hand.mano import AS_SHIPPED, MENDED, name_of
from geneoh.readers.fields import Fields, all_finite
from geneoh.readers.npz_layouts import HAND_FIELDS, Layout, quoted
from geneoh.sequence.sequence import HandTrack

WristOffset = Callable[[Side, Float[Tensor, " 10"]], Float[Tensor, " 3"]]
"""Where MANO puts the wrist joint of a hand of these betas before any pose: J0(betas)."""

MEAN_WRIST_OFFSET = (0.096, 0.006, 0.006)
"""J0 of MANO's right mean hand in metres; other betas move it by some 5 mm. The left has -x."""


@dataclass(frozen=True)
class Asked:
    """What the caller knows and the file may leave open."""

    side: Side | None = None
    wrist_offset: WristOffset | None = None


@dataclass(frozen=True)
class Reading:
    """What was found in a file, and what had to be assumed, in words."""

    hands: tuple[HandTrack, ...]
    notes: tuple[str, ...]


def read_hands(fields: Fields, layout: Layout, asked: Asked) -> Reading:
    """The hand tracks of a file in a known layout."""
    if layout == "geneoh-sequence":
        return read_geneoh(fields, asked)
    side = side_of(fields, asked)
    read = {"smplx": read_smplx, "taco": read_taco, "joints": read_joints}[layout]
    return read(fields, side, asked)


def side_of(fields: Fields, asked: Asked) -> Side:
    """Which hand a file of one hand holds: its own word, or the caller's, which must agree."""
    said = fields.text("side")
    if said is not None and said not in ("left", "right"):
        raise fields.refuse("side", "'left' or 'right'", "correct it")
    if said is None and asked.side is None:
        raise InputError(
            f"{fields.file}: which hand it holds must be said by a field 'side', got none; "
            "pass --side left or --side right"
        )
    if said is not None and asked.side not in (None, said):
        raise InputError(
            f"{fields.file}: 'side' says {said}, got --side {asked.side}; drop one of the two"
        )
    return asked.side or ("left" if said == "left" else "right")


def read_geneoh(fields: Fields, asked: Asked) -> Reading:
    """Our own layout: up to two hands, each field with its side in front."""
    sides: list[Side] = [
        side
        for side in ("right", "left")
        if any(f"{side}_{name}" in fields for name in HAND_FIELDS)
    ]
    if not sides or asked.side not in (None, *sides):
        wanted = f"a {asked.side} hand" if asked.side else "at least one hand"
        raise InputError(
            f"{fields.file}: expected {wanted}, got {' and '.join(sides) or 'none'}; "
            f"add '{asked.side or 'right'}_joints'"
        )
    readings = [read_side(fields, side) for side in sides if asked.side in (None, side)]
    return Reading(
        tuple(hand for reading in readings for hand in reading.hands),
        tuple(note for reading in readings for note in reading.notes),
    )


def read_side(fields: Fields, side: Side) -> Reading:
    """One hand of our own layout."""
    pose = fields.floats(f"{side}_pose", ("T", 48), ("T", 16, 3), unit="in radians")
    names = [f"{side}_{name}" for name in HAND_FIELDS if name != "betas"]
    return track(
        fields,
        side,
        names,
        pose=None if pose is None else pose.reshape(-1, 16, 3),
        wrist=fields.floats(f"{side}_wrist", ("T", 3), unit="in metres"),
        betas=fields.floats(f"{side}_betas", (10,), unit="of shape"),
        joints=fields.floats(f"{side}_joints", ("T", 21, 3), unit="in metres"),
        confidence=read_confidence(fields, f"{side}_confidence"),
        joint_spread=fields.floats(f"{side}_joint_spread", ("T", 21), unit="in metres"),
        hand_model=said_model(fields, side),
    )


def said_model(fields: Fields, side: Side) -> str | None:
    """The hand model that a file names, for one of its hands."""
    said = fields.text("hand_model")
    return name_of(side, said) if said in (MENDED, AS_SHIPPED) else said


def read_smplx(fields: Fields, side: Side, asked: Asked) -> Reading:
    """The names of the smplx package: pose in two parts, translation of MANO's origin.

    Rotation matrices, as HaMeR and WiLoR put them out, are taken as well as axis-angle. Left betas
    are those of the official left file, which smplx uses as it is.
    """
    if fields.number("flat_hand_mean") == 0:
        raise fields.refuse(
            "flat_hand_mean", "true (zero is the flat hand)", "add hands_mean to 'hand_pose' first"
        )
    cure = "decode PCA coefficients to 15 axis-angle triples first"
    pose = [
        read_rotations(fields, "global_orient", 1),
        read_rotations(fields, "hand_pose", 15, cure),
    ]
    for name, part in zip(("global_orient", "hand_pose"), pose, strict=True):
        if part is None:
            raise InputError(
                f"{fields.file}: the smplx layout needs 'global_orient' and 'hand_pose', "
                f"got no '{name}'; add it"
            )
    joints = fields.floats("joints", ("T", 21, 3), unit="in metres, in OpenPose order")
    betas, notes = read_betas(fields, "betas")
    names = ["global_orient", "hand_pose", "transl", "joints", "valid", "confidence"]
    fields.refuse_lengths(*names)
    wrist = None if joints is None else joints[:, 0]
    transl = fields.floats("transl", ("T", 3), unit="in metres")
    if wrist is None and transl is not None:
        offset, note = offset_of_wrist(side, betas, asked)
        wrist, notes = transl + offset, notes + note
    reading = track(
        fields,
        side,
        names,
        pose=torch.cat([part for part in pose if part is not None], dim=1),
        wrist=wrist,
        betas=betas,
        joints=joints,
        confidence=read_confidence(fields, "confidence"),
        hand_model=name_of(side, AS_SHIPPED),
    )
    return Reading(reading.hands, (*notes, *reading.notes))


def read_rotations(
    fields: Fields, name: str, count: int, cure: str = ""
) -> Float[Tensor, "T R 3"] | None:
    """`count` rotations per frame as axis-angle, from axis-angle or from matrices."""
    shapes = [("T", 3 * count), ("T", count, 3), ("T", count, 3, 3)]
    values = fields.floats(name, *shapes, unit="in radians", cure=cure)
    if values is None or values.ndim < 4:
        return None if values is None else values.reshape(-1, count, 3)
    return matrix_to_axis_angle(values)


def read_betas(fields: Fields, name: str) -> tuple[Float[Tensor, " 10"] | None, tuple[str, ...]]:
    """Shape coefficients of the sequence; one set per frame is averaged, and that is said."""
    betas = fields.floats(name, (10,), ("T", 10), unit="of shape")
    if betas is None or betas.ndim == 1:
        return betas, ()
    observed = betas[all_finite(betas)]
    notes = (f"'{name}' averaged over {len(observed)} frames",) if len(betas) > 1 else ()
    return observed.mean(0), notes


def offset_of_wrist(
    side: Side, betas: Float[Tensor, " 10"] | None, asked: Asked
) -> tuple[Float[Tensor, " 3"], tuple[str, ...]]:
    """From MANO's origin to its wrist joint: exact with the model, else that of the mean hand."""
    if asked.wrist_offset is not None:
        return asked.wrist_offset(side, torch.zeros(10) if betas is None else betas), ()
    x, y, z = MEAN_WRIST_OFFSET
    note = (
        "the wrist was placed with the offset of MANO's mean hand, some 5 mm off for other hands; "
        "pass --mano, or add 'joints', to have it exact"
    )
    return torch.tensor([x if side == "right" else -x, y, z]), (note,)


def read_taco(fields: Fields, side: Side, asked: Asked) -> Reading:
    """The names of a TACO recording: the whole pose in one, translation of the wrist.

    TACO used the official left file as it is.
    """
    pose = fields.floats("hand_pose", ("T", 48), ("T", 16, 3), unit="in radians")
    names = ["hand_pose", "hand_trans", "hand_joints", "hand_valid"]
    return track(
        fields,
        side,
        names,
        pose=None if pose is None else pose.reshape(-1, 16, 3),
        wrist=fields.floats("hand_trans", ("T", 3), unit="in metres"),
        betas=fields.floats("hand_shape", (10,), unit="of shape"),
        joints=fields.floats("hand_joints", ("T", 21, 3), unit="in metres"),
        hand_model=name_of(side, AS_SHIPPED),
    )


def read_joints(fields: Fields, side: Side, asked: Asked) -> Reading:
    """Keypoints alone."""
    return track(
        fields,
        side,
        ["joints", "valid", "confidence"],
        joints=fields.floats("joints", ("T", 21, 3), unit="in metres, in OpenPose order"),
        confidence=read_confidence(fields, "confidence"),
    )


def read_confidence(fields: Fields, name: str) -> Float[Tensor, "T 21"] | None:
    """Trust in each keypoint, from one number per frame or per keypoint."""
    values = fields.floats(name, ("T", 21), ("T",), unit="from 0 to 1")
    if values is None:
        return None
    if bool(((values < 0) | (values > 1)).any()):
        low, high = float(values.nan_to_num().min()), float(values.nan_to_num().max())
        raise InputError(
            f"{fields.file}: '{name}' must be between 0 and 1, got {low:g} to {high:g}; rescale it"
        )
    return values if values.ndim == 2 else values[:, None].repeat(1, 21)


def track(
    fields: Fields,
    side: Side,
    names: Sequence[str],
    *,
    joints: Tensor | None = None,
    pose: Tensor | None = None,
    wrist: Tensor | None = None,
    betas: Tensor | None = None,
    confidence: Tensor | None = None,
    joint_spread: Tensor | None = None,
    hand_model: str | None = None,
) -> Reading:
    """One hand from its fields, with the frames that can be used marked as valid.

    Args:
        fields: the file.
        side: which hand.
        names: the per-frame fields that it comes from.
        joints, pose, wrist, betas, confidence, joint_spread, hand_model: as in `HandTrack`.
    """
    fields.refuse_lengths(*names)
    if betas is not None and not bool(betas.isfinite().all()):
        raise InputError(f"{fields.file}: the betas must be finite, got {betas.tolist()}; fix them")
    if joints is None and (pose is None or wrist is None):
        raise InputError(
            f"{fields.file}: the {side} hand needs its joints, or its pose with the wrist's place, "
            f"got {quoted(name for name in names if name in fields) or 'neither'}; add the rest"
        )
    parts = [part for part in (joints, pose, wrist, confidence, joint_spread) if part is not None]
    finite = torch.stack([all_finite(part) for part in parts]).all(0)
    said = next((name for name in names if name.endswith("valid") and name in fields), None)
    valid, notes = observed_frames(fields, side, said, finite)
    hand = HandTrack(side, valid, joints, pose, wrist, betas, hand_model, confidence, joint_spread)
    return Reading((hand,), notes)


def observed_frames(
    fields: Fields, side: Side, said: str | None, finite: Bool[Tensor, " T"]
) -> tuple[Bool[Tensor, " T"], tuple[str, ...]]:
    """Frames that hold a hand: those the file says, which must be finite, else the finite ones."""
    valid = finite if said is None else fields.flags(said)
    assert valid is not None, "names that are not in the file were left out above"
    if not bool(valid.any()):
        raise InputError(
            f"{fields.file}: at least one frame must hold the {side} hand, got {len(valid)} frames "
            f"without{'' if said is None else f' by {said!r}'}; there is nothing to clean"
        )
    wrong = torch.nonzero(valid & ~finite)
    if len(wrong):
        raise InputError(
            f"{fields.file}: the {side} hand must be finite where '{said}' is true, got NaN or "
            f"infinity in {len(wrong)} frames, the first is {int(wrong[0])}; mark them as not valid"
        )
    missing = int((~finite).sum())
    if said is not None or missing == 0:
        return valid, ()
    return valid, (f"{missing} of {len(valid)} frames hold NaN and count as not observed",)
