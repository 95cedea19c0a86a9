import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from geneoh.choices import AXES
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    interpolate_rotations,
    is_rotation,
    kabsch,
    matrix_to_axis_angle,
    matrix_to_quat_wxyz,
    matrix_to_rotation_6d,
    nearest_axis,
    rotation_6d_to_matrix,
    shortest_turn,
    skew,
    turn_up,
)

FLOAT32 = 2e-6
FLOAT64 = 1e-12
TOLERANCE = {torch.float32: FLOAT32, torch.float64: FLOAT64}

ANGLES = (0.0, 1e-9, 1e-5, 1e-3, 2e-3, 0.1, 1.0, 3.0, math.pi - 1e-4, math.pi - 1e-7)


def random_axes(count, seed=0, dtype=torch.float64):
    generator = torch.Generator().manual_seed(seed)
    axes = torch.randn(count, 3, generator=generator, dtype=torch.float64)
    return torch.nn.functional.normalize(axes, dim=-1).to(dtype)


def test_quarter_turn_around_z_takes_x_to_y():
    turn = axis_angle_to_matrix(torch.tensor([0.0, 0.0, math.pi / 2]))
    torch.testing.assert_close(turn @ torch.tensor([1.0, 0.0, 0.0]), torch.tensor([0.0, 1.0, 0.0]))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("angle", ANGLES)
def test_matrix_is_the_exponential_of_the_cross_product(angle, dtype):
    vector = random_axes(8, dtype=dtype) * angle
    torch.testing.assert_close(
        axis_angle_to_matrix(vector),
        torch.linalg.matrix_exp(skew(vector)),
        atol=TOLERANCE[dtype],
        rtol=0,
    )


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("angle", ANGLES)
def test_axis_angle_comes_back_from_the_matrix(angle, dtype):
    vector = random_axes(8, dtype=dtype) * angle
    back = matrix_to_axis_angle(axis_angle_to_matrix(vector))
    # Next to a half turn float32 cannot tell the axis from its opposite.
    same = torch.minimum((back - vector).norm(dim=-1), (back + vector).norm(dim=-1))
    error = same if angle > math.pi - 1e-6 else (back - vector).norm(dim=-1)
    assert float(error.max()) < 10 * TOLERANCE[dtype] + 1e-12


def test_half_turn_is_found_on_every_axis():
    axes = torch.cat([torch.eye(3), random_axes(5, dtype=torch.float32)])
    half = 2 * axes[:, :, None] * axes[:, None, :] - torch.eye(3)
    found = matrix_to_axis_angle(half)
    torch.testing.assert_close(found.norm(dim=-1), torch.full((8,), math.pi), atol=1e-3, rtol=0)
    torch.testing.assert_close(axis_angle_to_matrix(found), half, atol=FLOAT32, rtol=0)


@given(st.lists(st.floats(-6, 6), min_size=3, max_size=3))
@settings(max_examples=50, deadline=None)
def test_matrices_are_rotations_and_six_numbers_hold_them(vector):
    turn = axis_angle_to_matrix(torch.tensor(vector, dtype=torch.float64))
    torch.testing.assert_close(
        turn @ turn.T, torch.eye(3, dtype=torch.float64), atol=FLOAT64, rtol=0
    )
    assert float(torch.linalg.det(turn)) == pytest.approx(1, abs=FLOAT64)
    torch.testing.assert_close(rotation_6d_to_matrix(matrix_to_rotation_6d(turn)), turn)


def test_six_numbers_of_any_scale_give_a_rotation():
    numbers = torch.randn(4, 5, 6, generator=torch.Generator().manual_seed(1)) * 3
    turn = rotation_6d_to_matrix(numbers)
    torch.testing.assert_close(turn @ turn.mT, torch.eye(3).expand(4, 5, 3, 3), atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(turn), torch.ones(4, 5))


def test_what_scales_shears_mirrors_or_is_no_number_is_no_rotation():
    turn = axis_angle_to_matrix(torch.tensor([0.3, -0.2, 2.0]))
    half = turn.half().float()
    wrong = [2 * turn, 0 * turn, -turn, turn * torch.nan, turn + 0.1 * torch.eye(3)]
    assert is_rotation(torch.stack([turn, half, *wrong])).tolist() == [True] * 2 + [False] * 5


def test_quaternion_is_the_half_angle():
    axes = random_axes(6)
    quat = matrix_to_quat_wxyz(axis_angle_to_matrix(axes * 0.8))
    expected = torch.cat([torch.full((6, 1), math.cos(0.4)).double(), axes * math.sin(0.4)], -1)
    torch.testing.assert_close(quat, expected)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.1])
