"""Estimate the low-pass filter by which the tracks of an object and its moving hand differ.

Many pipelines smooth only the object's poses, by a Kalman or a low-pass filter, or only the hand.
The filtered track is too smooth, or late, and a hand that holds the object seems to move over it.

A low-pass filter whose kernel has the mean delay m and the variance v turns a motion x into f = x -
m x' + (m² + v) / 2 x'' - ..., so that x is f + m f' + (m² - v) / 2 f'' - ... Both m and v follow by
least squares from the palm's displacement relative to a rigid grip of the object.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64
from scipy.ndimage import binary_erosion, gaussian_filter1d
from torch import Tensor

from geneoh.objects.palms import RigidMotion
from geneoh.objects.smoothing import interpolated
from geneoh.sequence.sequence import ObjectTrack

PALM_LEVER = 0.05
"""Distance from the centre of the palm to the points that represent its rotation, metres."""
PALM_REACH = 0.12
"""Largest distance of the palm's centre from the bounding box of a held part, metres."""
SLOW_SECONDS, JITTER_SECONDS = 0.4, 1 / 30
"""Standard deviations of the Gaussians of a band-pass filter, seconds: the first removes slow
motion, which does not depend on the filter, and the second white noise."""
GAP_SECONDS = 0.1
"""Seconds beside a gap of the hand that are not used, because interpolation is smooth."""
BLOCK_SECONDS, LEAST_BLOCKS, LEAST_USABLE = 0.5, 3, 0.5
"""Jackknife: length of the blocks that are left out in turn, seconds; least number of blocks; and
least share of usable frames in a block."""
LEAST_VARIANCE, LEAST_ERRORS, LEAST_EXPLAINED = 0.0044, 2.5, 0.05
"""Conditions for a filter: least variance in seconds², that of a Gaussian of two frames at 30 a
second; least number of standard errors from zero; and least share that it explains of the palm's
motion over the object."""
LEAST_BY_SPEEDS, MOST_BY_SPEEDS = 0.5, 4.0
"""Least and largest variance by speeds, in units of that by places, for a filter of a part. True
filters have 0.6 or more in 49 of 50 clips, and at most 2.4; hands that turn a lid, go back and grip
it again have 0.2 or less in 19 of 20, and at most 0.6; a hand that drifts by centimetres along the
ray of its camera had 6."""
LARGEST_ADVANCE = 0.3
"""Largest apparent advance (negative delay) of a filter, in standard deviations of its kernel: real
filters have none."""
LEAST_LAG, LAG_CONDITIONS = 0.025, (4.0, 0.05)
"""Conditions for the delay of a causal filter on the hand: least delay, seconds; and least number
of standard errors with the least share that it explains."""
LEAST_DELAY, DELAY_CONDITIONS = 0.045, (5.0, 0.15)
"""The same conditions for a delay without a filter. With a shorter delay, the object is still of
more use for the hand than harm."""
REPORTED_DELAY = 0.02  # least delay of a filter that is reported, seconds
LEAST_BREADTH = 0.5
"""Least variance of a causal filter in units of its squared delay; the usual exponential smoothing
has more than one."""


@dataclass(frozen=True)
class LowPass:
    """A low-pass filter over time, by the first two moments of its kernel."""

    delay: float
    """Mean delay, seconds."""
    variance: float
    """Variance, seconds²."""

    def undone(self, values: Float[Tensor, "T ..."], fps: float) -> Float[Tensor, "T ..."]:
        """The motion before filtering, to second order."""
        array = values.double().cpu().numpy()
        first, second = self.delay * fps, (self.delay**2 - self.variance) * fps**2 / 2
        sharp = array + first * rate(array) + second * rate(rate(array))
        return torch.from_numpy(sharp).to(values)

    def __str__(self) -> str:
        late = f" and {1000 * self.delay:.0f} ms late" if self.delay > REPORTED_DELAY else ""
        return f"as by a filter with a deviation of {1000 * self.variance**0.5:.0f} ms{late}"

    def __add__(self, other: "LowPass") -> "LowPass":
        """The two filters in series."""
        return LowPass(self.delay + other.delay, self.variance + other.variance)


