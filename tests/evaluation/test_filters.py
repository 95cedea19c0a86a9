"""The baselines: Savitzky-Golay on keypoints and on parameters."""

from pathlib import Path

import torch

from geneoh.evaluation.filters import best_window, smooth, smooth_keypoints, smooth_parameters
from geneoh.sequence.files import load_sequence

EXAMPLES = Path(__file__).parents[2] / "examples"


def recording():
    return load_sequence(EXAMPLES / "taco_clean.npz").hands[0]


def test_filter_keeps_parabolas():
    time = torch.linspace(0, 1, 40)
    values = torch.stack([time, time**2, 3 - time], -1)
    assert torch.allclose(smooth(values, 9), values, atol=1e-5)


def test_track_shorter_than_the_window_is_left_alone():
    values = torch.randn(4, 3)
    assert torch.equal(smooth(values, 9), values)


def test_both_filters_take_jitter_off_the_recording():
    hand = recording()
    before = hand.joints.diff(n=2, dim=0).norm(dim=-1).mean()
    for joints in (smooth_keypoints(hand, 9), smooth_parameters(hand, 9)):
        assert joints.diff(n=2, dim=0).norm(dim=-1).mean() < 0.6 * before
        assert (joints - hand.joints).norm(dim=-1).mean() < 0.004


def test_best_window_is_best_among_its_peers():
    hand = recording()
    truth = smooth_keypoints(hand, 15)
    window, joints = best_window(hand, truth, on="keypoints")
    assert window == 15
    assert torch.equal(joints, truth)
