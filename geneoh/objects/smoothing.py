"""Robust smoothing of the pose track of one rigid part.

The smooth track minimises the squared residuals, in units of the noise, plus the squared second
differences, in units of the part's local acceleration. Residuals follow Student's t, by iteratively
reweighted least squares. The local accelerations are estimated again after each solve, so that a
resting part becomes still and a swung part keeps its motion.
"""

from collections.abc import Callable
from math import comb
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import solveh_banded
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.spatial.transform import Rotation, Slerp

from geneoh.sequence.windows import in_long_runs

CHI3_MEDIAN = 1.538  # median length of a vector of three standard normal variables
FREEDOM = 4.0  # degrees of freedom of Student's t: outliers of 5 standard deviations weigh 0.1
ITERATIONS = 6
ROTATION_ROUNDS = 6
WINDOW = 9  # frames over which accelerations are averaged
LEAST_ACCELERATION = 0.05  # floor of the acceleration in units of the noise, for conditioning
FIRST_WINDOW, FIRST_ACCELERATION = 15, 0.3  # window and floor for the initial, noisy track
MEDIAN_FRAMES = 5  # window of the median filter for the initial weights, frames
LONGEST_BRIDGE = 12.0
"""Frames of a gap up to which motion is taken to go on evenly through it."""
FREE_RATIO = 1e4
"""Variance of accelerations in longer gaps, in units of the largest one elsewhere."""
MOTION = 0.7  # use eighth differences if they show less than this share of the fourth ones' noise
DAMPING = 0.8
"""Share of the velocity left after each frame before the first and after the last known pose: where
it is not known, motion neither goes on evenly nor stops at once."""
LEAST_FRAMES = 16  # frames below which eighth differences are too few
Summary = Callable[[Float64[np.ndarray, "N ..."]], Any]  # reduces many lengths to one


def noise_level(
    track: Float64[np.ndarray, "T *B 3"],
    seen: Bool[np.ndarray, " T"] | None = None,
    summary: Summary = np.median,
) -> float:
    """Standard deviation of white noise per coordinate of a track, from temporal differences.

    Differences of order k have C(2k, k) times the variance of the noise and little smooth motion.
    Fourth differences are used, unless eighth ones, which contain less fast motion, show clearly
    less noise. `summary` reduces the lengths of the differences; the median ignores jumps.
    Differences over frames that are not `seen` are used only if there are no others.
    """
    seen = np.ones(len(track), dtype=bool) if seen is None else seen

    def level(order: int) -> float:
        lengths = np.linalg.norm(np.diff(track, n=order, axis=0), axis=-1)
        return float(summary(lengths[in_a_row(seen, order + 1)])) / comb(2 * order, order) ** 0.5

    found = level(4)
    if len(track) >= LEAST_FRAMES:
        eighth = level(8)
        found = eighth if eighth < MOTION * found else found
    return found / CHI3_MEDIAN


def in_a_row(kept: Bool[np.ndarray, " T"], count: int) -> Bool[np.ndarray, " N"]:
    """Whether `count` frames from each frame on are all kept; all true if that never happens."""
    whole = np.asarray(sliding_window_view(kept, count).all(1))
    return whole if whole.any() else ~whole


def increments(rotations: Rotation) -> Float64[np.ndarray, "N 3"]:
    """Rotation from each frame to the next in the part's own frame, axis-angle in radians."""
    return (rotations[:-1].inv() * rotations[1:]).as_rotvec()


def path_of(rotations: Rotation) -> Float64[np.ndarray, "T 3"]:
    """Cumulative sum of the `increments`, radians: a vector path that can be smoothed."""
    return np.concatenate([np.zeros((1, 3)), np.cumsum(increments(rotations), axis=0)])


def interpolated(
    track: Float64[np.ndarray, "T D"], known: Bool[np.ndarray, " T"]
) -> Float64[np.ndarray, "T D"]:
    """A track with frames that are not `known` replaced by linear interpolation."""
    frames, index = np.arange(len(track)), np.flatnonzero(known)
    return np.stack([np.interp(frames, index, x[index]) for x in track.T], axis=1)


def smooth_points(
    observed: Float64[np.ndarray, "T 3"],
    trusted: Bool[np.ndarray, " T"],
    noise: float | Float64[np.ndarray, " T"],
) -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, " T"]]:
    """The smooth track of a point, and the weight of each frame in it, 0 to 1.

    At least two frames must be `trusted`; `noise` is the standard deviation per coordinate, in the
    unit of `observed`, of all frames or of each. What is before a long gap does not change what is
    after it: motion may have become any other there.
    """
    noise = np.broadcast_to(noise, len(trusted)).astype(float)
    track, weight = _smoothed(observed, trusted, noise)
    unknown = in_long_runs(~trusted, LONGEST_BRIDGE)
    if unknown.any():
        free = np.asarray(sliding_window_view(unknown, 3).any(1))
        stretches, weight = _smoothed(observed, trusted, noise, free)
        bridge = track + interpolated(stretches - track, ~unknown)
        track = np.where(unknown[:, None], bridge, stretches)
    return damped_ends(track, trusted), weight.clip(0, 1)


