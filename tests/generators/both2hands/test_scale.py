import pytest
import torch

from geneoh.generators.both2hands.features import LEAST_SCALE, Scale


def features():
    made = 3 * torch.randn(4, 10, 9, generator=torch.Generator().manual_seed(0)) + 2
    made[..., 1] = 5.0
    return made


REAL = torch.arange(10) < torch.tensor([10, 7, 10, 4])[:, None]


def test_numbers_have_unit_deviation_and_come_back():
    scale, made = Scale(9), features()
    scale.fit(made, REAL, "deviation")
    numbers = scale.normalise(made)
    torch.testing.assert_close(scale.denormalise(numbers), made)
    varied = numbers[REAL][:, [0, 2, 3, 8]]
    torch.testing.assert_close(varied.std(0, unbiased=False), torch.ones(4))
    assert scale.size[1] == LEAST_SCALE[0]


def test_ranges_of_positions_are_one_and_rotations_stay_as_they_are():
    scale, made = Scale(9), features()
    scale.fit(made, REAL, "range")
    numbers = scale.normalise(made)
    torch.testing.assert_close(numbers[..., 3:], made[..., 3:])
    seen = numbers[REAL][:, [0, 2]]
    torch.testing.assert_close(seen.amax(0), torch.ones(2))
    torch.testing.assert_close(seen.amin(0), -torch.ones(2))


@pytest.mark.parametrize("scaling", ["deviation", "range"])
def test_frames_after_the_end_do_not_count(scaling):
    first, second = Scale(9), Scale(9)
    made = features()
    first.fit(made, REAL, scaling)
    made[~REAL] = 1e6
    second.fit(made, REAL, scaling)
    torch.testing.assert_close(first.middle, second.middle)
    torch.testing.assert_close(first.size, second.size)
