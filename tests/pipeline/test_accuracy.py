"""How near the cleaner comes to the truth: on a clean recording and at other frame rates."""

from dataclasses import replace

import pytest
import torch

from geneoh.fitting.twist import TOLD, turned_about_bones
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.resample import at_rate
from geneoh.sequence.sequence import HandTrack


@pytest.mark.slow
def test_a_clean_recording_is_changed_by_at_most_four_millimetres(clean):
    result = denoise(clean)
    moved = result.sequence.hands[0].joints - clean.hands[0].joints
    assert moved.norm(dim=-1).mean() < 0.004
    assert moved.norm(dim=-1).mean(-1).max() < 0.010  # in the frame that changes most


def test_poses_twisted_about_their_bones_are_cleaned_as_natural_ones(clean):
    (hand,) = clean[40:100].hands
    rotations = axis_angle_to_matrix(hand.pose)
    skeleton = rest_offsets(rotations, hand.joints, hand.trust)
    twist = torch.tensor([0.8, -0.6, 0.5]).expand(5, 60, 3)
    turned = matrix_to_axis_angle(turned_about_bones(rotations, skeleton, twist))
    result = denoise(replace(clean[40:100], hands=(replace(hand, pose=turned),)), preset="fast")
    moved = result.sequence.hands[0].joints - hand.joints
    assert moved.norm(dim=-1).mean() < 0.006
    assert TOLD in result.hands["left"].notes


def test_keypoints_that_another_skeleton_places_elsewhere_stay_there(clean):
    (hand,) = clean[40:100].hands
    rotations = axis_angle_to_matrix(hand.pose)
    skeleton = rest_offsets(rotations, hand.joints, hand.trust)
    other = skeleton + 0.006 * torch.randn(20, 3, generator=torch.Generator().manual_seed(1))
    joints, _ = forward_kinematics(rotations, hand.joints[:, 0], other)
    alone = HandTrack(hand.side, hand.valid, joints=joints)
    result = denoise(replace(clean[40:100], hands=(alone,)), preset="fast")
    moved = result.sequence.hands[0].joints - joints
    assert moved.norm(dim=-1).mean() < 0.009


@pytest.fixture(scope="module")
def errors(clean) -> dict[float, tuple[float, float]]:
    """By frame rate the mean error of two seconds of noisy recording, before and after, metres."""
    found = {}
    for fps in (30.0, 60.0, 120.0):
        truth = at_rate(clean[40:100], fps)
        generator = torch.Generator().manual_seed(0)
        noisy = corrupt_sequence(truth, "gauss", generator=generator)
        result = denoise(noisy, Options(preset="fast")).sequence
        assert (result.fps, result.frames) == (truth.fps, truth.frames)
        before, after = (
            float((sequence.hands[0].joints - truth.hands[0].joints).norm(dim=-1).mean())
            for sequence in (noisy, result)
        )
        found[fps] = before, after
    return found


@pytest.mark.slow
@pytest.mark.parametrize("fps", [60.0, 120.0])
def test_other_frame_rates_are_cleaned_as_well_as_thirty_a_second(errors, fps):
    before, after = errors[fps]
    assert after < 0.6 * before
    assert after < 1.25 * errors[30.0][1]