@dataclass(frozen=True)
class Found:
    """Estimate of the filter that was applied to one of two motions and not to the other."""

    filter: LowPass
    delay_error: float
    """Standard error of its delay, seconds."""
    variance_error: float
    """Standard error of its variance, seconds²."""
    explained: float
    """Share of the sum of squares of the palm's motion over the part that it explains."""
    by_speeds: float
    """The variance, seconds², that follows from the palm's speed over the part and not from its
    place there. A filter has the same by both."""

    @property
    def is_wide(self) -> bool:
        """Whether the kernel's variance is significant."""
        least = max(LEAST_VARIANCE, LEAST_ERRORS * self.variance_error)
        wide = self.filter.variance > least and self.explained > LEAST_EXPLAINED
        return wide and self.filter.delay > -LARGEST_ADVANCE * math.sqrt(self.filter.variance)

    @property
    def is_by_speeds(self) -> bool:
        """Whether the palm's speed over the part shows the same variance of the kernel, roughly.

        That of a hand which turns a lid, goes back while that rests and grips it again does not.
        Its place over the lid follows from all of the lid's motion before, as if that were
        filtered; but while the lid moves, it rests on it."""
        least, most = (n * self.filter.variance for n in (LEAST_BY_SPEEDS, MOST_BY_SPEEDS))
        return least < self.by_speeds < most

    def is_late(self, least: float, errors: float, explained: float) -> bool:
        """Whether the delay, late or early, is at least `least` seconds and `errors` standard
        errors, and explains at least the share `explained` of the palm's motion over the part."""
        late = abs(self.filter.delay) > max(least, errors * self.delay_error)
        return late and self.explained > explained

    @property
    def breadth(self) -> float:
        """Variance in units of the squared delay."""
        return self.filter.variance / max(self.filter.delay**2, 1e-12)


@dataclass(frozen=True)
class Comparison:
    """Comparison of the motions of an object part and of a palm near it."""

    of_part: Found
    """Filter of the part relative to the palm, by regression on the part's derivatives."""
    of_palm: Found
    """Filter of the palm relative to the part, by regression on the palm's derivatives."""

    @property
    def filter_of_part(self) -> LowPass | None:
        """The filter that was applied to the part; None if not significant."""
        one, other = self.of_part, self.of_palm
        late = one.filter.delay > 0 > other.filter.delay
        late = late and one.is_late(LEAST_LAG, *DELAY_CONDITIONS)
        lags = late and one.breadth > LEAST_BREADTH and other.breadth < -LEAST_BREADTH
        return one.filter if (one.is_wide and one.is_by_speeds) or lags else None

    @property
    def filter_of_palm(self) -> LowPass | None:
        """The filter that was applied to the hand; None if not significant.

        A hand that also moves over the part hides its filter in the regression on its own
        derivatives. Then the estimate from the part's derivatives is used, which is too small.
        """
        one, other = self.of_palm, self.of_part
        late = one.filter.delay > 0 > other.filter.delay
        lags = other.is_late(LEAST_LAG, *LAG_CONDITIONS)
        if one.breadth > LEAST_BREADTH:
            lags = lags or one.is_late(LEAST_LAG, *DELAY_CONDITIONS)
        if not one.is_wide and not (late and lags and other.breadth < -LEAST_BREADTH):
            return None
        if one.is_wide or one.breadth > LEAST_BREADTH:
            return one.filter
        return LowPass(-other.filter.delay, -other.filter.variance)

    @property
    def delay(self) -> LowPass | None:
        """A pure delay of the part relative to the palm, negative if the part is early; either of
        the tracks may be wrong. None if not significant."""
        filtered = self.filter_of_part is not None or self.filter_of_palm is not None
        late = self.of_part.is_late(LEAST_DELAY, *DELAY_CONDITIONS)
        late = late and abs(self.of_part.breadth) < LEAST_BREADTH
        return self.of_part.filter if late and not filtered else None


def compared(motion: ObjectTrack, part: int, palm: RigidMotion, fps: float) -> Comparison | None:
    """Compare a part with a palm; None if there is too little motion of either."""
    if len(motion.rotation) < LEAST_BLOCKS * max(1, round(BLOCK_SECONDS * fps)):
        return None
    both = products(motion, part, palm, fps)
    of_part = solved(both[..., :3, :3], fps)
    # exchange the roles of palm and part: the displacement changes sign, the palm's rates are used
    other_way, by_palm = np.diag([-1.0, 1.0, 1.0]), [0, 3, 4]
    of_palm = solved(other_way @ both[..., by_palm, :][..., by_palm] @ other_way, fps)
    return None if of_part is None or of_palm is None else Comparison(of_part, of_palm)


