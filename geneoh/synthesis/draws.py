"""Random numbers that synthesis and training draw: uniform in a range, or smooth over time."""

import torch
from jaxtyping import Float
from torch import Tensor


def uniform(limits: tuple[float, float], *shape: int, generator: torch.Generator) -> Tensor:
    """Numbers spread evenly between two limits."""
    low, high = limits
    return low + (high - low) * torch.rand(shape, generator=generator)


def smooth_noise(
    batch: int, frames: int, channels: int, period: float, *, generator: torch.Generator
) -> Float[Tensor, "B T C"]:
    """Smooth noise of unit variance that changes over about `period` frames."""
    time = torch.arange(-3 * int(period), 3 * int(period) + 1, dtype=torch.float32)
    kernel = torch.exp(-0.5 * (time / period) ** 2)
    kernel = kernel / kernel.square().sum().sqrt()
    white = torch.randn(batch * channels, 1, frames + len(kernel) - 1, generator=generator)
    smooth = torch.nn.functional.conv1d(white, kernel[None, None])
    return smooth.reshape(batch, channels, frames).transpose(1, 2)
