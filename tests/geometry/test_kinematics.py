import torch

from geneoh.geometry.kinematics import tree_kinematics
from geneoh.geometry.rotations import axis_angle_to_matrix

ARM = (-1, 0, 1, 2)


def test_an_elbow_that_bends_turns_all_that_hangs_on_it():
    quarter = axis_angle_to_matrix(torch.tensor([0.0, 0.0, torch.pi / 2]))
    rotations = torch.stack([torch.eye(3), quarter, torch.eye(3)])
    bones = torch.tensor([[1.0, 0, 0]]).repeat(3, 1)
    root = torch.tensor([0.0, 0, 5])
    points, turned = tree_kinematics(rotations, root, bones, ARM)
    wanted = torch.tensor([[0.0, 0, 5], [1, 0, 5], [1, 1, 5], [1, 2, 5]])
    torch.testing.assert_close(points, wanted, atol=1e-6, rtol=0)
    torch.testing.assert_close(turned, torch.stack([torch.eye(3), quarter, quarter]))
