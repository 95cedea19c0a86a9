"""Single keypoints that a tracker put apart from the hand: they count for nothing.

A hand is rigid but for its joints. Where the distance of two neighbouring keypoints is not what it
is in the other frames, one of them is wrong, and would make the networks bend every frame around
it.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import numbered
from geneoh.hand.skeleton import KEYPOINT_PARENTS
from geneoh.sequence.sequence import HandTrack

EDGES = (*((KEYPOINT_PARENTS[k], k) for k in range(1, 21)), (1, 5), (5, 9), (9, 13), (13, 17))
"""Keypoints that keep their distance: bones, and the knuckles beside each other."""
ENDS = torch.zeros(len(EDGES), 21).index_put_(
    (torch.arange(len(EDGES)).repeat(2), torch.tensor(EDGES).T.flatten()), torch.tensor(1.0)
)
SHORTEST = 10  # frames below which nothing tells what a distance usually is
LEAST, DEVIATIONS = 0.02, 6.0  # a distance is wrong from 2 cm and so many usual deviations on
MOST = 5  # stray keypoints of a frame; with more of them the whole hand is wrong, or another one


def without_strays(hand: HandTrack) -> tuple[HandTrack, tuple[str, ...]]:
    """The track in which stray keypoints have no confidence, and what to say of it."""
    if hand.joints is None or int(hand.observed.sum()) < SHORTEST:
        return hand, ()
    stray = strays(hand.joints, hand.trust > 0)
    if not bool(stray.any()):
        return hand, ()
    count, frames = int(stray.sum()), numbered(int(stray.any(-1).sum()), "frame")
    said = f"the {hand.side} hand has {numbered(count, 'keypoint')} apart from it in {frames}"
    return replace(hand, confidence=hand.trust * ~stray), (f"{said}: taken as missing",)


def strays(joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"]) -> Bool[Tensor, "T 21"]:
    """Trusted keypoints that are not where their neighbours allow."""
    ends = ENDS.to(joints)
    known = joints.masked_fill(~trusted[..., None], torch.nan)
    start, end = torch.tensor(EDGES, device=joints.device).T
    length = (known[:, start] - known[:, end]).norm(dim=-1)
    usual = length.nanmedian(0).values
    # hands that an estimator sees nearer or farther are larger or smaller
    size = (length / usual).nanmedian(1, keepdim=True).values
    off = (length - size * usual).abs()
    broken = off > (DEVIATIONS * 1.4826 * off.nanmedian(0).values).clamp(min=LEAST)
    found, here = torch.zeros_like(trusted), (~off.isnan()).to(joints)
    mean = (off.nan_to_num() @ ends) / (here @ ends).clamp(min=1)
    for _ in range(MOST + 1):
        # the one with most of the wrong distances; of several the one whose others are off as well
        worst = (broken.to(joints) @ ends + mean / (mean.amax(-1, keepdim=True) + 1)).argmax(-1)
        new = torch.nn.functional.one_hot(worst, 21).bool() & broken.any(-1, keepdim=True)
        found |= new
        broken = broken & (new.to(joints) @ ends.T == 0)
    return found & (found.sum(-1, keepdim=True) <= MOST)
