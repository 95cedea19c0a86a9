"""Shots of a video that was cut: at a cut the hand leaps elsewhere, and stays there."""

import math
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from geneoh.sequence.keypoints import PALM, keypoints_of
from geneoh.sequence.sequence import HandTrack

CUT_LEAP, CUT_RATIO = 0.15, 3.0
"""Least leap of a hand at a cut, metres (larger below 30 frames a second), and its least ratio to
every step around it."""
SHOT_SECONDS, COMPARED_STEPS = 2 / 3, 5
"""Seconds for which the hand stays on either side of a cut, and steps compared on either side."""


def shots_of(hand: HandTrack, fps: float) -> list[slice]:
    """The shots of a track as slices; one slice where no cut is found.

    Frames without the hand beside a cut belong to the shot before it.
    """
    seen = np.flatnonzero(hand.observed.cpu().numpy())
    place = keypoints_of(hand)[:, PALM].mean(1).double().cpu().numpy()[seen]
    leaps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    steps = leaps / np.diff(seen)
    likely = np.flatnonzero(steps > CUT_LEAP * max(1.0, 30 / fps)).tolist()
    lasting = math.ceil(SHOT_SECONDS * fps)
    cuts = [int(seen[last + 1]) for last in likely if is_cut(place, steps, last, lasting)]
    return [slice(start, stop) for start, stop in pairwise([0, *cuts, hand.frames])]


def is_cut(
    place: Float[np.ndarray, "N 3"], steps: Float[np.ndarray, " M"], last: int, lasting: int
) -> bool:
    """Whether the video was cut after frame `last` of the N frames with the hand.

    At a cut the step is larger than those around it, and the hand does not come back: for
    `lasting` frames it stays more than half of the leap away from the other side.
    """
    before, after = place[: last + 1][-lasting:], place[last + 1 :][:lasting]
    around = [0.0, *steps[:last][-COMPARED_STEPS:], *steps[last + 1 :][:COMPARED_STEPS]]
    if min(len(before), len(after)) < lasting or steps[last] < CUT_RATIO * max(around):
        return False
    leap = np.linalg.norm(after[0] - before[-1])
    back = [before - after[0], after - before[-1]]
    return bool(np.linalg.norm(back, axis=-1).min() > leap / 2)
