"""Find a delay between the hand and its object, as between two sensors without a common clock.

A hand that holds an object stands still in the object's frame. A delayed hand moves there whenever
the object changes its speed, by that change times the delay; the true delay minimises this motion.
The moments of `geneoh.objects.relative_filter` cannot replace this search: they come from a series
expansion, which takes a delay of six frames for a filter. Nor can this search replace them: it
finds delays of whole frames only, and no filters.
"""

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import binary_erosion, gaussian_filter1d
from torch import Tensor

from geneoh.errors import numbered
from geneoh.readers.records import Array
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.keypoints import PALM, keypoints_of
from geneoh.sequence.sequence import HandTrack, ObjectTrack

LONGEST_DELAY, MOST_DELAYS = 0.3, 15
"""Longest delay in seconds, and largest number of delays tried, in each direction. A minimum at the
longest one is ignored: a hand that leaves a still object with noisy poses moves least there."""
SMOOTHING, SPEED_SMOOTHING = 0.05, 0.07
"""Standard deviations in seconds of the Gaussian filters against white noise of positions and of
speeds."""
MOVING_SPEED = 0.09
"""Speed of the object at the palm, in metres a second, above which it counts as moving."""
BLOCK_SECONDS, BLOCK_FRAMES = 1 / 3, 10
"""Length of a block, in seconds and in frames, whichever is longer. The motion is measured within
blocks, in which a hand that slides in its grip slides little."""
GAP_FRAMES = 2
"""Frames before and after a gap of the hand that are left out, as the filled-in frames are."""
LEAST_SECONDS, LEAST_FRAMES = 2 / 3, 20
"""Motion that is needed, in seconds and in frames, whichever is longer."""
SHARE, OTHERS_SHARE = 0.3, 0.6
"""Largest ratio of the squared motion with a delay to that without: over all blocks, and without
the block that gains most. Measured: docs/reliability.md."""


def check_delay(hand: HandTrack, motion: ObjectTrack, fps: float) -> Iterator[str]:
    """Whether the hand moves at the same time as the object that it holds."""
    delay = hand_delay(hand, motion, fps)
    if delay:
        frames = numbered(abs(delay), "frame")
        order = "later" if delay > 0 else "earlier"
        yield (
            f"timing: it seems to move {frames} {order} than the object that it holds; give it "
            f"the object's poses of its own time (--hand-delay {delay}, unless a note tells of a "
            "filter that was undone)"
        )


def hand_delay(hand: HandTrack, motion: ObjectTrack, fps: float) -> int:
    """Frames by which the hand comes later than its object, negative where it comes earlier.

    0 also where the object moves too little, or the hand holds it too loosely, to tell.
    """
    if not motion.meshes or hand.frames < LEAST_FRAMES:
        return 0
    most = max(1, round(LONGEST_DELAY * fps))
    tried = 2 * min(most, MOST_DELAYS) + 1
    delays = np.round(np.linspace(-most, most, tried)).astype(int)  # 0 is one of them
    palm = keypoints_of(fill_gaps(hand))[:, PALM].double().cpu().numpy()
    seen = binary_erosion(hand.valid.cpu().numpy(), iterations=GAP_FRAMES, border_value=1)
    ways = []
    for part in motion.seen_parts:
        both = seen & motion.observed[:, part].cpu().numpy()
        turn, shift = motion.rotation[:, part], motion.translation[:, part]
        ways.append(wandering(palm, both, delays, turn, shift, fps))
    ways = [way for way in ways if len(way)]
    if not ways:
        return 0
    squares = min(ways, key=lambda way: way.sum(0).min())
    total, as_read = squares.sum(0), int(np.flatnonzero(delays == 0)[0])
    best = int(total.argmin())
    gains = squares[:, as_read] - squares[:, best]
    others = np.delete(squares, gains.argmax(), axis=0).sum(0)
    sure = total[best] < SHARE * total[as_read] and others[best] < OTHERS_SHARE * others[as_read]
    return int(delays[best]) if sure and 0 < best < len(delays) - 1 else 0


def wandering(
    palm: Array, seen: Array, delays: Array, turn: Tensor, shift: Tensor, fps: float
) -> Array:
    """(B, K) sum of squared deviations, m^2, of the palm in a part's frame, by block and delay."""
    rotation, place = turn.double().cpu().numpy(), shift.double().cpu().numpy()[:, None]
    margin = int(delays.max())
    usable = moves(palm, rotation, place, fps) & seen
    usable[:margin], usable[len(usable) - margin :] = False, False
    length = max(BLOCK_FRAMES, round(BLOCK_SECONDS * fps))
    starts = range(0, len(usable), length)
    every = [start + np.flatnonzero(usable[start : start + length]) for start in starts]
    # of each block the usable frames, where these are at least half of it
    blocks = [frames for frames in every if 2 * len(frames) >= length]
    if sum(map(len, blocks)) < max(LEAST_FRAMES, LEAST_SECONDS * fps):
        return np.zeros((0, len(delays)))
    found = []
    for delay in delays:
        then = (np.arange(len(palm)) + delay).clip(0, len(palm) - 1)
        local = gaussian_filter1d((palm[then] - place) @ rotation, SMOOTHING * fps, axis=0)
        found.append([local[f].var(0).sum(-1) for f in blocks])
    return np.median(found, axis=-1).T * np.array(list(map(len, blocks)))[:, None]


def moves(palm: Array, turn: Array, shift: Array, fps: float) -> Array:
    """(T,) mask of the frames in which the part moves at the position of the palm."""
    local = (palm - shift) @ turn
    steps = local[:-1] @ (turn[1:] - turn[:-1]).swapaxes(1, 2) + shift[1:] - shift[:-1]
    speed = fps * np.linalg.norm(steps, axis=-1).mean(1)
    return np.append(gaussian_filter1d(speed, SPEED_SMOOTHING * fps) > MOVING_SPEED, False)
