"""Noise of a track, and the smooth track under it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geneoh.objects.smoothing import noise_level, smooth_points, smooth_rotations

FRAMES = 200
EVERYWHERE = np.ones(FRAMES, dtype=bool)


def swing() -> np.ndarray:
    """A point that rests, is carried over half a metre in two seconds, and rests again."""
    phase = np.clip((np.arange(FRAMES) - 60) / 60, 0, 1)
    return np.outer(0.5 * (1 - np.cos(np.pi * phase)) / 2, [0.6, -0.3, 0.8])


def error(track, truth) -> float:
    return float(np.linalg.norm(track - truth, axis=1).mean())


@pytest.mark.parametrize("sigma", [0.001, 0.01])
def test_fourth_differences_tell_noise_and_not_motion(sigma):
    noise = sigma * np.random.default_rng(0).standard_normal((FRAMES, 3))
    assert noise_level(swing()) < 1e-5
    assert noise_level(swing() + noise) == pytest.approx(sigma, rel=0.2)


@pytest.mark.parametrize("sigma", [0.0, 0.002, 0.01])
def test_fast_shaking_is_motion_and_no_noise(sigma):
    time = np.arange(FRAMES) / 30
    shaken = np.outer(np.sin(2 * np.pi * 4 * time), [0.1, 0.02, 0.0])
    noise = sigma * np.random.default_rng(0).standard_normal((FRAMES, 3))
    assert noise_level(shaken + noise) == pytest.approx(sigma, rel=0.2, abs=4e-4)


def test_frames_that_are_not_seen_do_not_count_where_others_are_seen_in_a_row():
    noisy = swing() + 0.002 * np.random.default_rng(0).standard_normal((FRAMES, 3))
    often, never = np.arange(FRAMES) % 20 < 12, np.arange(FRAMES) % 2 == 0
    assert noise_level(noisy, never) == noise_level(noisy)
    assert noise_level(np.where(often[:, None], noisy, 1), often) == pytest.approx(0.002, rel=0.2)


def test_a_line_comes_back_as_it_is():
    line = np.outer(np.arange(FRAMES), [0.001, 0.002, -0.003])
    track, weight = smooth_points(line, EVERYWHERE, 0.001)
    assert np.allclose(track, line, atol=1e-9)
    assert np.allclose(weight, 1)


@pytest.mark.parametrize("sigma", [0.002, 0.008])
def test_smoothing_takes_most_of_the_noise_away_and_keeps_the_motion(sigma):
    noisy = swing() + sigma * np.random.default_rng(1).standard_normal((FRAMES, 3))
    track, _ = smooth_points(noisy, EVERYWHERE, sigma)
    assert error(track, swing()) < 0.4 * error(noisy, swing())


def test_outliers_hardly_count():
    noisy = swing() + 0.002 * np.random.default_rng(2).standard_normal((FRAMES, 3))
    noisy[::17] += 0.2
    track, weight = smooth_points(noisy, EVERYWHERE, 0.002)
    assert error(track, swing()) < 0.002
    assert weight[::17].max() < 0.05


def test_frames_that_are_not_trusted_are_bridged():
    trusted = EVERYWHERE.copy()
    trusted[80:92] = False
    broken = np.where(trusted[:, None], swing(), np.nan)
    track, weight = smooth_points(broken, trusted, 0.0005)
    assert np.linalg.norm(track - swing(), axis=1).max() < 0.004
    assert (weight[80:92] == 0).all()


@pytest.mark.parametrize("after", [2, 3, 4])
def test_a_few_frames_after_a_long_gap_stay_where_they_were_seen(after):
    time = np.arange(100) / 30
    truth = 0.2 * np.stack([np.sin(5 * time), np.cos(5 * time), 0 * time], axis=1)
    noisy = truth + 0.002 * np.random.default_rng(3).standard_normal((100, 3))
    trusted = np.arange(100) < 75
    trusted[-after:] = True
    track, _ = smooth_points(noisy, trusted, 0.002)
    for seen in (slice(0, 75), slice(100 - after, 100)):
        assert error(track[seen], truth[seen]) < 1.1 * error(noisy[seen], truth[seen])


@pytest.mark.parametrize("backwards", [False, True])
def test_motion_fades_out_where_a_track_begins_or_ends_unseen(backwards):
    line = np.outer(np.arange(FRAMES), [0.0, 0.01, 0.0])
    trusted = np.arange(FRAMES) < FRAMES - 40
    if backwards:
        line, trusted = line[::-1], trusted[::-1]
    track, weight = smooth_points(line, trusted, 0.001)
    off = np.linalg.norm(track - line, axis=1)
    edge, last = (40, 0) if backwards else (FRAMES - 41, FRAMES - 1)
    assert off[trusted].max() < 1e-6
    assert np.linalg.norm(track[last] - track[edge]) == pytest.approx(0.04, abs=1e-4)
    assert (weight[~trusted] == 0).all()


def test_rotations_are_smoothed_like_points():
    generator = np.random.default_rng(3)
    truth = Rotation.from_rotvec(3 * swing())
    noisy = truth * Rotation.from_rotvec(0.05 * generator.standard_normal((FRAMES, 3)))
    track, _ = smooth_rotations(noisy, EVERYWHERE, 0.05)
    before, after = (truth.inv() * noisy).magnitude(), (truth.inv() * track).magnitude()
    assert after.mean() < 0.4 * before.mean()


def test_a_rotation_beyond_half_a_turn_is_no_jump():
    truth = Rotation.from_rotvec(np.outer(np.linspace(0, 3 * np.pi, FRAMES), [0, 0, 1]))
    track, _ = smooth_rotations(truth, EVERYWHERE, 0.01)
    assert (truth.inv() * track).magnitude().max() < 1e-3