def test_gradients_agree_with_finite_differences(angle):
    vector = (random_axes(3) * angle).requires_grad_()
    assert torch.autograd.gradcheck(axis_angle_to_matrix, (vector,))

    def there_and_back(vector):
        return matrix_to_axis_angle(axis_angle_to_matrix(vector))

    assert torch.autograd.gradcheck(there_and_back, (vector,))


def test_interpolation_turns_at_constant_speed():
    axis = random_axes(1, dtype=torch.float32)[0]
    base = axis_angle_to_matrix(torch.tensor([0.3, -1.0, 0.5]))
    fraction = torch.linspace(0, 1, 5)
    path = interpolate_rotations(base, base @ axis_angle_to_matrix(axis * 1.2), fraction)
    expected = base @ axis_angle_to_matrix(axis * 1.2 * fraction[:, None])
    torch.testing.assert_close(path, expected, atol=FLOAT32, rtol=0)


def test_kabsch_finds_the_motion_that_was_made():
    generator = torch.Generator().manual_seed(2)
    points = torch.randn(7, 3, generator=generator)
    turns = axis_angle_to_matrix(random_axes(4, dtype=torch.float32) * 2.5)
    shift = torch.randn(4, 3, generator=generator)
    moved = points @ turns.mT + shift[:, None]
    rotation, translation = kabsch(points, moved)
    torch.testing.assert_close(rotation, turns, atol=FLOAT32, rtol=0)
    torch.testing.assert_close(translation, shift, atol=FLOAT32, rtol=0)


def test_kabsch_never_mirrors_and_ignores_points_without_weight():
    generator = torch.Generator().manual_seed(3)
    points = torch.randn(6, 3, generator=generator)
    mirrored = points * torch.tensor([-1.0, 1.0, 1.0])
    rotation, _ = kabsch(points, mirrored)
    assert float(torch.linalg.det(rotation)) == pytest.approx(1, abs=1e-5)
    moved = points.clone()
    moved[0] += 5
    weights = torch.tensor([0.0, 1, 1, 1, 1, 1])
    rotation, translation = kabsch(points, moved, weights)
    torch.testing.assert_close(rotation, torch.eye(3), atol=FLOAT32, rtol=0)
    torch.testing.assert_close(translation, torch.zeros(3), atol=FLOAT32, rtol=0)


def test_kabsch_fits_flat_points():
    flat = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 1, 0]])
    turn = axis_angle_to_matrix(torch.tensor([1.0, 0.4, -0.3]))
    rotation, _ = kabsch(flat, flat @ turn.T)
    torch.testing.assert_close(rotation, turn, atol=FLOAT32, rtol=0)


@pytest.mark.parametrize("angle", [0.0, 1e-3, 1.0, *(math.pi - x for x in (1e-2, 1e-4, 1e-6, 0.0))])
def test_the_shortest_turn_takes_one_direction_to_another_however_opposite(angle):
    start = torch.cat([torch.eye(3), -torch.eye(3), random_axes(50).float()])
    axis = random_axes(56, seed=1).float()
    across = torch.nn.functional.normalize(torch.linalg.cross(start, axis), dim=-1)
    end = (axis_angle_to_matrix(angle * across) @ start[..., None])[..., 0]
    end = -start if angle == math.pi else end
    turn = shortest_turn(2 * start, 0.5 * end)
    torch.testing.assert_close((turn @ start[..., None])[..., 0], end, atol=FLOAT32, rtol=0)
    square = turn @ turn.mT
    torch.testing.assert_close(square, torch.eye(3).expand_as(square), atol=FLOAT32, rtol=0)
    found = matrix_to_axis_angle(turn.double()).norm(dim=-1)
    torch.testing.assert_close(found, torch.full_like(found, angle), atol=1e-3, rtol=0)


def unit(axis: str) -> torch.Tensor:
    return torch.eye(3)["xyz".index(axis[-1])] * (-1 if axis.startswith("-") else 1)


@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("to", AXES)
def test_turning_up_takes_one_axis_to_the_other_without_a_mirror(up, to):
    turn = turn_up(up, to)
    torch.testing.assert_close(turn @ unit(up), unit(to))
    assert torch.linalg.det(turn) == 1


@pytest.mark.parametrize("axis", AXES)
def test_the_nearest_axis_of_a_leaning_direction(axis):
    assert nearest_axis(unit(axis) + torch.tensor([0.1, -0.2, 0.15])) == axis
