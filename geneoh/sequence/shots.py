"""Shots of a video that was cut: at a cut the hand leaps elsewhere, and stays there."""

import math
from collections.abc import Iterable
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float

from geneoh.sequence.keypoints import PALM, keypoints_of
from geneoh.sequence.repeats import METRES_PER_ROTATION
from geneoh.sequence.sequence import HandTrack, ObjectTrack

CUT_LEAP, CUT_RATIO = 0.15, 3.0
"""Least leap of a hand at a cut, metres (larger below 30 frames a second), and its least ratio to
every step around it."""
SHOT_SECONDS, COMPARED_STEPS = 2 / 3, 5
"""Seconds for which the hand stays on either side of a cut, and steps compared on either side."""
EVEN_SECONDS, FEWEST_EVEN, LEAST_TRAVEL = 0.25, 3, 0.02
"""Seconds on either side of a cut for which another hand or an object must move evenly, the fewest
frames of them, and the distance in metres that it travels at least: what rests goes on after a cut
too, and its jitter is no motion."""


def paths_of(hands: Iterable[HandTrack], motion: ObjectTrack) -> list[Float[np.ndarray, "T D"]]:
    """The paths of palms and of object parts, metres; NaN where they are not observed.

    The rotation of a part counts by `METRES_PER_ROTATION`.
    """
    turned = METRES_PER_ROTATION * motion.rotation.flatten(2)
    parts = torch.cat([motion.translation, turned], -1)
    tracks = [(parts[:, part], motion.observed[:, part]) for part in range(parts.shape[1])]
    for hand in hands:
        palm = keypoints_of(hand)[:, PALM]
        tracks.append((palm.flatten(1) / math.sqrt(len(PALM)), hand.observed))
    return [
        path.masked_fill(~seen[:, None], torch.nan).double().cpu().numpy() for path, seen in tracks
    ]


def shots_of(
    hand: HandTrack, fps: float, beside: Iterable[Float[np.ndarray, "T D"]] = ()
) -> list[slice]:
    """The shots of a track as slices; one slice where no cut is found.

    A leap of the hand is no cut where one of the paths `beside` it goes on evenly, nor where it
    stays for less than `SHOT_SECONDS` on either side, unless one of them leaps, too. Where the hand
    is lost at a cut, the cut is where one of these paths leaps, else where the hand is found again.
    """
    seen = np.flatnonzero(hand.observed.cpu().numpy())
    place = keypoints_of(hand)[:, PALM].mean(1).double().cpu().numpy()[seen]
    leaps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    steps = leaps / np.diff(seen)
    least = CUT_LEAP * max(1.0, 30 / fps)
    likely = np.flatnonzero(steps > least).tolist()
    lasting, even = math.ceil(SHOT_SECONDS * fps), max(FEWEST_EVEN, round(EVEN_SECONDS * fps))
    paths, cuts = list(beside), []
    for last in likely:
        old, new = int(seen[last]), int(seen[last + 1])
        together = any(leaps_between(path, old, new, least) for path in paths)
        if is_cut(place, steps, last, 1 if together else lasting) and not any(
            is_even(path, old, new, even) for path in paths
        ):
            cuts.append(first_after(old, new, paths, least))
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


def leaps_between(path: Float[np.ndarray, "T D"], old: int, new: int, least: float) -> bool:
    """Whether a path leaps by more than `least`, metres, between two frames, as at a cut."""
    start = max(old - COMPARED_STEPS, 0)
    steps = step_lengths(path[start : new + 1 + COMPARED_STEPS])
    between = slice(old - start, new - start)
    leap, around = steps[between].max(), np.delete(steps, between)
    return bool(leap > least and leap >= CUT_RATIO * around.max(initial=0.0))


def step_lengths(path: Float[np.ndarray, "T D"]) -> Float[np.ndarray, " T-1"]:
    """Length of each of the T - 1 steps of a path, metres; 0 beside frames without it."""
    return np.nan_to_num(np.linalg.norm(np.diff(path, axis=0), axis=1))


def first_after(old: int, new: int, paths: Iterable[Float[np.ndarray, "T D"]], least: float) -> int:
    """The first frame after a cut between the frames `old` and `new`: that after the longest step
    of a path, if it is longer than `least`, metres, else `new`."""
    for path in paths:
        steps = step_lengths(path[old : new + 1])
        longest = int(steps.argmax())
        if steps[longest] > least:
            return old + 1 + longest
    return new


def is_even(path: Float[np.ndarray, "T D"], last: int, first: int, frames: int) -> bool:
    """Whether a path moves on evenly from frame `last` to frame `first`.

    The displacement between the means of `frames` frames on either side then is that of the mean
    velocity on both sides, to half of it. False where the path rests or has gaps there.
    """
    before, after = path[max(last + 1 - frames, 0) : last + 1], path[first : first + frames]
    if min(len(before), len(after)) < frames or not np.isfinite([before, after]).all():
        return False
    times = np.arange(frames) - (frames - 1) / 2
    velocity = times @ (before + after) / (2 * times @ times)
    travelled = velocity * (frames + first - last - 1)
    distance = np.linalg.norm(travelled)
    off = np.linalg.norm(after.mean(0) - before.mean(0) - travelled)
    return bool(distance > LEAST_TRAVEL and off < distance / 2)
