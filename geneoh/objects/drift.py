"""Estimate how much drift (slowly varying noise) a part's poses have; `geneoh.objects.refine`
removes it.

White noise and drift can be distinguished where a part rests in the world frame. A stretch is taken
as rest if drift as large as the white noise explains it better than motion does; there the
likelihoods of the track with and without drift are compared. Rest in a hand is not used, because a
hand that was cleaned against the object drifts with it.
"""

import math

import numpy as np
from jaxtyping import Bool, Float64
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import expit, logsumexp

DRIFT_SECONDS = 0.5  # correlation time of the drift
STRETCH_SECONDS = 0.8  # length of the stretches that are tested
MOTION_SIZE = 2.0
"""Standard deviation of the motion model in units of the noise, same correlation time."""
LEAST_DRIFT = 0.3  # lower bound of the drift's standard deviation, in units of the noise


def size_of_drift(
    observed: list[Float64[np.ndarray, "T 3"]], known: Bool[np.ndarray, " T"], fps: float
) -> float:
    """Ratio of the standard deviations of drift and white noise, from `LEAST_DRIFT` to 1.

    It is 1 without evidence: the part is exact, or never rests for `STRETCH_SECONDS`. `observed`
    are rotation vectors, positions or both, in units of their white noise; only `known` frames are
    used.
    """
    count = math.ceil(STRETCH_SECONDS * fps)
    if not observed or len(known) < count:
        return 1.0
    track = np.concatenate(observed, axis=1)
    white, drifting, moving = (
        log_likelihood(track, size, count, DRIFT_SECONDS * fps) for size in (0.0, 1.0, MOTION_SIZE)
    )
    rests = sliding_window_view(known, count).all(1) & (drifting > moving)
    if not rests.any():
        return 1.0
    # the mean over all stretches: the best one of many has small drift by chance
    odds = logsumexp((white - drifting)[rests]) - np.log(rests.sum())
    return float(np.sqrt(LEAST_DRIFT**2 + (1 - LEAST_DRIFT**2) * expit(-odds)))


def log_likelihood(
    track: Float64[np.ndarray, "T N"], size: float, count: int, frames: float
) -> Float64[np.ndarray, " S"]:
    """Log likelihood, up to a constant, of each stretch of `count` frames of a resting track: white
    noise of standard deviation 1, and drift of standard deviation `size` with a correlation time of
    `frames`."""
    time = np.arange(count)
    centered = np.eye(count) - 1 / count
    drift = centered @ np.exp(-np.abs(time[:, None] - time) / frames) @ centered
    shares, modes = np.linalg.eigh(drift)
    variance = 1 + size**2 * shares[1:]  # without the first mode, the unknown mean position
    energy = np.square(sliding_window_view(track, count, axis=0) @ modes[:, 1:])
    return -0.5 * (energy / variance + np.log(variance)).sum((1, 2))
