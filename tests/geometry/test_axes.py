import pytest
import torch

from geneoh.choices import AXES
from geneoh.geometry.axes import nearest_axis, turn_up


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
