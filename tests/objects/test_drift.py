"""Drift of a resting object is told from white noise, and from motion."""

import numpy as np
import pytest
import torch

from geneoh.objects.drift import LEAST_DRIFT, size_of_drift
from geneoh.sequence.noise import ornstein_uhlenbeck

FRAMES = 90
SEEN = np.ones(FRAMES, dtype=bool)


def noise(drift: float, seed: int, frames: int = FRAMES) -> np.ndarray:
    """White noise of deviation 1 and drift besides."""
    white, unit = torch.randn(2, frames, 3, generator=torch.Generator().manual_seed(seed))
    return (white + drift * ornstein_uhlenbeck(unit, frames / FRAMES * 15)).double().numpy()


@pytest.mark.parametrize("fps", [30, 120])
def test_drift_as_large_as_white_noise_is_told_from_none(fps):
    seen = np.ones(3 * fps, dtype=bool)
    drifting, white = (
        np.mean([size_of_drift([noise(n, s, len(seen))], seen, float(fps)) for s in range(10)])
        for n in (1.0, 0.0)
    )
    assert drifting > 0.7
    assert white < 0.4


def test_a_rest_in_the_middle_of_motion_tells_it():
    far = np.zeros((FRAMES, 3))
    far[30:60] = 60.0
    far[:30], far[60:] = 2.0 * np.arange(30)[:, None], 60 - 2.0 * np.arange(30)[:, None]
    assert size_of_drift([far + noise(0.0, 0)], SEEN, 30.0) < 0.5
    assert size_of_drift([far + noise(1.0, 0)], SEEN, 30.0) > 0.7


def test_turns_and_places_together_tell_more():
    few = [size_of_drift([noise(0.0, seed)], SEEN, 30.0) for seed in range(10)]
    both = [size_of_drift([noise(0.0, s), noise(0.0, s + 10)], SEEN, 30.0) for s in range(10)]
    assert LEAST_DRIFT <= np.mean(both) < np.mean(few)


@pytest.mark.parametrize(
    ("track", "seen", "fps"),
    [
        (np.cumsum(np.full((FRAMES, 3), 3.0), axis=0), SEEN, 30.0),
        (noise(0.0, 0), np.arange(FRAMES) % 20 > 0, 30.0),
        (noise(0.0, 0)[:20], SEEN[:20], 30.0),
        (noise(0.0, 0), SEEN, 0.5),
    ],
    ids=["never rests", "seen for moments", "short", "a frame every two seconds"],
)
def test_where_nothing_tells_it_drift_is_as_large_as_noise(track, seen, fps):
    assert size_of_drift([track], seen, fps) == 1.0


def test_an_exact_part_has_none_to_tell():
    assert size_of_drift([], SEEN, 30.0) == 1.0
