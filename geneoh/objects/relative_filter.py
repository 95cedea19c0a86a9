"""The low-pass filter by which an object and the hand that moves it differ, measured.

Many pipelines smooth the poses of an object, by a Kalman or a low-pass filter, and leave the hand
as it is, or the other way round. What was filtered cuts every change of speed short, or comes late,
and a hand that holds the object seems to move over it.

A low-pass filter whose kernel has the mean delay m and the variance v turns a motion x into f = x -
m x' + (m² + v) / 2 x'' - ..., so that x is f + m f' + (m² - v) / 2 f'' - ... Both numbers follow by
least squares from how far the palm is beside where the object would carry it.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64
from scipy.ndimage import binary_erosion, gaussian_filter1d
from torch import Tensor

from geneoh.objects.palms import RigidMotion
from geneoh.sequence.sequence import ObjectTrack

LEVER = 0.05
"""Metres from the middle of the palm to the points that tell how it turns."""
REACH = 0.12
"""Metres from the box around a part to the middle of the palm up to which the hand may hold it."""
LASTING, JITTER = 0.4, 1 / 30
"""Seconds, deviations of the Gaussians: what lasts longer than the first tells of no filter, and
the second takes out white noise."""
BESIDE_GAPS = 0.1
"""Seconds beside a gap of the hand that tell nothing, as the line that fills it is smooth."""
BLOCK, LEAST_BLOCKS, USED = 0.5, 3, 0.5
"""Seconds of the blocks of which each is left out in turn, to see how sure the filter is; the least
number of them; and the share of their frames that must tell something."""
LEAST_VARIANCE, SURE, EXPLAINED = 0.0044, 2.5, 0.05
"""Variance in seconds² from which on a filter counts, that of a Gaussian of two frames at 30 a
second; that many standard errors from zero; and the share of the palm's motion over the object that
it explains."""
EARLY = 0.3
"""Deviations of its kernel by which a filter may seem to come early: none does."""
LEAST_LAG, LAGS = 0.025, (4.0, 0.05)
"""The same of the delay of a filter that makes the hand late: least seconds, and least standard
errors with the least share."""
LEAST_DELAY, LATE = 0.045, (5.0, 0.15)
"""The same of a delay without a filter: of less, what the object tells of the hand is worth more
than what the delay takes of it."""
TOLD_DELAY = 0.02  # seconds of a filter's delay from which on it is told
LAG = 0.5
"""Variance of a filter that comes late, in squares of its delay; that of the usual one, in which
each frame counts by a constant share, is more than one."""


@dataclass(frozen=True)
class LowPass:
    """A low-pass filter over time, by the first two moments of its kernel."""

    delay: float
    """Mean delay, seconds."""
    variance: float
    """Variance, seconds²."""

    def undone(self, values: Float[Tensor, "T ..."], fps: float) -> Float[Tensor, "T ..."]:
        """The motion that was filtered, to second order."""
        array = values.double().cpu().numpy()
        first, second = self.delay * fps, (self.delay**2 - self.variance) * fps**2 / 2
        sharp = array + first * rate(array) + second * rate(rate(array))
        return torch.from_numpy(sharp).to(values)

    def __str__(self) -> str:
        late = f" and {1000 * self.delay:.0f} ms late" if self.delay > TOLD_DELAY else ""
        return f"as by a filter with a deviation of {1000 * self.variance**0.5:.0f} ms{late}"

    def __add__(self, other: "LowPass") -> "LowPass":
        """One after the other."""
        return LowPass(self.delay + other.delay, self.variance + other.variance)


@dataclass(frozen=True)
class Found:
    """The filter that one of two motions seems to have gone through and the other not."""

    filter: LowPass
    delay_error: float
    """Standard error of its delay, seconds."""
    variance_error: float
    """Standard error of its variance, seconds²."""
    explained: float
    """Share of the squares of the palm's motion over the part that it explains."""

    @property
    def is_wide(self) -> bool:
        """Whether its kernel is wide for sure."""
        least = max(LEAST_VARIANCE, SURE * self.variance_error)
        wide = self.filter.variance > least and self.explained > EXPLAINED
        return wide and self.filter.delay > -EARLY * math.sqrt(self.filter.variance)

    def is_late(self, least: float, errors: float, explained: float) -> bool:
        """Whether one motion comes that much later or earlier than the other, seconds, by so many
        standard errors, and that explains such a share of the palm's motion over the part."""
        late = abs(self.filter.delay) > max(least, errors * self.delay_error)
        return late and self.explained > explained

    @property
    def breadth(self) -> float:
        """Variance in squares of the delay."""
        return self.filter.variance / max(self.filter.delay**2, 1e-12)


