import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from geneoh.diffusion.schedule import PAPER_STEPS, cosine_sigmas, descending_sigmas, linear_sigmas


def slow_sigmas(steps: int, first: float, last: float) -> list[float]:
    """The definition, level by level: betas on a line, their signals multiplied."""
    signal, sigmas = 1.0, [0.0]
    for i in range(steps):
        signal *= 1 - (first + (last - first) * i / (steps - 1))
        sigmas.append(((1 - signal) / signal) ** 0.5)
    return sigmas


@pytest.mark.parametrize(("first", "last"), [(1e-4, 0.02), (1e-3, 0.02)])
def test_sigmas_are_the_noise_to_signal_ratio_of_multiplied_betas(first, last):
    twin = torch.tensor(slow_sigmas(PAPER_STEPS, first, last), dtype=torch.float64)
    got = linear_sigmas(PAPER_STEPS, first, last)
    assert got.dtype == torch.float64
    torch.testing.assert_close(got, twin, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    ("first", "level", "signal", "noise"),
    [
        (1e-4, 100, 0.947, 0.321),
        (1e-4, 200, 0.812, 0.584),
        (1e-4, 400, 0.442, 0.897),
        (1e-3, 100, 0.907, 0.420),
        (1e-3, 200, 0.748, 0.663),
        (1e-3, 400, 0.382, 0.924),
    ],
)
def test_shares_of_signal_and_noise_are_the_published_ones(first, level, signal, noise):
    sigma = float(linear_sigmas(first=first)[level])
    assert 1 / (1 + sigma**2) ** 0.5 == pytest.approx(signal, abs=3e-3)
    assert sigma / (1 + sigma**2) ** 0.5 == pytest.approx(noise, abs=3e-3)


def test_sigmas_grow_from_zero():
    sigmas = linear_sigmas()
    assert len(sigmas) == PAPER_STEPS + 1
    assert sigmas[0] == 0
    assert bool((sigmas.diff() > 0).all())


@given(st.integers(1, PAPER_STEPS), st.data())
def test_the_way_back_falls_strictly_from_its_level_to_zero(level, data):
    steps = data.draw(st.integers(1, level))
    sigmas = descending_sigmas(level, steps)
    assert sigmas.dtype == torch.float32
    assert len(sigmas) == steps + 1
    assert sigmas[0] == linear_sigmas()[level].float()
    assert sigmas[-1] == 0
    assert bool((sigmas.diff() < 0).all())


def test_as_many_steps_as_levels_visit_every_level():
    way = linear_sigmas()[:101].flip(0).float()
    assert torch.equal(descending_sigmas(100, 100), way)


@pytest.mark.parametrize("steps", [4, 7, 1000])
def test_more_steps_than_levels_are_no_more_and_never_stand_still(steps):
    assert torch.equal(descending_sigmas(3, steps), descending_sigmas(3, 3))


def test_levels_of_another_schedule_are_the_nearest_to_even_steps():
    levels = torch.arange(1001, dtype=torch.float64)
    assert descending_sigmas(10, 4, levels).tolist() == [10, 8, 5, 2, 0]


def test_cosine_levels_are_the_squared_cosine_but_for_the_last():
    sigmas = cosine_sigmas()
    time = torch.tensor(500 / 1000, dtype=torch.float64)
    angle = (torch.stack([time, 0 * time]) + 0.008) / 1.008 * torch.pi / 2
    kept = angle.cos().square()
    kept = kept[0] / kept[1]
    torch.testing.assert_close(sigmas[500], ((1 - kept) / kept).sqrt())
    assert sigmas[0] == 0
    assert (sigmas.diff() > 0).all()
    last = (1 + sigmas[999] ** 2) / (1 + sigmas[1000] ** 2)
    assert last == pytest.approx(1e-3)  # beta is at most 0.999
