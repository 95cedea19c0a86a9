"""How much of the noise of a part's poses drifts, which `geneoh.objects.refine` takes out of them.

Where a part rests in the world the two differ, and it may rest wherever drift as large as the white
noise explains its track better than motion does. There the likelihoods of the track with drift and
without are compared. The frames of hands are not asked: a hand that was cleaned against the object
drifts too.
"""

import math

import numpy as np
from jaxtyping import Bool, Float64
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import expit, logsumexp

DRIFT_SECONDS = 0.5  # correlation time of the drift
STRETCH_SECONDS = 0.8  # length of the stretches that are looked at
MOVES = 2.0  # deviation of what stands for motion, in units of the noise, same correlation time
LEAST_DRIFT = 0.3  # deviation of the drift, in units of the noise, where the track shows none


def size_of_drift(
    observed: list[Float64[np.ndarray, "T 3"]], known: Bool[np.ndarray, " T"], fps: float
) -> float:
    """Deviation of the drift in units of that of the white noise, from `LEAST_DRIFT` to 1.

    It is 1 where nothing tells it: the part is exact, or never rests for so long. `observed` are
    turns or places of the part or both, in units of their white noise, in frames that are `known`.
    """
    count = math.ceil(STRETCH_SECONDS * fps)
    if not observed or len(known) < count:
        return 1.0
    track = np.concatenate(observed, axis=1)
    white, drifting, moving = (
        log_likelihood(track, size, count, DRIFT_SECONDS * fps) for size in (0.0, 1.0, MOVES)
    )
    rests = sliding_window_view(known, count).all(1) & (drifting > moving)
    if not rests.any():
        return 1.0
    # of all stretches, and not of the best one: in some of many, drift is small by chance
    odds = logsumexp((white - drifting)[rests]) - np.log(rests.sum())
    return float(np.sqrt(LEAST_DRIFT**2 + (1 - LEAST_DRIFT**2) * expit(-odds)))


def log_likelihood(
    track: Float64[np.ndarray, "T N"], size: float, count: int, frames: float
) -> Float64[np.ndarray, " S"]:
    """Of each stretch of `count` frames of a track that rests, up to a constant: its coordinates
    have white noise of deviation 1, and a drift of the deviation `size` that is correlated over
    `frames`."""
    time = np.arange(count)
    centered = np.eye(count) - 1 / count
    drift = centered @ np.exp(-np.abs(time[:, None] - time) / frames) @ centered
    shares, modes = np.linalg.eigh(drift)
    variance = 1 + size**2 * shares[1:]  # the first is that of the place itself
    energy = np.square(sliding_window_view(track, count, axis=0) @ modes[:, 1:])
    return -0.5 * (energy / variance + np.log(variance)).sum((1, 2))
