"""Outputs of HaMeR and WiLoR as their users dump them: one file for all images, or one per image.

pred_mano_params {global_orient (B, 1, 3, 3), hand_pose (B, 15, 3, 3), betas}, pred_keypoints_3d
(B, 21, 3), pred_cam (B, 3), with box_center, box_size, img_size and right from the batch, or what
the demos make of those: pred_cam_t_full and scaled_focal_length; 'frame', the image number of each
row; needed wherever an image may have two hands or none. Camera frame, metres; the demos' focal
length puts hands much too far away: --focal. WiLoR-mini's results are read too: the same fields
under 'wilor_preds', with axis-angle vectors.

Both estimate right hands only: images of left hands were mirrored, and the results are mirrored
back here. The demos mirror some of the fields back themselves, in place, and WiLoR-mini all of
them. Which fields of a dump are still mirrored is inferred from how they fit each other.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.errors import numbered
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points, mirror_rotations
from geneoh.hand.library import load_hand
from geneoh.hand.mano import MENDED
from geneoh.readers import base, transforms
from geneoh.readers.builders import hand_track
from geneoh.readers.dataset_reader import reads
from geneoh.readers.hamer_dumps import ENDINGS, Detections, dumps, read_detections
from geneoh.readers.records import Array, Notes

FOCAL_NOTE = "the demos' focal length: much too deep, pass --focal"
MIRRORED_NOTE = "some fields of left hands were mirrored back already"


@reads(
    *(f"*{ending}" for ending in ENDINGS),
    choose=dumps,
    any_file=True,
    fps=None,
    takes=("focal", "object_pose", "camera_pose"),
)
def hamer(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands in the camera's frame, with the caller's object."""
    found, notes = read_detections(clip.path, options.focal)
    found, more = as_estimated(found)
    first, frames = int(found.frame.min()), int(np.ptp(found.frame)) + 1
    rows: dict[Side, Array] = {side: _rows_of(found, side) for side in ("right", "left")}
    hands = [
        _hand_of(found.take(own, "N"), s, first, frames) for s, own in rows.items() if len(own)
    ]
    notes = (*notes, *more, *notes_on_crowds(found))
    yield base.ClipParts(
        f"HaMeR or WiLoR {clip.name}",
        [hand_track(**hand, left_hand=MENDED) for hand in hands],  # right hands, mirrored
        notes=notes if options.focal else (*notes, FOCAL_NOTE),
        cross_checks=base.CrossChecks(joints={hand["side"]: hand["joints"] for hand in hands}),
        first=first,
        camera=(0.0, 0.0, 0.0),
    )


def _keypoints_of(found: Detections, side: Side) -> Array:
    """(N, 21, 3) keypoints of hands of one side in the camera's frame."""
    points = found.points if side == "right" else mirror_points(found.points)
    return points + found.place[:, None]


def _rows_of(found: Detections, side: Side) -> Array:
    """(M,) rows of one side, one per frame: of several, the one nearest to the frame before."""
    wrist = _keypoints_of(found, side)[:, 0]
    chosen: list[int] = []
    rows = np.argsort(found.frame, kind="stable")
    for row in rows[found.right[rows] == (side == "right")].tolist():
        if not chosen or found.frame[row] != found.frame[chosen[-1]]:
            chosen.append(row)
        elif len(chosen) > 1:
            before, last = wrist[chosen[-2]], wrist[chosen[-1]]
            if np.linalg.norm(wrist[row] - before) < np.linalg.norm(last - before):
                chosen[-1] = row
    return np.array(chosen, dtype=int)


def notes_on_crowds(found: Detections) -> Iterator[str]:
    """A note for each side of which some images have several hands."""
    for side, wanted in (("right", True), ("left", False)):
        images = np.bincount(found.frame[found.right == wanted] - found.frame.min())
        if count := int((images > 1).sum()):
            yield (
                f"in {numbered(count, 'image')} more than one {side} hand: the one nearest to that "
                "of the image before is kept"
            )


def _hand_of(found: Detections, side: Side, first: int, frames: int) -> dict[str, Any]:
    """The arguments of `hand_track` for detections of one hand; NaN in frames without one."""
    pose, joints = np.full((frames, 16, 3), np.nan), np.full((frames, 21, 3), np.nan)
    turns, at = transforms.axis_angles(found.turns), found.frame - first
    pose[at] = turns if side == "right" else mirror_axis_angle(turns)
    joints[at] = _keypoints_of(found, side)
    numbers = {"pose": pose, "wrist": joints[:, 0], "betas": found.betas.mean(0)}
    return {"side": side, "joints": joints, **numbers}


def as_estimated(found: Detections) -> tuple[Detections, Notes]:
    """Detections whose left hands are as estimated from mirrored images, and a note.

    Poses and keypoints are mirrored, or not, so that they agree best under the kinematics of a
    right hand. The sign of the crop camera's shift is the one that centres keypoints in their crop.
    """
    left = ~found.right
    if not left.any():
        return found, ()
    turns = found.turns[left], mirror_rotations(found.turns[left])
    points = found.points[left], mirror_points(found.points[left])
    hand, origin = load_hand("right").shaped(torch.zeros(10)), torch.zeros(3)
    rotations = (torch.from_numpy(each).float() for each in turns)
    posed = [hand.joints_from_rotations(each, origin).numpy() for each in rotations]
    about_wrist = [each - each[:, :1] for each in points]
    misfit = {
        (pose, own): np.nanmean(np.linalg.norm(posed[pose] - about_wrist[own], axis=-1))
        for pose, own in product((False, True), repeat=2)
    }
    pose_mirrored, points_mirrored = min(misfit, key=misfit.__getitem__)
    found.turns[left], found.points[left] = turns[pose_mirrored], points[points_mirrored]
    rows = found.take(left, "N")
    crop_mirrored = off_crop(rows, -1) < off_crop(rows, 1)
    if crop_mirrored:
        found.place[left, 0] += 2 * rows.crop[:, 1]
    changed = pose_mirrored or points_mirrored or crop_mirrored
    return found, (MIRRORED_NOTE,) if changed else ()


def off_crop(rows: Detections, sign: int) -> float:
    """Distance of the keypoints' centre from their crop's, in half crop widths, with a sign of the
    crop camera's shift; 0 if that camera is unknown."""
    x = rows.points[..., 0]
    middle = (x.min(-1) + x.max(-1)) / 2
    return float(np.nan_to_num(np.abs(rows.crop[:, 0] * (middle + sign * rows.crop[:, 1]))).mean())
