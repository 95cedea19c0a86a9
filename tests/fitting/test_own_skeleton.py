"""The skeleton of keypoints, seen from a hand that was fitted to them."""

import pytest
import torch

from geneoh.fitting.own_skeleton import OwnSkeleton, own_skeleton
from geneoh.fitting.shape import measured_lengths
from geneoh.fitting.terms import HandState
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import forward_kinematics

MODEL = load_hand("right")
SHAPED = MODEL.shaped(torch.zeros(10))


def moving(frames: int) -> HandState:
    """A hand that turns and closes."""
    generator = torch.Generator().manual_seed(3)
    pose = MODEL.pose_mean + 0.3 * torch.randn(frames, 16, 3, generator=generator)
    wrist = torch.randn(frames, 3, generator=generator)
    return HandState(axis_angle_to_matrix(pose)[None], wrist[None])


def foreign(state: HandState) -> tuple[torch.Tensor, torch.Tensor]:
    """Keypoints whose thumb starts elsewhere and whose wrist is 1 cm off, and their offsets."""
    offsets = SHAPED.offsets.clone()
    offsets[12] *= 0.5
    off = (state.rotations[0, :, 0] @ torch.tensor([0.01, 0.0, 0.0])[:, None])[..., 0]
    return forward_kinematics(state.rotations[0], state.wrist[0] + off, offsets[None])[0], offsets


def test_foreign_skeleton_is_found_exactly():
    state = moving(30)
    joints, offsets = foreign(state)
    own = own_skeleton(state, joints, torch.ones(30, 21), SHAPED)
    torch.testing.assert_close(own.offsets, offsets, atol=2e-6, rtol=0)
    torch.testing.assert_close(own.wrist, torch.tensor([0.01, 0.0, 0.0]), atol=2e-6, rtol=0)
    torch.testing.assert_close(own.posed(state)[0], joints, atol=5e-6, rtol=0)


def test_noise_alone_leaves_the_skeleton_of_the_model():
    state = moving(30)
    joints = SHAPED.joints_from_rotations(state.rotations, state.wrist)[0]
    noisy = joints + 0.005 * torch.randn(joints.shape, generator=torch.Generator().manual_seed(1))
    own = own_skeleton(state, noisy, torch.ones(30, 21), SHAPED)
    assert (own.offsets - SHAPED.offsets).norm(dim=-1).mean() < 2e-4
    assert own.wrist.norm() < 5e-4


def test_single_frame_has_the_skeleton_of_the_model():
    state = moving(1)
    joints, _ = foreign(state)
    own = own_skeleton(state, joints, torch.ones(1, 21), SHAPED)
    torch.testing.assert_close(own.offsets, SHAPED.offsets)
    assert not own.wrist.any()


def test_keypoints_without_trust_do_not_count():
    state = moving(30)
    joints, offsets = foreign(state)
    trust = torch.ones(30, 21)
    trust[10:20, 2], trust[25:] = 0.0, 0.0
    joints[10:20, 2] += 0.2
    joints[25:] += 0.1
    own = own_skeleton(state, joints, trust, SHAPED)
    torch.testing.assert_close(own.offsets, offsets, atol=2e-6, rtol=0)


@pytest.mark.parametrize("moved", [0.0, 0.5])
def test_skeleton_does_not_depend_on_where_the_hand_is(moved):
    state = moving(30)
    joints, offsets = foreign(state)
    shifted = HandState(state.rotations, state.wrist + moved)
    own = own_skeleton(shifted, joints + moved, torch.ones(30, 21), SHAPED)
    torch.testing.assert_close(own.offsets, offsets, atol=1e-5, rtol=0)


def test_bones_are_as_long_as_the_keypoints_though_the_fitted_hand_bends_elsewhere():
    state = moving(30)
    joints, offsets = foreign(state)
    other = HandState(moving(31)[1:].rotations, state.wrist)
    found = own_skeleton(other, joints, torch.ones(30, 21), SHAPED)
    assert (found.offsets.norm(dim=-1) - offsets.norm(dim=-1)).abs().max() > 0.002
    lengths, noise = measured_lengths(joints, torch.ones(30, 21))
    kept = found.with_lengths(lengths, noise).offsets.norm(dim=-1)
    torch.testing.assert_close(kept, offsets.norm(dim=-1), atol=1e-5, rtol=0)


def test_lengths_that_differ_from_frame_to_frame_are_not_taken():
    joints, _ = foreign(moving(30))
    noisy = joints + 0.01 * torch.randn(joints.shape, generator=torch.Generator().manual_seed(1))
    own = OwnSkeleton(SHAPED.offsets, torch.zeros(3))
    kept = own.with_lengths(*measured_lengths(noisy, torch.ones(30, 21)))
    torch.testing.assert_close(kept.offsets, own.offsets)
    torch.testing.assert_close(
        own.with_lengths(torch.full((20,), torch.nan), torch.full((20,), torch.nan)).offsets,
        own.offsets,
    )
