"""The track of one hand from the fields of an npz, and the mask of its observed frames."""

from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.hand.mano import MANO_NAMES, name_of
from geneoh.readers.joint_orders import order_of_points
from geneoh.readers.keypoints.missing import without_missing
from geneoh.readers.npz import layouts
from geneoh.readers.npz.layouts import JOINT_NAMES, quoted
from geneoh.readers.records import IN_RADIANS, Notes, Record
from geneoh.sequence.camera import unit_rays
from geneoh.sequence.sequence import HandTrack, refuse_unknown_model

IN_CONFIDENCE = "write 0 where nothing is known of a keypoint, or leave the field out"
"""What to do about NaN in a confidence."""
OF_THE_HAND = "give the ten of a MANO hand, those of a body say nothing about it, or leave them out"
"""What to do about another number of betas."""


def read_hand_model(record: Record, side: Side, default: str | None = None) -> str | None:
    """The hand model that the betas of one side belong to; MANO's right hand has one variant."""
    model = record.optional_text("hand_model")
    refuse_unknown_model(model, record.where)
    model = model or default
    return name_of(side, model) if model in MANO_NAMES else model


def read_betas(
    record: Record, name: str, mask: str = "valid"
) -> tuple[Float[Tensor, " 10"] | None, Notes]:
    """Shape coefficients; if there is a set per frame, their mean over the mask, with a note."""
    betas, notes = record.tensor(name, (10,), ("T", 10), remedy=OF_THE_HAND), ()
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
    """Frames of the mask whose betas are finite and not all 0; if none, all with finite betas."""
    finite = all_finite(betas)
    seen = finite & betas.any(1)
    if mask in record and len(flags := record.flags(mask)) == len(betas):
        seen &= flags
    return seen if bool(seen.any()) else finite


def read_confidence(record: Record, name: str) -> Float[Tensor, "T 21"] | None:
    """Confidence of each keypoint, from one number per frame or per keypoint."""
    values = record.tensor(name, ("T", 21), ("T",), unit="from 0 to 1")
    if values is None:
        return None
    if bool(((values < 0) | (values > 1)).any()):
        low, high = float(values.nan_to_num().min()), float(values.nan_to_num().max())
        raise InputError(
            f"{record.where}: '{name}' must be between 0 and 1, got {low:g} to {high:g}; rescale it"
        )
    return values if values.ndim == 2 else values[:, None].repeat(1, 21)


def order_remedy(record: Record, names: dict[str, str]) -> str:
    """Remedy for keypoints whose number is that of another joint order; empty for other numbers."""
    order = order_of_points(record.values.get(names["joints"]))
    if order is None:
        return ""
    if names is JOINT_NAMES:
        return f"name their order with --joint-order {order}"
    return f"take the 21 out that are geneoh.readers.joint_orders.ORDERS['{order}'].entries"


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
    """One hand from its fields, with the usable frames marked as valid, and notes.

    `names` maps entries of `HAND_FIELDS` to the field names of the layout. `pose` and `wrist` are
    passed if they had to be computed, and `parameters` lists the fields that they came from.
    """
    field = {name: names.get(name, "") for name in layouts.HAND_FIELDS}
    openpose = {"unit": "in metres, in OpenPose order", "remedy": order_remedy(record, names)}
    joints = record.tensor(field["joints"], ("T", 21, 3), **openpose)
    if pose is None:
        pose = record.tensor(field["pose"], ("T", 48), ("T", 16, 3), unit=IN_RADIANS)
        pose = None if pose is None else pose.reshape(-1, 16, 3)
    if wrist is None:
        wrist = record.tensor(field["wrist"], ("T", 3), unit="in metres")
    betas, notes = read_betas(record, field["betas"], field["valid"])
    confidence, missed = read_confidence(record, field["confidence"]), ()
    spread = record.tensor(field["joint_spread"], ("T", 21), unit="in metres")
    ray = record.tensor(field["camera_ray"], ("T", 3), unit="as directions")
    if ray is not None:
        ray = unit_rays(ray, len(ray), f"{record.where}: '{field['camera_ray']}'")
    per_frame = [*parameters, *(field[name] for name in layouts.HAND_FIELDS if name != "betas")]
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
    """Frames with a hand: the file's mask, inside which all must be finite, else finite frames."""
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
    """The file's mask of frames with a hand; `InputError` if it is empty or holds NaN frames."""
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
