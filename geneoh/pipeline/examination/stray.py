"""Detect stray keypoints, which a tracker placed apart from the hand, and give them zero trust.

Bones are rigid. If the distance of two neighbouring keypoints differs from that in the other
frames, one of them is wrong, and would make the networks bend the fingers in the frames around it.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import numbered
from geneoh.fitting.shape import NORMAL_SPREAD
from geneoh.hand.skeleton import KEYPOINT_PARENTS
from geneoh.sequence.sequence import HandTrack

EDGES = (*((KEYPOINT_PARENTS[k], k) for k in range(1, 21)), (1, 5), (5, 9), (9, 13), (13, 17))
"""Pairs of keypoints with constant distance: bones, and neighbouring knuckles."""
EDGE_ENDS = torch.zeros(len(EDGES), 21).index_put_(
    (torch.arange(len(EDGES)).repeat(2), torch.tensor(EDGES).T.flatten()), torch.tensor(1.0)
)
FEWEST_OBSERVED = 10  # observed frames that are needed for reliable median distances
LEAST_ERROR, DEVIATIONS = 0.02, 6.0  # a distance is wrong beyond 2 cm and 6 standard deviations
MOST_STRAY = 5  # stray keypoints per frame; with more, the whole hand is wrong, or another hand


def without_strays(hand: HandTrack) -> tuple[HandTrack, tuple[str, ...]]:
    """The track with zero confidence for stray keypoints, and sentences for the user."""
    if hand.joints is None or int(hand.observed.sum()) < FEWEST_OBSERVED:
        return hand, ()
    stray = strays(hand.joints, hand.trust > 0)
    if not bool(stray.any()):
        return hand, ()
    count, frames = int(stray.sum()), numbered(int(stray.any(-1).sum()), "frame")
    note = f"the {hand.side} hand has {numbered(count, 'keypoint')} apart from it in {frames}"
    return replace(hand, confidence=hand.trust * ~stray), (f"{note}: taken as missing",)


def strays(joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"]) -> Bool[Tensor, "T 21"]:
    """Mask of trusted keypoints whose distance to their neighbours is wrong."""
    ends = EDGE_ENDS.to(joints)
    known = joints.masked_fill(~trusted[..., None], torch.nan)
    start, end = torch.tensor(EDGES, device=joints.device).T
    length = (known[:, start] - known[:, end]).norm(dim=-1)
    usual = length.nanmedian(0).values
    # the scale of a hand varies with the depth that an estimator assumes
    size = (length / usual).nanmedian(1, keepdim=True).values
    error = (length - size * usual).abs()
    broken = error > (DEVIATIONS * NORMAL_SPREAD * error.nanmedian(0).values).clamp(min=LEAST_ERROR)
    found, here = torch.zeros_like(trusted), (~error.isnan()).to(joints)
    mean = (error.nan_to_num() @ ends) / (here @ ends).clamp(min=1)
    for _ in range(MOST_STRAY + 1):
        # the keypoint with most wrong distances; ties go to the largest mean deviation
        worst = (broken.to(joints) @ ends + mean / (mean.amax(-1, keepdim=True) + 1)).argmax(-1)
        new = torch.nn.functional.one_hot(worst, 21).bool() & broken.any(-1, keepdim=True)
        found |= new
        broken = broken & (new.to(joints) @ ends.T == 0)
    return found & (found.sum(-1, keepdim=True) <= MOST_STRAY)
