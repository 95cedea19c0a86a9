"""The scale of features in the data, which is stored with the weights of each network."""

from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

Scaling = Literal["deviation", "range"]
"""What features are scaled by: their deviation, all of them; or the range of positions, to -1 to 1,
with rotations left as they are (paper's code)."""
LEAST = (0.005, 0.02)
"""Deviations of a position (metres) and of a rotation's entry below these count as this large."""


class Scale(nn.Module):
    """Features to numbers of about unit size, and back."""

    middle: Tensor
    size: Tensor

    def __init__(self, features: int) -> None:
        """Leave features as they are until `fit`; a third of them are positions, as always."""
        super().__init__()
        self.register_buffer("middle", torch.zeros(features))
        self.register_buffer("size", torch.ones(features))

    def normalise(self, features: Float[Tensor, "*B N"]) -> Float[Tensor, "*B N"]:
        """Features as numbers."""
        return (features - self.middle) / self.size

    def denormalise(self, numbers: Float[Tensor, "*B N"]) -> Float[Tensor, "*B N"]:
        """Inverse of `normalise`."""
        return numbers * self.size + self.middle

    @torch.no_grad()
    def fit(
        self, features: Float[Tensor, "B T N"], real: Bool[Tensor, "B T"], scaling: Scaling
    ) -> None:
        """Take the scale of those frames of the data that are real."""
        seen = features[real]
        positions = torch.arange(len(self.middle)) < len(self.middle) // 3
        least = torch.where(positions, *torch.tensor(LEAST))
        if scaling == "deviation":
            self.middle.copy_(seen.mean(0))
            self.size.copy_(torch.maximum(seen.std(0, unbiased=False), least))
            return
        low, high = seen.amin(0), seen.amax(0)
        self.middle.copy_(((low + high) / 2) * positions)
        size = torch.maximum((high - low) / 2, least)
        self.size.copy_(torch.where(positions, size, torch.ones_like(size)))
