"""Shots of a video that was cut: at a cut the hand leaps elsewhere, and stays there."""

import math
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from geneoh.sequence.keypoints import PALM, keypoints
from geneoh.sequence.sequence import HandTrack

LEAP, LARGER = 0.15, 3.0
"""Metres that a hand leaps at a cut, more below 30 frames a second, and how many times as far as in
any step of the frames around."""
LASTING, AROUND = 2 / 3, 5
"""Seconds for which it stays, on either side, and steps around it that tell how it moves."""


def shots_of(hand: HandTrack, fps: float) -> list[slice]:
    """The shots of a track: all of it where nothing shows a cut."""
    place = keypoints(hand)[:, PALM].mean(1).double().cpu().numpy()
    place[~hand.observed.cpu().numpy()] = np.nan
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    leaps = np.flatnonzero(steps > LEAP * max(1.0, 30 / fps)).tolist()
    lasting = math.ceil(LASTING * fps)
    cuts = [leap + 1 for leap in leaps if is_cut(place, steps, leap, lasting)]
    return [slice(start, stop) for start, stop in pairwise([0, *cuts, hand.frames])]


def is_cut(
    place: Float[np.ndarray, "T 3"], steps: Float[np.ndarray, " N"], leap: int, lasting: int
) -> bool:
    """Whether a step is larger than those around, and for `lasting` frames no way back is taken."""
    before, after = place[: leap + 1][-lasting:], place[leap + 1 :][:lasting]
    around = [*steps[:leap][-AROUND:], *steps[leap + 1 :][:AROUND]]
    if min(len(before), len(after)) < lasting or steps[leap] < LARGER * np.nanmax([0, *around]):
        return False
    back = [before - after[0], after - before[-1]]
    return bool(np.nanmin(np.linalg.norm(back, axis=-1)) > steps[leap] / 2)
