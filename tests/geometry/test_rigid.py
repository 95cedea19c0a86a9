import torch

from geneoh.geometry.rigid import Rigid, joint_poses, part_poses
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


def test_a_part_turns_about_its_pivot_or_slides_along_its_axis():
    state, slides = torch.tensor([[torch.pi / 2], [0.3]]), torch.tensor([False, True])
    axis, pivot = torch.eye(3)[[2, 2]], torch.eye(3)[[0, 0]]
    joint = Rigid(*joint_poses(state, axis, pivot, slides))
    point = torch.tensor([2.0, 0.0, 0.0]).expand(2, 1, 1, 3)
    expected = torch.tensor([[1.0, 1.0, 0.0], [2.0, 0.0, 0.3]])[:, None, None]
    torch.testing.assert_close(joint.apply(point), expected)
    first = random_pose(5, 2, 1)
    rotation, translation = part_poses(first, joint)
    moved = Rigid(rotation, translation).apply(point[:, :, None])
    torch.testing.assert_close(moved[:, :, 0], first.apply(point))
    torch.testing.assert_close(moved[:, :, 1], first.apply(expected))
