"""A hand without an object is cleaned by the prior of motion alone, in the world's frame."""

import math
from dataclasses import replace

import numpy as np
import pytest
import quick_presets
import torch

import geneoh
from geneoh.baselines.filters import TUNED, filtered
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.metrics.accuracy import within_spread
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

FAST = geneoh.Options(preset="fast")


def alone(sequence: Sequence) -> Sequence:
    """The sequence without its object."""
    return replace(sequence, object=ObjectTrack.resting((), sequence.frames))


def error_and_acceleration(joints, truth: Sequence) -> tuple[float, float]:
    """Mean keypoint error in mm, and mean acceleration in mm per frame squared."""
    off, bends = joints - truth.hands[0].joints, joints.diff(n=2, dim=0)
    return tuple(1000 * float(values.norm(dim=-1).mean()) for values in (off, bends))


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["gauss", "beta", "bias", "drift", "burst", "drop"])
def test_a_hand_alone_is_better_than_filtered(clean, noise):
    noisy = corrupt_sequence(alone(clean), noise, generator=torch.Generator().manual_seed(3))
    cleaned = geneoh.denoise(noisy, FAST).sequence.hands[0].joints
    best = filtered(noisy.hands[0], TUNED["savgol", "parameters"], "parameters", clean.fps)
    error, acceleration = error_and_acceleration(cleaned, clean)
    filter_error, filter_acceleration = error_and_acceleration(best, clean)
    assert error < filter_error
    own = error_and_acceleration(clean.hands[0].joints, clean)[1]
    assert acceleration < 1.2 * max(filter_acceleration, own)


def test_a_clean_hand_alone_stays_where_it_is(clean):
    cleaned = geneoh.denoise(alone(clean), FAST)
    error, _ = error_and_acceleration(cleaned.sequence.hands[0].joints, clean)
    assert error < 1.5
    assert "no mesh" in cleaned.notes[0]
    report = cleaned.hands["left"].after
    assert math.isnan(report.penetration_mean_mm)
    assert report.acceleration_mm < 9


def test_keypoints_of_another_skeleton_keep_it(clean):
    """Other trackers begin the thumb nearer to the wrist, as FPHAB does, and end fingers sooner."""
    hand = clean.hands[0]
    turn = axis_angle_to_matrix(hand.pose)
    offsets = rest_offsets(turn, hand.joints, hand.trust)
    offsets[12] *= 0.4
    offsets[15:] *= 0.5
    joints, _ = forward_kinematics(turn, hand.joints[:, 0], offsets[None])
    keys = HandTrack(side="left", valid=hand.valid, joints=joints)
    given = replace(alone(clean), hands=(keys,))
    cleaned = geneoh.denoise(given, FAST)
    error, _ = error_and_acceleration(cleaned.sequence.hands[0].joints, given)
    assert error < 3.3  # 4.2 with the bones of the nearest hand
    assert cleaned.hands["left"].moved < 0.0033


@pytest.mark.parametrize("preset", ["fast", "default"])
def test_clean_keypoints_alone_stay_where_they_are(clean, preset):
    keys = replace(clean.hands[0], pose=None, wrist=None, betas=None, hand_model=None)
    given = replace(alone(clean), hands=(keys,))
    cleaned = geneoh.denoise(given, preset=preset)
    error, _ = error_and_acceleration(cleaned.sequence.hands[0].joints, clean)
    assert error < 1.5


def test_a_hand_alone_moves_with_the_world(noisy):
    short = alone(noisy)[30:60]
    hand = short.hands[0]
    turn = axis_angle_to_matrix(torch.tensor([0.4, -1.0, 0.7]))
    shift = torch.tensor([1.0, -2.0, 0.5])
    bare = HandTrack("left", hand.valid, joints=hand.joints)
    moved = HandTrack("left", hand.valid, joints=hand.joints @ turn.T + shift)
    first, second = (
        geneoh.denoise(replace(short, hands=(track,)), FAST).sequence.hands[0].joints
        for track in (bare, moved)
    )
    torch.testing.assert_close(first @ turn.T + shift, second, atol=2e-4, rtol=0)


@pytest.mark.parametrize("frames", [1, 2, 4])
def test_the_shortest_tracks_can_be_cleaned_alone(noisy, frames):
    cleaned = geneoh.denoise(alone(noisy)[40 : 40 + frames], FAST)
    assert cleaned.sequence.hands[0].joints.isfinite().all()


def test_a_file_of_keypoints_alone_is_cleaned_and_read_again(noisy, tmp_path):
    joints = noisy.hands[0].joints[40:60].numpy()
    np.savez(tmp_path / "hand.npz", joints=joints, side="left", fps=30.0)
    result = geneoh.denoise(geneoh.load(tmp_path / "hand.npz"), FAST)
    geneoh.save(result, tmp_path / "clean.npz")
    again = geneoh.load(tmp_path / "clean.npz")
    assert not again.object.meshes
    torch.testing.assert_close(again.hands[0].joints, result.sequence.hands[0].joints)


def test_the_file_of_a_hand_alone_holds_no_object_and_is_cleaned_again(noisy, tmp_path):
    result = geneoh.denoise(alone(noisy)[40:60], FAST)
    geneoh.save(result, tmp_path / "clean.npz")
    with np.load(tmp_path / "clean.npz") as file:
        assert not [name for name in file if name.startswith("object")]
    again = geneoh.load(tmp_path / "clean.npz")
    assert not again.object.is_known
    assert "without a pose" not in again.source
    assert geneoh.denoise(again, FAST).notes == result.notes


def test_the_papers_preset_cleans_a_hand_alone(noisy, monkeypatch):
    quick_presets.use(monkeypatch)
    options = geneoh.Options(preset="paper", steps=3)
    cleaned = geneoh.denoise(alone(noisy)[50:54], options)
    assert cleaned.sequence.hands[0].joints.isfinite().all()


def test_the_radius_of_a_hand_alone_holds_most_of_the_truth(clean):
    noise = torch.Generator().manual_seed(3)
    noisy = corrupt_sequence(alone(clean[:60]), "gauss", generator=noise)
    cleaned = geneoh.denoise(noisy).sequence.hands[0]
    truth = clean.hands[0].joints[:60]
    assert within_spread(cleaned.joints, truth, cleaned.joint_spread).mean() > 0.7
