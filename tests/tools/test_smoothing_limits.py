import numpy as np
import pytest
import torch
from short_clips import example

from geneoh.metrics.accuracy import mpjpe
from geneoh.seeds import seeded_generator
from geneoh.sequence.noise import corrupt
from tools.smoothing_limits import FREE_MEAN, covariance, fitted_covariance, smoothed

HAND = example().hands[0]
SECONDS = np.abs(np.arange(HAND.frames)[:, None] - np.arange(HAND.frames)) / 30
MOTION = [covariance(np.log([0.5, 0.6, 0.05, 0.08, 1e-4]), SECONDS)] * 51


@pytest.mark.parametrize("noise", ["gauss", "drift", "burst", "drop"])
def test_the_posterior_mean_is_nearer_than_what_was_seen(noise):
    noisy = corrupt(HAND, noise, generator=seeded_generator(noise))
    found = smoothed(noisy, HAND, noise, MOTION).joints
    seen = noisy.valid
    assert found.isfinite().all()
    before, after = (mpjpe(j[seen], HAND.joints[seen]).mean() for j in (noisy.joints, found))
    assert after < (0.95 if noise == "drift" else 0.75) * before


def test_a_hand_that_is_seen_as_it_is_stays():
    found = smoothed(HAND, HAND, "gauss", [1e6 * motion for motion in MOTION]).joints
    torch.testing.assert_close(found, HAND.joints, rtol=0, atol=1e-3)


def test_the_fit_tells_a_smooth_trajectory_from_jitter():
    time = np.arange(60) / 30
    apart = np.abs(time[:, None] - time)
    found = []
    for truth in (np.sin(2 * np.pi * time), np.random.default_rng(0).standard_normal(60)):
        known = fitted_covariance(truth, apart) - FREE_MEAN * truth.var()
        found.append(known[0, 1] / known[0, 0])
    smooth, jitter = found
    assert smooth > 0.95
    assert abs(jitter) < 0.3
