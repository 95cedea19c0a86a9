from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import (
    FINGERS,
    KEYPOINT_PARENTS,
    MANO_FROM_OPENPOSE,
    OPENPOSE_FROM_MANO,
    PARENTS,
    TIP_KEYPOINTS,
    TIP_PARENTS,
    bone_lengths,
    forward_kinematics,
    rest_offsets,
)
from tools.hand_builder.anatomy import MEASURED_OFFSETS

RECORDING = Path(__file__).parents[2] / "examples" / "taco_clean.npz"


def random_skeleton(frames, seed=0, dtype=torch.float64):
    generator = torch.Generator().manual_seed(seed)

    def normal(*shape):
        return torch.randn(*shape, generator=generator, dtype=dtype)

    return axis_angle_to_matrix(normal(frames, 16, 3)), normal(frames, 3), 0.03 * normal(20, 3)


def slow_twin(rotations, wrist, offsets):
    """One frame, one chain at a time, walking up from every point to the wrist."""
    points = []
    for point in range(21):
        joint = point if point < 16 else TIP_PARENTS[point - 16]
        local = np.zeros(3)
        if point >= 16:
            local = offsets[15 + point - 16]
        while joint != -1:
            base = wrist if joint == 0 else offsets[joint - 1]
            local = base + rotations[joint] @ local
            joint = PARENTS[joint]
        points.append(local)
    return np.stack([points[i] for i in OPENPOSE_FROM_MANO])


def test_forward_kinematics_equals_walking_up_the_tree():
    rotations, wrist, offsets = random_skeleton(5)
    joints, _ = forward_kinematics(rotations, wrist, offsets.expand(5, 20, 3))
    for frame in range(5):
        twin = slow_twin(rotations[frame].numpy(), wrist[frame].numpy(), offsets.numpy())
        np.testing.assert_allclose(joints[frame].numpy(), twin, atol=1e-12)


def test_global_rotation_is_the_product_along_the_chain():
    rotations, wrist, offsets = random_skeleton(3)
    _, glob = forward_kinematics(rotations, wrist, offsets.expand(3, 20, 3))
    ring3 = rotations[:, 0] @ rotations[:, 10] @ rotations[:, 11] @ rotations[:, 12]
    torch.testing.assert_close(glob[:, 12], ring3)


@pytest.mark.parametrize("seed", range(4))
def test_rest_offsets_invert_forward_kinematics(seed):
    rotations, wrist, offsets = random_skeleton(7, seed)
    joints, _ = forward_kinematics(rotations, wrist, offsets.expand(7, 20, 3))
    joints[2] = torch.nan  # what an unseen frame holds must not matter
    trust = (torch.arange(7) != 2).float()[:, None].expand(7, 21)
    torch.testing.assert_close(rest_offsets(rotations, joints, trust), offsets)


def test_rest_offsets_of_noisy_joints_are_the_mean_over_frames():
    rotations, wrist, offsets = random_skeleton(400)
    joints, _ = forward_kinematics(rotations, wrist, offsets.expand(400, 20, 3))
    generator = torch.Generator().manual_seed(1)
    noisy = joints + 0.001 * torch.randn(joints.shape, generator=generator, dtype=joints.dtype)
    found = rest_offsets(rotations, noisy, torch.ones(400, 21))
    # Each offset is the mean of 400 differences of two points with 1 mm of noise each.
    assert (found - offsets).abs().max() < 5 * 0.001 * 2**0.5 / 400**0.5


def test_bone_lengths_do_not_change_with_the_pose():
    rotations, wrist, offsets = random_skeleton(6)
    joints, _ = forward_kinematics(rotations, wrist, offsets.expand(6, 20, 3))
    lengths = bone_lengths(joints)
    torch.testing.assert_close(lengths, lengths[:1].expand(6, 20))
    assert sorted(lengths[0].tolist()) == pytest.approx(sorted(offsets.norm(dim=-1).tolist()))


def test_keypoint_orders_are_inverse_and_chains_end_in_tips():
    assert [OPENPOSE_FROM_MANO[i] for i in MANO_FROM_OPENPOSE] == list(range(21))
    assert [KEYPOINT_PARENTS[k] for k in (1, 5, 9, 13, 17)] == [0] * 5
    assert all(KEYPOINT_PARENTS[k] == k - 1 for k in range(1, 21) if k % 4 != 1)
    assert dict(zip(FINGERS, TIP_KEYPOINTS, strict=True)) == {
        "index": 8, "middle": 12, "pinky": 20, "ring": 16, "thumb": 4,
    }  # fmt: skip
    assert FINGERS[(7 - 1) // 3] == "pinky"
    assert len(PARENTS) == 16


def test_recorded_keypoints_follow_from_recorded_pose_and_measured_bones():
    data = np.load(RECORDING)
    turns = Rotation.from_rotvec(data["left_pose"].reshape(-1, 3)).as_matrix()
    rotations = torch.from_numpy(turns.reshape(-1, 16, 3, 3))
    wrist = torch.from_numpy(data["left_wrist"]).double()
    measured = torch.from_numpy(MEASURED_OFFSETS * [-1e-3, 1e-3, 1e-3])
    joints, _ = forward_kinematics(rotations, wrist, measured.expand(len(wrist), 20, 3))
    gap = (joints - torch.from_numpy(data["left_joints"])).norm(dim=-1)
    assert gap.mean() < 2e-4
    assert gap.max() < 1e-3
