import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.keypoints import palm_axes


def test_the_palms_axes_are_a_rotation_that_turns_with_the_hand(draw):
    joints = 0.08 * draw(2, 4, 21, 3)
    axes, turn = palm_axes(joints), axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    torch.testing.assert_close(axes @ axes.mT, torch.eye(3).expand(2, 3, 3), atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(axes), torch.ones(2))
    turned = joints @ turn.T
    torch.testing.assert_close(palm_axes(turned), turn @ axes, atol=1e-5, rtol=0)


def test_in_its_own_axes_the_palm_points_along_the_first_and_second(draw):
    joints = 0.08 * draw(2, 4, 21, 3)
    joints = (joints @ palm_axes(joints)[:, None]).mean(1)
    middle, across = joints[:, 9] - joints[:, 0], joints[:, 5] - joints[:, 17]
    assert bool((middle[:, 0] > 0).all())
    assert float(middle[:, 1:].abs().max()) < 1e-6
    assert bool((across[:, 1] > 0).all())
    assert float(across[:, 2].abs().max()) < 1e-6
