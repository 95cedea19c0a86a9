"""Random numbers that synthesis and training draw."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True)
class Draws:
    """Random numbers for B items, from one generator in the order in which they are asked for.

    The order is part of the data: a draw that moves to another place changes all that come after.
    """

    batch: int
    generator: torch.Generator

    def uniform(self, limits: tuple[float, float], *shape: int) -> Float[Tensor, "B ..."]:
        """Numbers spread evenly between two limits."""
        low, high = limits
        return low + (high - low) * self.share(*shape)

    def log_uniform(self, limits: tuple[float, float], *shape: int) -> Float[Tensor, "B ..."]:
        """Numbers whose logarithm is spread evenly between those of two limits."""
        low, high = (math.log(limit) for limit in limits)
        return torch.exp(self.uniform((low, high), *shape))

    def share(self, *shape: int) -> Float[Tensor, "B ..."]:
        """Numbers spread evenly between 0 and 1."""
        return torch.rand(self.batch, *shape, generator=self.generator)

    def normal(self, *shape: int) -> Float[Tensor, "B ..."]:
        """Normal numbers of unit variance."""
        return torch.randn(self.batch, *shape, generator=self.generator)

    def chance(self, share: float, *shape: int) -> Bool[Tensor, "B ..."]:
        """True in so large a share."""
        return self.share(*shape) < share

    def integers(self, low: int, high: int, *shape: int) -> Tensor:
        """Whole numbers from `low` to `high` - 1."""
        return torch.randint(low, high, (self.batch, *shape), generator=self.generator)

    def smooth(self, frames: int, channels: int, period: float) -> Float[Tensor, "B T C"]:
        """Smooth noise of unit variance that changes over about `period` frames."""
        time = torch.arange(-3 * int(period), 3 * int(period) + 1, dtype=torch.float32)
        kernel = torch.exp(-0.5 * (time / period) ** 2)
        kernel = kernel / kernel.square().sum().sqrt()
        shape = self.batch * channels, 1, frames + len(kernel) - 1
        white = torch.randn(shape, generator=self.generator)
        smooth = torch.nn.functional.conv1d(white, kernel[None, None])
        return smooth.reshape(self.batch, channels, frames).transpose(1, 2)
