"""What smoothing alone could know: `python -m tools.smoothing_limits [SEEDS]`.

For the hand of the example recording under noises that do not last. Each of its 51 parameters is
taken as a Gaussian process whose covariance is fitted to the true trajectory. Its posterior mean is
computed with the true covariance of the noise, and with the true frames of bursts and losses. No
user has any of this. Prints mean keypoint errors in millimetres over the seeds, of the input
(frames that are not lost), of the tuned Savitzky-Golay filter, of this smoother and of geneoh.
"""

import sys
from collections.abc import Iterator

import numpy as np
import torch
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import minimize

import geneoh
from geneoh.baselines.filters import TUNED, filtered
from geneoh.choices import Noise
from geneoh.metrics.accuracy import mpjpe
from geneoh.seeds import seeded_generator
from geneoh.sequence.noise import DRIFT_FRAMES, SIZES, corrupt_sequence, perturbed
from geneoh.sequence.sequence import HandTrack
from tools.noisy_objects.clips import RECORDING, clip_of

NOISES: tuple[Noise, ...] = ("gauss", "gauss_strong", "drift", "burst", "drop")
BURST = 3.0
"""Mean noise of a frame, in standard deviations, above which the frame counts as a burst."""
LENGTHS = ((0.15, 0.08), (0.6, 0.08))
"""Initial length scales in seconds of the slow and of the quick part, one pair for each fit."""
FREE_MEAN = 100.0  # variance of a trajectory's mean, in units of the trajectory's own


def parameters(hand: HandTrack) -> np.ndarray:
    """Translation, metres, and axis-angles, radians, (T, 51)."""
    assert hand.wrist is not None, "the recording has parameters"
    assert hand.pose is not None, "the recording has parameters"
    return torch.cat([hand.wrist, hand.pose.flatten(1)], dim=1).double().numpy()


def matern(seconds: np.ndarray, length: float) -> np.ndarray:
    """Matern covariance of order 5/2 and variance 1."""
    ratio = np.sqrt(5) * seconds / length
    return (1 + ratio + ratio**2 / 3) * np.exp(-ratio)


def covariance(logs: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Covariance of a slow part, a quick part and jitter, from the logarithms of their standard
    deviations and length scales."""
    slow, slow_length, quick, quick_length, jitter = np.exp(logs)
    parts = slow**2 * matern(seconds, slow_length) + quick**2 * matern(seconds, quick_length)
    return parts + jitter**2 * np.eye(len(seconds))


def fitted_covariance(truth: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """The maximum likelihood covariance of a true trajectory."""
    size, free = truth.std() + 1e-6, FREE_MEAN * truth.var()

    def surprise(logs: np.ndarray) -> float:
        try:
            factor = cho_factor(covariance(logs, seconds) + free)
        except LinAlgError:  # lengths at which it is singular to rounding
            return np.inf
        centred = truth - truth.mean()
        return 2 * np.log(np.diag(factor[0])).sum() + centred @ cho_solve(factor, centred)

    starts = [np.log([size, slow, 0.3 * size, quick, 0.05 * size]) for slow, quick in LENGTHS]
    found = [minimize(surprise, start, method="Nelder-Mead") for start in starts]
    return covariance(min(found, key=lambda fit: fit.fun).x, seconds) + free


def smoothed(
    noisy: HandTrack, hand: HandTrack, noise: Noise, motion: list[np.ndarray]
) -> HandTrack:
    """The hand at the posterior mean of each parameter."""
    truth, seen = parameters(hand), noisy.valid.numpy()
    apart = np.abs(np.arange(len(truth))[:, None] - np.arange(len(truth)))
    offsets = np.where(seen[:, None], parameters(noisy) - truth, 0.0)
    sizes = SIZES[noise].scale(torch.ones(51)).double().numpy()
    frames = np.eye(len(truth))
    if noise == "drift":
        frames = np.exp(-apart / DRIFT_FRAMES)
    elif noise == "burst":
        frames = np.diag(np.where((np.abs(offsets) / sizes).mean(1) > BURST, 81.0, 1.0))
    errors = np.empty_like(truth)
    for number, known in enumerate(motion):
        observed = truth[:, number] + offsets[:, number]
        mean = observed[seen].mean()
        of_seen = known[np.ix_(seen, seen)] + sizes[number] ** 2 * frames[np.ix_(seen, seen)]
        posterior = mean + known[:, seen] @ np.linalg.solve(of_seen, observed[seen] - mean)
        errors[:, number] = posterior - truth[:, number]
    return perturbed(hand, torch.from_numpy(errors).float(), hand.valid)


def lines(seeds: int) -> Iterator[str]:
    """The table."""
    clean = clip_of(RECORDING)
    (hand,), number = clean.hands, np.arange(clean.frames)
    seconds, truth = np.abs(number[:, None] - number) / clean.fps, hand.joints
    assert truth is not None, "the recording has keypoints"
    motion = [fitted_covariance(values, seconds) for values in parameters(hand).T]
    yield "| noise | input | filter | smoother told the truth | geneoh |"
    yield "|---|---|---|---|---|"
    for noise in NOISES:
        errors = []
        for seed in range(seeds):
            noisy = corrupt_sequence(clean, noise, generator=seeded_generator(noise, seed))
            (track,) = noisy.hands
            best = smoothed(track, hand, noise, motion)
            simple = filtered(track, TUNED["savgol", "parameters"], "parameters", noisy.fps)
            found = geneoh.denoise(noisy, seed=seed).sequence.hands[0]
            versions = (track.joints, simple, best.joints, found.joints)
            errors.append(
                [1e3 * float(mpjpe(v, truth).nanmean()) for v in versions if v is not None]
            )
        yield f"| `{noise}` | " + " | ".join(f"{error:.1f}" for error in np.mean(errors, 0)) + " |"


if __name__ == "__main__":
    for line in lines(int(sys.argv[1]) if len(sys.argv) > 1 else 5):
        print(line, flush=True)
