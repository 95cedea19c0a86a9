import torch

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix


def random_pose(seed, *batch):
    generator = torch.Generator().manual_seed(seed)
    turn = axis_angle_to_matrix(torch.randn(*batch, 3, generator=generator))
    return Rigid(turn, torch.randn(*batch, 3, generator=generator))


def test_a_motion_turns_first_and_then_shifts():
    quarter = axis_angle_to_matrix(torch.tensor([0.0, 0.0, torch.pi / 2]))
    pose = Rigid(quarter, torch.tensor([0.0, 0.0, 1.0]))
    moved = pose.apply(torch.tensor([[1.0, 0.0, 0.0]]))
    torch.testing.assert_close(moved, torch.tensor([[0.0, 1.0, 1.0]]))


def test_inverse_takes_points_back():
    pose = random_pose(0, 4)
    points = torch.randn(4, 5, 3, generator=torch.Generator().manual_seed(1))
    torch.testing.assert_close(pose.inverse().apply(pose.apply(points)), points)


def test_composition_is_one_motion_after_the_other():
    later, first = random_pose(2, 3, 4), random_pose(3, 4)
    points = torch.randn(4, 5, 3, generator=torch.Generator().manual_seed(4))
    both = later.compose(first).apply(points)
    torch.testing.assert_close(both, later.apply(first.apply(points)))
    assert both.shape == (3, 4, 5, 3)
