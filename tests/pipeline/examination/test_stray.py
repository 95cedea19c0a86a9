"""Single keypoints that a tracker put apart from the hand."""

from dataclasses import replace

import pytest
import torch

from geneoh.pipeline.examination.faults import without_faults
from geneoh.pipeline.examination.stray import strays


def with_joints(sequence, joints):
    hand = replace(sequence.hands[0], joints=joints, pose=None, wrist=None, betas=None)
    return replace(sequence, hands=(hand,))


@pytest.mark.parametrize("point", range(21))
def test_a_keypoint_apart_from_its_hand_counts_for_nothing(noisy, point):
    joints = noisy.hands[0].joints.clone()
    joints[50:60, point] += torch.tensor([0.1, 0.05, -0.05])
    cleaned, said = without_faults(with_joints(noisy, joints))
    lost = cleaned.hands[0].trust == 0
    assert lost.nonzero().tolist() == [[frame, point] for frame in range(50, 60)]
    words = "the left hand has 10 keypoints apart from it in 10 frames: taken as missing"
    assert said == (words,)


def test_keypoints_with_noise_of_their_own_are_kept(noisy):
    joints = noisy.hands[0].joints
    shaken = joints + 0.01 * torch.randn(joints.shape, generator=torch.Generator().manual_seed(0))
    assert not strays(shaken, torch.ones(joints.shape[:2], dtype=torch.bool)).any()


def test_a_hand_that_shrinks_has_no_strays(noisy):
    joints, size = noisy.hands[0].joints, torch.linspace(1.0, 0.5, noisy.frames)[:, None, None]
    shrunk = joints[:, :1] + size * (joints - joints[:, :1])
    assert not strays(shrunk, torch.ones(joints.shape[:2], dtype=torch.bool)).any()
