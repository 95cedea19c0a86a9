"""Does the hand come later than its object, as where two sensors share no clock?

A hand that holds an object stands still in the object's frame. One that comes late wanders there,
whenever the object changes its speed, by that change times the delay: of all delays the true one
makes it wander least. The moments of `geneoh.objects.relative_filter` do not serve in place of this
search, as they are those of an expansion, which takes six frames of delay for a filter, nor does
this search in place of them, as it knows whole frames alone and no filters.
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

LONGEST, MOST_DELAYS = 0.3, 15
"""Seconds of the longest delay that is looked at, and how many are, each way. The longest tells
nothing: a hand that leaves a still object with noisy poses wanders least there."""
SMOOTHING, SPEED_SMOOTHING = 0.05, 0.07
"""Deviations of the Gaussians that take out white noise of places and of speeds, seconds."""
MOVING_SPEED = 0.09
"""Metres a second of the object at the palm from which on it moves."""
BLOCK, BLOCK_FRAMES = 1 / 3, 10
"""Seconds and frames, the longer of them, over which it is asked how far the hand wanders: in these
a hand that slides in its grip slides little."""
BESIDE_GAPS = 2
"""Frames before and after a gap of the hand that tell nothing, as what fills the gap does not."""
LEAST, LEAST_FRAMES = 2 / 3, 20
"""Seconds and frames of motion, the longer of them, that are needed."""
SHARE, OTHERS_SHARE = 0.3, 0.6
"""Share of the squares, as read, that a delay leaves at most; and that it leaves without the block
in which it gains most. Measured: docs/reliability.md."""


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
    delays = delays_at(fps)
    palm = keypoints_of(fill_gaps(hand))[:, PALM].double().cpu().numpy()
    seen = binary_erosion(hand.valid.cpu().numpy(), iterations=BESIDE_GAPS, border_value=1)
    ways = [
        wandering(palm, seen, delays, motion.rotation[:, part], motion.translation[:, part], fps)
        for part in motion.seen_parts
    ]
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


def delays_at(fps: float) -> Array:
    """(K,) the delays that are looked for, in frames; 0 is one of them."""
    most = max(1, round(LONGEST * fps))
    count = min(most, MOST_DELAYS)
    return np.round(np.linspace(-most, most, 2 * count + 1)).astype(int)


def wandering(
    palm: Array, seen: Array, delays: Array, turn: Tensor, shift: Tensor, fps: float
) -> Array:
    """(B, K) squared metres that the palm wanders about a part, by block of motion and by delay."""
    rotation, place = turn.double().cpu().numpy(), shift.double().cpu().numpy()[:, None]
    margin = int(delays.max())
    usable = moves(palm, rotation, place, fps) & seen
    usable[:margin], usable[len(usable) - margin :] = False, False
    blocks = _blocks_of(usable, max(BLOCK_FRAMES, round(BLOCK * fps)))
    if sum(map(len, blocks)) < max(LEAST_FRAMES, LEAST * fps):
        return np.zeros((0, len(delays)))
    found = []
    for delay in delays:
        then = (np.arange(len(palm)) + delay).clip(0, len(palm) - 1)
        local = gaussian_filter1d((palm[then] - place) @ rotation, SMOOTHING * fps, axis=0)
        found.append([local[f].var(0).sum(-1) for f in blocks])
    return np.median(found, axis=-1).T * np.array(list(map(len, blocks)))[:, None]


def moves(palm: Array, turn: Array, shift: Array, fps: float) -> Array:
    """(T,) whether the part moves where the palm is."""
    local = (palm - shift) @ turn
    steps = local[:-1] @ (turn[1:] - turn[:-1]).swapaxes(1, 2) + shift[1:] - shift[:-1]
    speed = fps * np.linalg.norm(steps, axis=-1).mean(1)
    return np.append(gaussian_filter1d(speed, SPEED_SMOOTHING * fps) > MOVING_SPEED, False)


def _blocks_of(usable: Array, length: int) -> list[Array]:
    """The usable frames of each stretch of a length in which at least half of them are usable."""
    starts = range(0, len(usable), length)
    every = [start + np.flatnonzero(usable[start : start + length]) for start in starts]
    return [frames for frames in every if 2 * len(frames) >= length]