def products(
    motion: ObjectTrack, part: int, palm: RigidMotion, fps: float
) -> Float64[np.ndarray, "2 B 5 5"]:
    """Gram matrices of five variables over each block of frames, and of their rates: the palm's
    displacement relative to a rigid grip, the first two time derivatives of the part's motion
    there, and the first two of the palm's motion."""
    turns = motion.rotation[:, part].double().cpu().numpy()
    places = motion.translation[:, part].double().cpu().numpy()[:, None]
    tips = PALM_LEVER * np.eye(4)[:, 1:]  # the centre, and a point on each axis of the palm
    tips = np.concatenate([tips, -tips])  # on both sides of it, so that mirrored hands are equal
    points = np.einsum("tij,pj->tpi", palm.turns.as_matrix(), tips) + palm.places[:, None]
    seen = (points - places) @ turns  # from the part
    verts = motion.meshes[part].verts.cpu().numpy()
    inside = seen[:, 0].clip(verts.min(0), verts.max(0))
    near = np.linalg.norm(seen[:, 0] - inside, axis=1) < PALM_REACH
    near &= binary_erosion(palm.seen, iterations=max(1, round(GAP_SECONDS * fps)), border_value=1)
    if not near.any():
        return np.zeros((2, 0, 5, 5))
    if not palm.seen.all():  # on a line in the world, a lost palm would leave the part
        path = interpolated(seen.reshape(len(seen), -1), palm.seen)
        seen = path.reshape(seen.shape)
        points = seen @ turns.swapaxes(1, 2) + places
    carried = seen[near].mean(0) @ turns.swapaxes(1, 2) + places
    rates = [r @ turns for moved in (carried, points) for r in (rate(moved), rate(rate(moved)))]
    smooth, slow = JITTER_SECONDS * fps, SLOW_SECONDS * fps
    lively = [gaussian_filter1d(e, smooth, axis=0, mode="nearest") for e in (seen, *rates)]
    lively = [e - gaussian_filter1d(e, slow, axis=0, mode="nearest") for e in lively]
    values = np.stack(lively, axis=-1)
    rows = np.stack([values, rate(values)]) * near[:, None, None, None]
    length = max(2, round(BLOCK_SECONDS * fps))
    blocks = [slice(start, start + length) for start in range(0, len(near), length)]
    used = [
        rows[:, block].reshape(2, -1, 5) for block in blocks if near[block].mean() >= LEAST_USABLE
    ]
    found = np.array([block.swapaxes(1, 2) @ block for block in used]).reshape(-1, 2, 5, 5)
    return found.swapaxes(0, 1)


def solved(both: Float64[np.ndarray, "2 B 3 3"], fps: float) -> Found | None:
    """The filter by least squares over all blocks with motion, with standard errors by the
    jackknife; None for too few blocks. `both` are matrices of places, and of speeds."""
    blocks, speeds = both[:, np.trace(both[0, :, 1:, 1:], axis1=1, axis2=2) > 0]
    if len(blocks) < LEAST_BLOCKS:
        return None
    total = blocks.sum(0)
    found, explained = solution(total, fps)
    others = [solution(total - block, fps)[0] for block in blocks]
    late, wide = (
        math.sqrt((len(blocks) - 1) * float(np.var(values)))
        for values in ([o.delay for o in others], [o.variance for o in others])
    )
    by_speeds, _ = solution(speeds.sum(0), fps)
    return Found(found, late, wide, explained, by_speeds.variance)


def solution(total: Float64[np.ndarray, "3 3"], fps: float) -> tuple[LowPass, float]:
    """The filter by least squares, and the share of the sum of squares that it explains."""
    first, second = np.linalg.lstsq(total[1:, 1:], total[1:, 0], rcond=1e-9)[0]
    explained = (first * total[1, 0] + second * total[2, 0]) / max(total[0, 0], 1e-12)
    found = LowPass(float(first) / fps, float(first**2 - 2 * second) / fps**2)
    return found, float(explained)


def rate(values: Float64[np.ndarray, "T ..."]) -> Float64[np.ndarray, "T ..."]:
    """Time derivative, per frame."""
    return np.gradient(values, axis=0)
