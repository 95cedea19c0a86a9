"""Keypoints that a tracker did not find in a frame in which it found the others."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.hand.skeleton import KEYPOINT_PARENTS
from geneoh.readers.records import Notes

FEWEST_KEYPOINTS = 11
"""Least number of keypoints with which a frame holds a hand: half of them."""


def without_missing(
    joints: Float[Tensor, "T 21 3"], confidence: Float[Tensor, "T 21"] | None
) -> tuple[Float[Tensor, "T 21 3"], Float[Tensor, "T 21"] | None, Notes]:
    """Keypoints with missing ones filled in, their confidence, and notes.

    In frames with a hand a missing keypoint gets a confidence of 0 and the position of its parent;
    a missing wrist that of the mean of the others. Zeros in place of most keypoints leave no
    confidence in the frame, and become NaN where no frame has a hand.
    """
    missing = missing_keypoints(joints)
    there = (~missing).sum(-1) >= FEWEST_KEYPOINTS
    few = ~there & joints.isfinite().flatten(1).all(1)
    missing &= (there | few)[:, None]
    if not bool(there.any()):
        return joints.masked_fill(missing[..., None], torch.nan), confidence, ()
    if not bool(missing.any()):
        return joints, confidence, ()
    filled = joints.clone()
    middle = joints.masked_fill(missing[..., None], torch.nan).nanmean(1)
    for point, parent in enumerate(KEYPOINT_PARENTS):
        near = middle if parent < 0 else filled[:, parent]
        filled[:, point] = torch.where(missing[:, point, None], near, filled[:, point])
    sure = joints.new_ones(missing.shape) if confidence is None else confidence
    note = (
        f"{int(missing.sum())} keypoints are NaN or at the origin in {int(missing.any(-1).sum())} "
        f"of {len(joints)} frames: they count for nothing"
    )
    if bool(few.any()):
        note += f"; in {int(few.sum())} of these they are most of the hand, and nothing counts"
    return filled, sure.masked_fill(missing | few[:, None], 0.0).float(), (note,)


def missing_keypoints(joints: Float[Tensor, "T 21 3"]) -> Bool[Tensor, "T 21"]:
    """Mask of keypoints that are not finite, or zero, as some trackers write undetected ones.

    A wrist that is zero in every frame with a hand is the origin, and not missing.
    """
    zero = (joints == 0).all(-1)
    zero &= ~zero.all(-1, keepdim=True)
    found = joints.isfinite().all(-1).any(-1) & (joints != 0).any(-1).any(-1)
    if bool(zero[found, 0].all()):
        zero[:, 0] = False
    return ~joints.isfinite().all(-1) | zero
