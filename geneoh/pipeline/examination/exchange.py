"""Detect frames in which a tracker swapped the left and the right label, and duplicated hands.

After a swap each track continues at the other hand's position, with fingers that bend backward.
Both cues are used together: a jump alone may have another cause, and hands that are swapped while
they touch do not jump.
"""

from collections.abc import Iterator
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.errors import numbered
from geneoh.pipeline.examination.faults import curls
from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.keypoints import PALM, keypoints_of
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.sequence.windows import runs

JITTER = 0.03  # summed palm displacement, metres, that costs as much as a curl of one palm length
CHANGE = 5.0  # cost of a swap of the labels
FLAT = 0.2  # backward curl of flat fingers, summed over both hands, palm lengths
SAME_PLACE, SHARE_OF_FRAMES = 0.02, 0.5
"""Mean distance of two palms below which they coincide, metres, and the share of frames from which
this is reported."""


def without_exchange(sequence: Sequence) -> tuple[Sequence, tuple[str, ...]]:
    """The sequence with swapped hands corrected, and sentences for the user."""
    if len(sequence.hands) != 2 or not all(bool(h.observed.any()) for h in sequence.hands):
        return sequence, ()
    one, other = with_confidence(sequence.hands)
    notes = tuple(same_place(one, other))
    frames = exchanged(one, other)
    count = int(frames.sum())
    if not count or _fields_of(one) != _fields_of(other):
        return sequence, notes
    where = numbered(count, "frame")
    words = f"the left and the right hand are exchanged in {where}: each got what the other had"
    hands = (with_frames_of(one, other, frames), with_frames_of(other, one, frames))
    return replace(sequence, hands=hands), (*notes, words)


def with_confidence(hands: tuple[HandTrack, ...]) -> tuple[HandTrack, ...]:
    """The hands, all with their `trust` as `confidence` if any of them has one, so that fields and
    scales agree."""
    if all(hand.confidence is None for hand in hands):
        return hands
    return tuple(replace(hand, confidence=hand.trust) for hand in hands)


def same_place(one: HandTrack, other: HandTrack) -> Iterator[str]:
    """A sentence for the user if one hand is a copy of the other."""
    both = one.observed & other.observed
    apart = (keypoints_of(one) - keypoints_of(other))[:, PALM].norm(dim=-1).mean(-1)
    count, seen = int((apart[both] < SAME_PLACE).sum()), int(both.sum())
    if count > SHARE_OF_FRAMES * seen:
        yield (
            f"the left and the right hand are in one place in {count} of {seen} frames, as one "
            "hand under two names; pass --side to clean one of them"
        )


def exchanged(one: HandTrack, other: HandTrack) -> Bool[Tensor, " T"]:
    """Frames in which the two hands are swapped; none if all frames would be."""
    hands = (one, other)
    bends = [curls(keypoints_of(hand), hand.trust != 0, hand.side).nan_to_num() for hand in hands]
    curl = bends[0] + bends[1]
    palms = torch.stack([filled_keypoints(hand)[:, PALM] for hand in hands])
    steps = (palms[:, 1:] - palms[:, :-1]).norm(dim=-1).mean(-1).sum(0)
    crossed = (palms[:, 1:] - palms.flip(0)[:, :-1]).norm(dim=-1).mean(-1).sum(0)
    found = cheapest(curl, steps / JITTER, crossed / JITTER + CHANGE)
    if bool(found.all()):
        return torch.zeros_like(found)  # then the sides are wrong, which another check reports
    for run in runs(found.cpu().numpy()):
        found[run] = bool(curl[run].mean() < 0)
    return found


def cheapest(
    curl: Float[Tensor, " T"], kept: Float[Tensor, " S"], changed: Float[Tensor, " S"]
) -> Bool[Tensor, " T"]:
    """The swapped frames of least total cost, by dynamic programming.

    `curl` is the forward curl of the fingers of both hands, palm lengths. `kept` is the cost of
    each step to the next frame with the same labels, `changed` with swapped labels.
    """
    each = torch.stack([(-curl - FLAT).clamp(min=0), (curl + FLAT).clamp(min=0)]).T.tolist()
    costs, before = each[0], []
    for own, stay, change in zip(each[1:], kept.tolist(), changed.tolist(), strict=True):
        leaves = [costs[1 - state] + change < costs[state] + stay for state in (0, 1)]
        before.append(leaves)
        costs = [
            own[state] + (costs[1 - state] + change if leaves[state] else costs[state] + stay)
            for state in (0, 1)
        ]
    state = int(costs[1] < costs[0])
    found = [state]
    for leaves in reversed(before):
        state = 1 - state if leaves[state] else state
        found.append(state)
    return torch.tensor(found[::-1], device=curl.device) == 1


def _fields_of(hand: HandTrack) -> list[bool]:
    """For each per-frame field, whether a track lacks it."""
    of_points = (hand.joints, hand.confidence, hand.joint_spread)
    return [value is None for value in (*of_points, hand.pose, hand.wrist, hand.camera_ray)]


def with_frames_of(hand: HandTrack, other: HandTrack, frames: Bool[Tensor, " T"]) -> HandTrack:
    """A track with some frames taken from another; both have the same per-frame fields."""
    both = concatenated([hand, replace(other, betas=hand.betas)])
    return both[torch.arange(hand.frames, device=frames.device) + hand.frames * frames]
