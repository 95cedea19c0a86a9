"""Robust smoothing of one rigid part's track: what is constant acceleration, up to noise, stays.

The smooth track minimises the squared distance to the observed one, in units of its noise, plus its
squared second differences, in units of how much the part accelerates around each frame. Errors have
heavy tails (Student's t), by iteratively reweighted least squares; the accelerations are estimated
again after each solve, so that a part that rests is held still and one that is swung keeps moving.
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

CHI3_MEDIAN = 1.538  # median length of a vector of three standard normal numbers
FREEDOM = 4.0  # degrees of freedom of Student's t: outliers of five deviations count a tenth
ITERATIONS = 6
ROTATION_ROUNDS = 6
WINDOW = 9  # frames over which accelerations are averaged
LEAST_ACCELERATION = 0.05  # of a resting part, in units of the noise: conditions the system
FIRST_WINDOW, FIRST_ACCELERATION = 15, 0.3  # the same for the first, noisy track
MEDIAN_FRAMES = 5  # frames of the median that the first weights are taken from
MOTION = 0.7  # share of the noise by fourth differences below which that by eighth ones is taken
LEAST_FRAMES = 16  # frames below which eighth differences are too few
Summary = Callable[[Float64[np.ndarray, "N ..."]], Any]  # from many lengths to one


def noise_level(
    track: Float64[np.ndarray, "T *B 3"],
    seen: Bool[np.ndarray, " T"] | None = None,
    summary: Summary = np.median,
) -> float:
    """Deviation of white noise per coordinate of a track, from its differences.

    Of order k they have C(2k, k) times the variance of the noise, and smooth motion hardly any.
    Fourth differences tell it, but where eighth ones, in which there is less of fast motion, are so
    much smaller that the fourth are mostly motion. The median does not see jumps; `summary` may be
    another one of the lengths of the differences. Frames that are not `seen` count only where no
    others are in a row.
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
    """Whether so many frames from each on are kept, and everywhere where they never are."""
    whole = np.asarray(sliding_window_view(kept, count).all(1))
    return whole if whole.any() else ~whole


def increments(rotations: Rotation) -> Float64[np.ndarray, "N 3"]:
    """Turn from each frame to the next in the part's own frame, axis-angle in radians."""
    return (rotations[:-1].inv() * rotations[1:]).as_rotvec()


def path_of(rotations: Rotation) -> Float64[np.ndarray, "T 3"]:
    """The turns from frame to frame added up, radians: a path in a plane space."""
    return np.concatenate([np.zeros((1, 3)), np.cumsum(increments(rotations), axis=0)])


def interpolated(
    track: Float64[np.ndarray, "T D"], known: Bool[np.ndarray, " T"]
) -> Float64[np.ndarray, "T D"]:
    """A track whose frames that are not `known` lie on straight lines between those that are."""
    frames, index = np.arange(len(track)), np.flatnonzero(known)
    return np.stack([np.interp(frames, index, x[index]) for x in track.T], axis=1)


def smooth_points(
    observed: Float64[np.ndarray, "T 3"], trusted: Bool[np.ndarray, " T"], noise: float
) -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, " T"]]:
    """The smooth track of a point, and the weight that each frame had in it, 0 to 1.

    Two frames or more are `trusted`; `noise` is the deviation of their coordinates, in the unit of
    these.
    """
    track = interpolated(observed, trusted)
    filled = np.where(trusted[:, None], observed, track)
    # medians do not see outliers, which would pass for acceleration
    raw = median_filter(np.square(np.diff(track, n=2, axis=0)).sum(1), FIRST_WINDOW)
    excess = raw / CHI3_MEDIAN**2 - comb(4, 2) * noise**2
    variance = excess.clip(0) + (FIRST_ACCELERATION * noise) ** 2
    weight = _weights(median_filter(track, (MEDIAN_FRAMES, 1)) - filled, trusted, noise)
    for _ in range(ITERATIONS):
        track = _solve(filled, weight / noise**2, 1 / variance)
        weight = _weights(track - filled, trusted, noise)
        bends = np.square(np.diff(track, n=2, axis=0)).mean(1)
        variance = uniform_filter1d(bends, WINDOW) + (LEAST_ACCELERATION * noise) ** 2
    return track, weight.clip(0, 1)


def _weights(
    off: Float64[np.ndarray, "T 3"], trusted: Bool[np.ndarray, " T"], noise: float
) -> Float64[np.ndarray, " T"]:
    """Student's t: how much a frame counts that is so far off the track."""
    return trusted * (FREEDOM + 3) / (FREEDOM + np.square(off).sum(1) / noise**2)


def _solve(
    observed: Float64[np.ndarray, "T 3"],
    weight: Float64[np.ndarray, " T"],
    stiffness: Float64[np.ndarray, " N"],
) -> Float64[np.ndarray, "T 3"]:
    """Least squares with weighted observations and weighted second differences."""
    upper = np.zeros((3, len(observed)))
    upper[2] = weight
    for shift, share in ((0, 1.0), (1, 4.0), (2, 1.0)):
        upper[2, shift : shift + len(stiffness)] += share * stiffness
    upper[1, 1:-1] -= 2 * stiffness
    upper[1, 2:] -= 2 * stiffness
    upper[0, 2:] += stiffness
    return solveh_banded(upper, weight[:, None] * observed)


def smooth_rotations(
    observed: Rotation, trusted: Bool[np.ndarray, " T"], noise: float
) -> tuple[Rotation, Float64[np.ndarray, " T"]]:
    """The smooth track of a rotation, and the weight that each frame had in it, 0 to 1.

    The increments of the present estimate, added up, are a path in a plane space; the observed
    deviations from the estimate are smoothed along it, and the estimate moves by what is left.
    """
    index = np.flatnonzero(trusted)
    times = np.arange(len(trusted)).clip(index[0], index[-1])
    seen = observed[index]  # pyright: ignore[reportArgumentType]  # arrays lack in scipy's stubs
    track = Slerp(index, seen)(times)
    weight = trusted.astype(float)
    for _ in range(ROTATION_ROUNDS):
        path = path_of(track)
        off = (track.inv() * observed).as_rotvec()
        smooth, weight = smooth_points(path + off, trusted, noise)
        step = smooth - path
        track = track * Rotation.from_rotvec(step)
        if np.abs(step).max() < 1e-4:
            break
    return track, weight
