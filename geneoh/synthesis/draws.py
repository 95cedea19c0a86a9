"""Random numbers for the items of a batch, which synthesis and training draw by seed."""

import math
from dataclasses import dataclass
from itertools import pairwise

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True)
class Part:
    """A range of items of a batch whose random numbers are drawn for the whole batch, so that an
    item gets the same numbers however the batch is split."""

    first: int
    count: int
    total: int  # items of the whole batch

    def divided(self, number: int) -> list["Part"]:
        """`number` parts whose sizes differ by at most one item."""
        ends = [self.first + self.count * index // number for index in range(number + 1)]
        return [Part(a, b - a, self.total) for a, b in pairwise(ends)]


@dataclass(frozen=True)
class Draws:
    """Random numbers for B items, from one generator in the order of the calls.

    The order is part of the data: moving a call changes all random numbers after it.
    """

    batch: int
    generator: torch.Generator
    part: Part | None = None  # the B items as a range of a larger batch; None for a whole batch

    @property
    def whole(self) -> "Draws":
        """Draws for all items of the larger batch."""
        return Draws(self.total, self.generator)

    @property
    def total(self) -> int:
        """Number of items of the whole batch."""
        return self.batch if self.part is None else self.part.total

    def uniform(self, limits: tuple[float, float], *shape: int) -> Float[Tensor, "B ..."]:
        """Uniform numbers between two limits."""
        low, high = limits
        return low + (high - low) * self.share(*shape)

    def log_uniform(self, limits: tuple[float, float], *shape: int) -> Float[Tensor, "B ..."]:
        """Log-uniform numbers between two positive limits."""
        low, high = (math.log(limit) for limit in limits)
        return torch.exp(self.uniform((low, high), *shape))

    def share(self, *shape: int) -> Float[Tensor, "B ..."]:
        """Uniform numbers between 0 and 1."""
        return self.own(torch.rand(self.total, *shape, generator=self.generator))

    def normal(self, *shape: int) -> Float[Tensor, "B ..."]:
        """Normal numbers of unit variance."""
        return self.own(torch.randn(self.total, *shape, generator=self.generator))

    def like(self, values: Float[Tensor, "B ..."]) -> Float[Tensor, "B ..."]:
        """Standard normal numbers of the shape, type and device of `values`."""
        return self.normal(*values.shape[1:]).to(values)

    def chance(self, share: float, *shape: int) -> Bool[Tensor, "B ..."]:
        """True with probability `share`."""
        return self.share(*shape) < share

    def integers(self, low: int, high: int, *shape: int) -> Tensor:
        """Whole numbers from `low` to `high` - 1."""
        return self.own(torch.randint(low, high, (self.total, *shape), generator=self.generator))

    def smooth(self, frames: int, channels: int, period: float) -> Float[Tensor, "B T C"]:
        """Smooth noise of unit variance that changes over about `period` frames."""
        time = torch.arange(-3 * int(period), 3 * int(period) + 1, dtype=torch.float32)
        kernel = torch.exp(-0.5 * (time / period) ** 2)
        kernel = kernel / kernel.square().sum().sqrt()
        white = self.normal(channels, frames + len(kernel) - 1).flatten(0, 1)[:, None]
        smooth = torch.nn.functional.conv1d(white, kernel[None, None])
        return smooth.reshape(self.batch, channels, frames).transpose(1, 2)

    def own(self, drawn: Tensor) -> Tensor:
        """The rows of these B items from numbers that were drawn for the whole batch."""
        part = self.part
        return drawn if part is None else drawn[part.first : part.first + part.count]


def smoothed_motion(values: Float[Tensor, "B T C"], deviation: float) -> Float[Tensor, "B T C"]:
    """Values smoothed over time by a Gaussian of standard deviation `deviation` (frames).

    The kernel ends at three deviations; the first and last frame are replicated beyond the ends.
    """
    reach = int(3 * deviation)
    time = torch.arange(-reach, reach + 1).to(values)
    kernel = torch.exp(-0.5 * (time / deviation) ** 2)
    kernel = (kernel / kernel.sum())[None, None]
    padded = torch.nn.functional.pad(values.mT, (reach, reach), mode="replicate")
    smooth = torch.nn.functional.conv1d(padded.flatten(0, 1)[:, None], kernel)
    return smooth.reshape(len(values), values.shape[2], -1).mT
