import math

import pytest
import torch

from geneoh.evaluation.distributions import (
    ANGLES,
    correlations,
    joint_angles,
    ks_distance,
    motion_size,
    palm_basis,
    quantiles,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand


def normal(count: int, mean: float = 0.0, seed: int = 0) -> torch.Tensor:
    return mean + torch.randn(count, generator=torch.Generator().manual_seed(seed))


def flat_hand() -> torch.Tensor:
    """Keypoints of straight fingers in the plane z = 0 that fan out from the wrist."""
    joints = torch.zeros(21, 3)
    for finger in range(5):
        turn = math.radians(30 - 15 * finger)
        for bone in range(4):
            reach = 0.05 * (bone + 1)
            joints[1 + 4 * finger + bone] = torch.tensor(
                [reach * math.sin(-turn), reach * math.cos(turn), 0.0]
            )
    return joints


def test_quantiles_of_a_ramp_are_its_places():
    found = quantiles(torch.linspace(0, 100, 1001)[torch.randperm(1001)])
    assert (found.low, found.median, found.high) == pytest.approx((5, 50, 95))
    assert all(math.isnan(v) for v in vars(quantiles(torch.zeros(0))).values())


def test_ks_distance_of_shifted_uniform_samples_is_the_shift():
    ramp = torch.linspace(0, 1, 2001)
    assert ks_distance(ramp, ramp) == 0
    assert ks_distance(ramp, ramp + 0.3) == pytest.approx(0.3, abs=2e-3)
    assert ks_distance(ramp, ramp + 2) == 1
    assert ks_distance(normal(500), normal(3000, 0.5, 1)) == pytest.approx(
        ks_distance(normal(3000, 0.5, 1), normal(500))
    )
    assert math.isnan(ks_distance(ramp, torch.zeros(0)))


def test_ks_distance_of_two_normals_is_that_of_their_distributions():
    want = math.erf(0.5 / math.sqrt(2))  # the largest gap is half way: 2 Phi(1/2) - 1
    assert ks_distance(normal(20000), normal(20000, 1.0, 1)) == pytest.approx(want, abs=0.02)


def test_speed_and_acceleration_of_a_fall_are_those_of_physics():
    time = torch.arange(10) / 30
    points = torch.zeros(10, 2, 3)
    points[:, 0, 2] = -0.5 * 9.81 * time**2
    points[:, 1, 0] = 0.4 * time
    # float32 positions of half a metre are rounded to 3e-8 m, which 30² makes 1e-4 m/s²
    fallen = motion_size(points, 30.0, 2)
    torch.testing.assert_close(fallen[:, 0], torch.full((8,), 9.81), atol=1e-3, rtol=0)
    assert float(fallen[:, 1].max()) < 1e-3
    torch.testing.assert_close(motion_size(points, 30.0, 1)[:, 1], torch.full((9,), 0.4))


def test_straight_fingers_have_no_angles():
    assert len(ANGLES) == 20
    assert float(joint_angles(flat_hand()).abs().max()) < 1e-3


def test_a_bent_finger_shows_its_angle_and_no_other():
    joints = flat_hand()
    # the middle finger points along y: its end and tip turn by 40 degrees about x at joint 10
    turn = axis_angle_to_matrix(torch.tensor([math.radians(40), 0.0, 0.0]))
    joints[11:13] = joints[10] + (joints[11:13] - joints[10]) @ turn.T
    found = joint_angles(joints)
    want = torch.zeros(20)
    want[ANGLES.index("middle middle flexion")] = math.radians(40)
    torch.testing.assert_close(found, want, atol=1e-3, rtol=0)


@pytest.mark.parametrize("degrees", [-20.0, 20.0])
def test_spread_is_the_signed_turn_in_the_palms_plane(degrees):
    joints = flat_hand()
    # towards the index finger's side (-x) is a positive turn about z
    turn = axis_angle_to_matrix(torch.tensor([0.0, 0.0, math.radians(degrees)]))
    joints[10:13] = joints[9] + (joints[10:13] - joints[9]) @ turn.T
    found = joint_angles(joints)[ANGLES.index("middle spread")]
    normal_is_up = torch.linalg.cross(joints[5], joints[17])[2] > 0
    sign = 1 if bool(normal_is_up) else -1
    assert float(found) == pytest.approx(sign * math.radians(degrees), abs=1e-4)
    towards_pinky = joints[10, 0] > 0
    assert bool(found > 0) == bool(towards_pinky)


def test_angles_do_not_change_with_the_frame_or_the_size():
    hand = load_hand("right")
    joints = hand.shaped(torch.zeros(10)).posed(hand.pose_mean, torch.zeros(3)).joints
    turn = axis_angle_to_matrix(torch.tensor([0.4, -1.0, 2.0]))
    torch.testing.assert_close(
        joint_angles(1.3 * joints @ turn.T + 0.2), joint_angles(joints), atol=1e-4, rtol=0
    )


def test_a_palm_basis_is_a_rotation():
    axes = palm_basis(torch.stack([flat_hand(), flat_hand().roll(1, dims=-1)]))
    torch.testing.assert_close(axes.mT @ axes, torch.eye(3).expand(2, 3, 3), atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(axes), torch.ones(2))


def test_correlations_are_those_of_each_pair():
    a, b = normal(20000), normal(20000, seed=1)
    found = correlations(torch.stack([a, 2 * a + 1, 0.6 * a + 0.8 * b, torch.ones(20000)], 1))
    want = torch.tensor([1.0, 0.6, 0.0, 0.6, 0.0, 0.0])
    torch.testing.assert_close(found, want, atol=0.02, rtol=0)
