"""The baselines: low-pass filters on keypoints and on parameters, and how their sizes are tuned."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from geneoh.baselines.filters import (
    GRID,
    TUNED,
    Filter,
    best_filtered,
    best_offset,
    domains_of,
    filtered,
    one_euro,
    smooth,
    tuned_at,
    unwrapped,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.readers.npz.files import load
from tools.tune_filters import noisy_pairs, tuned

EXAMPLES = Path(__file__).parents[2] / "examples"
FPS = 30.0
EVERY = pytest.mark.parametrize(("kind", "domain"), TUNED)


@pytest.fixture(scope="module")
def hand():
    return load(EXAMPLES / "taco_clean.npz").hands[0]


def test_savitzky_golay_keeps_parabolas():
    time = torch.linspace(0, 1, 40)
    values = torch.stack([time, time**2, 3 - time], -1)
    assert torch.allclose(smooth(values, Filter("savgol", 9.0), FPS), values, atol=1e-5)


def test_a_track_shorter_than_the_window_is_filtered_by_the_longest_it_has():
    values = torch.randn(8, 3)
    expected = smooth(values, Filter("savgol", 7.0), FPS)
    assert not torch.equal(expected, values)
    assert torch.equal(smooth(values, Filter("savgol", 15.0), FPS), expected)
    assert torch.equal(smooth(values[:2], Filter("savgol", 15.0), FPS), values[:2])


def test_gaussian_passes_a_wave_by_its_known_response():
    time, deviation, period = torch.arange(400.0), 3.0, 40.0
    wave = torch.sin(2 * math.pi * time / period)
    passed = smooth(wave, Filter("gaussian", deviation), FPS)[100:300]
    gain = math.exp(-0.5 * (2 * math.pi * deviation / period) ** 2)
    assert float((passed - gain * wave[100:300]).abs().max()) < 0.002


def test_one_euro_at_rest_is_exponential_smoothing():
    """A step of 1 with beta 0: after n frames 1 - (1 - a)^n is left behind, a by the cutoff."""
    step = np.r_[0.0, np.ones(30)]
    a = (2 * math.pi * 2.0 / FPS) / (2 * math.pi * 2.0 / FPS + 1)
    expected = 1 - (1 - a) ** np.arange(31)
    assert np.allclose(one_euro(step, 2.0, 0.0, FPS), expected)


def test_one_euro_lags_less_where_the_track_is_fast():
    ramp = np.arange(60) / FPS
    slow, quick = (60 / FPS - one_euro(ramp, 1.0, beta, FPS)[-1] for beta in (0.0, 8.0))
    assert quick < 0.5 * slow


def test_unwound_rotations_are_the_same_rotations_without_a_jump():
    """A turn about one axis through half a turn, written as vectors no longer than pi."""
    angle = torch.linspace(2.0, 9.0, 30)
    wrapped = (angle + math.pi) % (2 * math.pi) - math.pi
    pose = torch.zeros(30, 16, 3)
    pose[:, 0, 2] = wrapped
    assert pose.diff(dim=0).abs().max() > 3
    straight = unwrapped(pose)
    torch.testing.assert_close(straight[:, 0, 2], angle)
    torch.testing.assert_close(
        axis_angle_to_matrix(straight), axis_angle_to_matrix(pose), atol=1e-5, rtol=0
    )


@EVERY
def test_every_tuned_filter_takes_jitter_off_the_recording(hand, kind, domain):
    before = hand.joints.diff(n=2, dim=0).norm(dim=-1).mean()
    joints = filtered(hand, TUNED[kind, domain], domain, FPS)
    assert joints.diff(n=2, dim=0).norm(dim=-1).mean() < 0.8 * before
    assert (joints - hand.joints).norm(dim=-1).mean() < 0.02


@EVERY
def test_every_tuned_size_was_to_be_had(kind, domain):
    assert TUNED[kind, domain] in GRID[kind]


def test_a_tuned_filter_lasts_as_long_at_any_frame_rate():
    assert [tuned_at("savgol", "keypoints", fps).size for fps in (5.0, 15.0, 30.0, 120.0)] == [
        3,
        7,
        15,
        61,
    ]
    assert [tuned_at("gaussian", "parameters", fps).size for fps in (15.0, 30.0, 60.0)] == [1, 2, 4]
    for kind, domain in TUNED:
        assert tuned_at(kind, domain, FPS) == TUNED[kind, domain]
    assert tuned_at("one-euro", "keypoints", 15.0) == TUNED["one-euro", "keypoints"]  # in hertz


def test_a_filter_on_parameters_keeps_the_bones(hand):
    joints = filtered(hand, Filter("savgol", 31.0), "parameters", FPS)
    bone = (joints[:, 6] - joints[:, 5]).norm(dim=-1)
    assert float(bone.std()) < 1e-5
    loose = filtered(hand, Filter("savgol", 31.0), "keypoints", FPS)
    assert float((loose[:, 6] - loose[:, 5]).norm(dim=-1).std()) > 1e-5


def test_keypoints_alone_are_filtered_as_keypoints(hand):
    assert domains_of(replace(hand, pose=None)) == ("keypoints",)
    assert domains_of(hand) == ("keypoints", "parameters")


@pytest.mark.parametrize("domain", ["keypoints", "parameters"])
def test_the_best_filter_is_the_one_nearest_to_the_truth(hand, domain):
    truth = filtered(hand, Filter("gaussian", 3.0), domain, FPS)
    assert torch.equal(best_filtered(hand, truth, domain, FPS), truth)


def test_the_best_offset_is_found_where_some_keypoints_are_far_off(hand):
    truth, moved = hand.joints, hand.joints + torch.tensor([0.01, -0.02, 0.03])
    moved[:, 1:6] += 0.5
    offset = best_offset(moved, truth)
    torch.testing.assert_close(offset, torch.tensor([-0.01, 0.02, -0.03]), atol=1e-4, rtol=0)


def test_tuning_finds_the_size_with_the_least_error(hand):
    names = ("valid", "joints", "pose", "wrist")
    short = replace(hand, **{name: getattr(hand, name)[:60] for name in names})
    pairs = noisy_pairs([short], ["gauss", "drop"])
    chosen, error = tuned(pairs, "gaussian", "keypoints")

    def by_hand(size):
        off = [
            (filtered(noisy, Filter("gaussian", size), "keypoints", FPS) - clean.joints)
            .norm(dim=-1)
            .mean()
            for clean, noisy in pairs
        ]
        return float(sum(off) / 2)

    errors = {size: by_hand(size) for size in (0.7, 1.0, 1.5, 2.0, 3.0, 4.5)}
    assert error == pytest.approx(min(errors.values()))
    assert errors[chosen.size] == pytest.approx(error)