def damped_ends(
    track: Float64[np.ndarray, "T 3"], trusted: Bool[np.ndarray, " T"]
) -> Float64[np.ndarray, "T 3"]:
    """The track with a velocity that fades before the first and after the last trusted frame."""
    first, last = np.flatnonzero(trusted)[[0, -1]]
    track = track.copy()
    for ahead in (track[last - 1 :], track[: first + 2][::-1]):
        left = np.cumsum(DAMPING ** np.arange(1, len(ahead) - 1))
        ahead[2:] = ahead[1] + left[:, None] * (ahead[1] - ahead[0])
    return track


def _smoothed(
    observed: Float64[np.ndarray, "T 3"],
    trusted: Bool[np.ndarray, " T"],
    noise: Float64[np.ndarray, " T"],
    free: Bool[np.ndarray, " N"] | None = None,
) -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, " T"]]:
    """As `smooth_points`, with any acceleration at the second differences that are `free`."""
    track = interpolated(observed, trusted)
    filled = np.where(trusted[:, None], observed, track)
    # medians ignore outliers, which would be taken for acceleration
    raw = median_filter(np.square(np.diff(track, n=2, axis=0)).sum(1), FIRST_WINDOW)
    inner = noise[1:-1]
    excess = raw / CHI3_MEDIAN**2 - comb(4, 2) * inner**2
    variance = excess.clip(0) + (FIRST_ACCELERATION * inner) ** 2
    weight = _weights(median_filter(track, (MEDIAN_FRAMES, 1)) - filled, trusted, noise)
    for _ in range(ITERATIONS):
        if free is not None:
            variance[free] = FREE_RATIO * variance.max()
        track = _solve(filled, weight / noise**2, 1 / variance)
        weight = _weights(track - filled, trusted, noise)
        bends = np.square(np.diff(track, n=2, axis=0)).mean(1)
        variance = uniform_filter1d(bends, WINDOW) + (LEAST_ACCELERATION * inner) ** 2
    return track, weight


def _weights(
    residuals: Float64[np.ndarray, "T 3"],
    trusted: Bool[np.ndarray, " T"],
    noise: Float64[np.ndarray, " T"],
) -> Float64[np.ndarray, " T"]:
    """Weights of frames by Student's t."""
    return trusted * (FREEDOM + 3) / (FREEDOM + np.square(residuals).sum(1) / noise**2)


def _solve(
    observed: Float64[np.ndarray, "T 3"],
    weight: Float64[np.ndarray, " T"],
    stiffness: Float64[np.ndarray, " N"],
) -> Float64[np.ndarray, "T 3"]:
    """Least squares with observations of given `weight` and second differences of `stiffness`."""
    upper = np.zeros((3, len(observed)))
    upper[2] = weight
    for shift, share in ((0, 1.0), (1, 4.0), (2, 1.0)):
        upper[2, shift : shift + len(stiffness)] += share * stiffness
    upper[1, 1:-1] -= 2 * stiffness
    upper[1, 2:] -= 2 * stiffness
    upper[0, 2:] += stiffness
    return solveh_banded(upper, weight[:, None] * observed)


def smooth_rotations(
    observed: Rotation,
    trusted: Bool[np.ndarray, " T"],
    noise: float | Float64[np.ndarray, " T"],
) -> tuple[Rotation, Float64[np.ndarray, " T"]]:
    """The smooth track of a rotation, and the weight of each frame in it, 0 to 1.

    The residuals of the current estimate (axis-angle) are added to its `path_of`, a vector path,
    which is smoothed as points are; the estimate is updated by the difference, iteratively.
    """
    index = np.flatnonzero(trusted)
    times = np.arange(len(trusted)).clip(index[0], index[-1])
    seen = observed[index]  # pyright: ignore[reportArgumentType]  # arrays lack in scipy's stubs
    track = Slerp(index, seen)(times)
    weight = trusted.astype(float)
    for _ in range(ROTATION_ROUNDS):
        path = path_of(track)
        residuals = (track.inv() * observed).as_rotvec()
        smooth, weight = smooth_points(path + residuals, trusted, noise)
        step = smooth - path
        track = track * Rotation.from_rotvec(step)
        if np.abs(step).max() < 1e-4:
            break
    return track, weight
