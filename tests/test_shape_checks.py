"""The first call of each function in each test is checked, and no other."""

from collections.abc import Iterator

import pytest
import torch
from beartype import beartype
from jaxtyping import Float, TypeCheckError
from shape_checks import begin_test, jaxtyped
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix


@jaxtyped(typechecker=beartype)
def length(vector: Float[Tensor, " 3"]) -> Float[Tensor, ""]:
    """The length of a vector of space."""
    return vector.norm()


@pytest.mark.parametrize("test", ["first", "second"])
def test_a_wrong_shape_fails_in_every_test(test: str) -> None:
    with pytest.raises(TypeCheckError):
        axis_angle_to_matrix(torch.zeros(4, 2))
    with pytest.raises(TypeCheckError):
        length(torch.zeros(2))


def test_later_calls_are_not_checked_and_those_of_other_functions_are() -> None:
    length(torch.zeros(3))
    assert length(torch.zeros(2)) == 0
    with pytest.raises(TypeCheckError):
        axis_angle_to_matrix(torch.zeros(4, 2))


def test_a_function_within_another_one_is_checked_and_called_with_what_it_closes_over() -> None:
    def longer_by(more: float):
        @jaxtyped(typechecker=beartype)
        def longer(vector: Float[Tensor, " 3"], times: int = 1) -> Float[Tensor, ""]:
            return more + (longer_by(2 * more)(vector, times - 1) if times else length(vector))

        return longer

    assert [float(longer_by(more)(torch.zeros(3))) for more in (1.0, 2.0)] == [3.0, 6.0]
    begin_test()
    with pytest.raises(TypeCheckError):
        longer_by(1.0)(torch.zeros(2))


@jaxtyped(typechecker=beartype)
def rest(vector: Float[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Wrongly, all but the first number."""
    return vector[1:]


@jaxtyped(typechecker=beartype)
def numbers(vector: Float[Tensor, " 3"]) -> Iterator[float]:
    """The numbers of a vector of space, one after the other."""
    yield from vector.tolist()


def test_results_and_what_is_given_one_by_one_are_checked_too() -> None:
    with pytest.raises(TypeCheckError):
        rest(torch.zeros(3))
    assert list(numbers(torch.zeros(3))) == [0, 0, 0]
    begin_test()
    with pytest.raises(TypeCheckError):
        list(numbers(torch.zeros(2)))
