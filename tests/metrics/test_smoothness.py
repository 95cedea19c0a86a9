import pytest
import torch

from geneoh.metrics.smoothness import (
    acceleration,
    acceleration_error,
    in_mm_per_frame_squared,
    jerk,
)

FPS = 30.0


def thrown(order: int, size: float, frames: int = 8) -> torch.Tensor:
    """Points whose derivative of this order is constant, of this size in SI units."""
    seconds = torch.arange(frames, dtype=torch.float64) / FPS
    path = size * seconds**order / torch.arange(1, order + 1).prod()
    direction = torch.tensor([0.6, 0.0, -0.8], dtype=torch.float64)
    starts = torch.randn(5, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return starts + path[:, None, None] * direction


def test_falling_points_accelerate_by_gravity():
    found = acceleration(thrown(2, 9.81), FPS)
    torch.testing.assert_close(found, torch.full((6,), 9.81).double())


def test_constant_speed_is_no_acceleration_and_constant_acceleration_no_jerk():
    assert float(acceleration(thrown(1, 2.0), FPS).max()) < 1e-9
    assert float(jerk(thrown(2, 2.0), FPS).max()) < 1e-7
    torch.testing.assert_close(jerk(thrown(3, 7.0), FPS), torch.full((5,), 7.0).double())


def test_acceleration_does_not_depend_on_the_frame_rate_and_per_frame_does():
    slow = thrown(2, 4.0, frames=9)
    half = acceleration(slow[::2], FPS / 2)
    torch.testing.assert_close(half, torch.full((3,), 4.0).double())
    per_frame = in_mm_per_frame_squared(acceleration(slow, FPS), FPS)
    torch.testing.assert_close(per_frame, torch.full((7,), 4000 / FPS**2).double())
    steps = slow[2:] - 2 * slow[1:-1] + slow[:-2]
    torch.testing.assert_close(per_frame, 1000 * steps.norm(dim=-1).mean(-1))


def test_acceleration_error_is_that_of_the_difference_and_ignores_constant_offsets():
    truth = thrown(1, 1.0)
    assert float(acceleration_error(truth + 0.1, truth, FPS).max()) < 1e-9
    moved = thrown(2, 3.0) + truth
    torch.testing.assert_close(
        acceleration_error(moved, truth, FPS), torch.full((6,), 3.0).double()
    )


@pytest.mark.parametrize("frames", [1, 2])
def test_too_few_frames_have_no_acceleration(frames):
    assert acceleration(torch.zeros(frames, 21, 3), FPS).shape == (0,)
    assert jerk(torch.zeros(2, frames, 21, 3), FPS).shape == (2, 0)