@dataclass(frozen=True)
class Comparison:
    """How a part of an object moves beside a palm near to it."""

    of_part: Found
    """What the part went through and the palm did not, by the rates of the part."""
    of_palm: Found
    """What the palm went through and the part did not, by the rates of the palm."""

    @property
    def filter_of_part(self) -> LowPass | None:
        """The filter that the part went through; None for none."""
        one, other = self.of_part, self.of_palm
        late = one.is_late(LEAST_LAG, *LATE) and one.filter.delay > 0 > other.filter.delay
        lags = late and one.breadth > LAG and other.breadth < -LAG
        return one.filter if one.is_wide or lags else None

    @property
    def filter_of_palm(self) -> LowPass | None:
        """The filter that the hand went through; None for none.

        A hand that moves over the part by itself hides its own filter from its own rates. Then
        those of the part tell it, as less than it is.
        """
        one, other = self.of_palm, self.of_part
        late = other.is_late(LEAST_LAG, *LAGS) and one.filter.delay > 0 > other.filter.delay
        if not one.is_wide and not (late and other.breadth < -LAG):
            return None
        if one.is_wide or one.breadth > LAG:
            return one.filter
        return LowPass(-other.filter.delay, -other.filter.variance)

    @property
    def delay(self) -> LowPass | None:
        """The delay, negative where the part comes early, of which nothing tells whose it is; None
        for none."""
        filtered = self.filter_of_part is not None or self.filter_of_palm is not None
        late = self.of_part.is_late(LEAST_DELAY, *LATE) and abs(self.of_part.breadth) < LAG
        return self.of_part.filter if late and not filtered else None


def compared(motion: ObjectTrack, part: int, palm: RigidMotion, fps: float) -> Comparison | None:
    """How a part moves beside a palm; None where too little of either moves to tell."""
    if len(motion.rotation) < LEAST_BLOCKS * round(BLOCK * fps):
        return None
    blocks = products(motion, part, palm, fps)
    of_part = solved(blocks[:, :3, :3], fps)
    # beside the palm the part is the other way, and the palm's rates count
    other_way, by_palm = np.diag([-1.0, 1.0, 1.0]), [0, 3, 4]
    of_palm = solved(other_way @ blocks[:, by_palm][:, :, by_palm] @ other_way, fps)
    return None if of_part is None or of_palm is None else Comparison(of_part, of_palm)


def products(
    motion: ObjectTrack, part: int, palm: RigidMotion, fps: float
) -> Float64[np.ndarray, "B 5 5"]:
    """Sums of products, for each block of frames, of how far the palm is from where the part would
    carry it, of the first two rates of the part's motion there, and of those of the palm's."""
    turns = motion.rotation[:, part].double().cpu().numpy()
    places = motion.translation[:, part].double().cpu().numpy()[:, None]
    tips = np.concatenate([np.zeros((1, 3)), LEVER * np.eye(3)])
    points = np.einsum("tij,pj->tpi", palm.turns.as_matrix(), tips) + palm.places[:, None]
    seen = (points - places) @ turns  # from the part
    verts = motion.meshes[part].verts.cpu().numpy()
    inside = seen[:, 0].clip(verts.min(0), verts.max(0))
    near = np.linalg.norm(seen[:, 0] - inside, axis=1) < REACH
    near &= binary_erosion(palm.seen, iterations=max(1, round(BESIDE_GAPS * fps)), border_value=1)
    if not near.any():
        return np.zeros((0, 5, 5))
    carried = seen[near].mean(0) @ turns.swapaxes(1, 2) + places
    rates = [r @ turns for moved in (carried, points) for r in (rate(moved), rate(rate(moved)))]
    smooth, slow = JITTER * fps, LASTING * fps
    lively = [gaussian_filter1d(e, smooth, axis=0, mode="nearest") for e in (seen, *rates)]
    lively = [e - gaussian_filter1d(e, slow, axis=0, mode="nearest") for e in lively]
    rows = np.stack(lively, axis=-1) * near[:, None, None, None]
    length = max(2, round(BLOCK * fps))
    blocks = [slice(start, start + length) for start in range(0, len(rows), length)]
    used = [rows[block].reshape(-1, 5) for block in blocks if near[block].mean() >= USED]
    return np.array([block.T @ block for block in used]).reshape(-1, 5, 5)


def solved(blocks: Float64[np.ndarray, "B 3 3"], fps: float) -> Found | None:
    """The filter by all blocks in which something moves, and how sure it is by leaving out each in
    turn (the jackknife)."""
    blocks = blocks[np.trace(blocks[:, 1:, 1:], axis1=1, axis2=2) > 0]
    if len(blocks) < LEAST_BLOCKS:
        return None
    total = blocks.sum(0)
    found, explained = solution(total, fps)
    others = [solution(total - block, fps)[0] for block in blocks]
    late, wide = (
        math.sqrt((len(blocks) - 1) * float(np.var(values)))
        for values in ([o.delay for o in others], [o.variance for o in others])
    )
    return Found(found, late, wide, explained)


def solution(total: Float64[np.ndarray, "3 3"], fps: float) -> tuple[LowPass, float]:
    """The filter by least squares, and the share of the squares that it explains."""
    first, second = np.linalg.lstsq(total[1:, 1:], total[1:, 0], rcond=1e-9)[0]
    explained = (first * total[1, 0] + second * total[2, 0]) / max(total[0, 0], 1e-12)
    found = LowPass(float(first) / fps, float(first**2 - 2 * second) / fps**2)
    return found, float(explained)


def rate(values: Float64[np.ndarray, "T ..."]) -> Float64[np.ndarray, "T ..."]:
    """Change in a frame."""
    return np.gradient(values, axis=0)
