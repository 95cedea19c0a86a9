import math

import torch

from geneoh.generators.both2hands.limits import within_limits
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.library import load_hand

RING3 = 15 + 11  # the last bone of the right ring finger


def bending(*angles: float) -> torch.Tensor:
    """Flat hands, but for the right ring finger's last bone, which has these angles."""
    vectors = torch.zeros(len(angles), 30, 3)
    vectors[:, RING3, 2] = torch.tensor(angles)
    return axis_angle_to_matrix(vectors)


def test_joints_inside_the_limits_stay_exactly_as_they_are():
    fingers = bending(*torch.linspace(0, 1.5, 20).tolist())
    assert torch.equal(within_limits(fingers), fingers)


def test_a_bone_that_went_the_other_way_round_is_bent_as_far_as_a_hand_can():
    high = float(load_hand("right").pose_high[12, 2])
    found = matrix_to_axis_angle(within_limits(bending(*[-2.6] * 30)))
    torch.testing.assert_close(found[:, RING3, 2], torch.full((30,), high))
    assert not found[:, :RING3].any()


def test_a_bone_that_goes_through_the_back_of_the_hand_stays_in_the_limits_and_does_not_jump():
    angles = torch.cat([torch.linspace(0, -math.pi, 20), torch.linspace(math.pi, 1.5, 20)])
    found = matrix_to_axis_angle(within_limits(bending(*angles.tolist())))[:, RING3]
    low, high = (getattr(load_hand("right"), name)[12] for name in ("pose_low", "pose_high"))
    assert (found >= low - 1e-4).all()
    assert (found <= high + 1e-4).all()
    assert found.diff(dim=0).abs().max() < 0.35
    torch.testing.assert_close(found[-1, 2], torch.tensor(1.5), atol=0.1, rtol=0)


def test_a_joint_that_leaps_inside_its_limits_is_smoothed():
    leaping = bending(*[0.1] * 20, *[1.0] * 20)
    found = within_limits(leaping)
    steps = matrix_to_axis_angle(found[:-1].mT @ found[1:]).norm(dim=-1)
    assert float(steps.max()) < math.radians(10)
    torch.testing.assert_close(found[[0, -1]], leaping[[0, -1]], atol=0.02, rtol=0)


def test_single_frames_are_brought_back_too():
    found = matrix_to_axis_angle(within_limits(bending(-0.9)))
    assert float(found[0, RING3, 2]) > -0.5
