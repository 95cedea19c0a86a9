"""PointNet: features of the points of a surface and of the surface as a whole.

Source: Qi et al. 2017; Text2HOI, supplement, table of the contact network. Ours: features are
normalised for each point, where the paper normalises over the batch, so that a clip does not
depend on the others of its batch, which several processes may divide.
"""

from dataclasses import dataclass
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.nn.blocks import zeroed
from geneoh.nn.sizes import NetworkConfig


@dataclass(frozen=True)
class PointConfig(NetworkConfig):
    """Size of a PointNet (defaults: ours; the paper has 64, 128, 1024 and turns its points)."""

    near: int = 48  # features of each point after the first layer
    middle: int = 96
    whole: int = 192  # features of the surface
    turned: bool = False  # whether points are first mapped by a matrix that is made from them


class PointNet(nn.Module):
    """Layers on each point, and the largest value of each feature over all points."""

    def __init__(self, channels: int, config: PointConfig) -> None:
        """Build a network that reads so many numbers of each point."""
        super().__init__()
        self.turn = PointTurn(channels, config) if config.turned else None
        self.first = layer(channels, config.near)
        self.middle = layer(config.near, config.middle)
        self.last = nn.Sequential(
            nn.Linear(config.middle, config.whole), nn.LayerNorm(config.whole)
        )

    def forward(
        self, points: Float[Tensor, "B P C"]
    ) -> tuple[Float[Tensor, "B P N"], Float[Tensor, "B P W"]]:
        """Features of each point after the first layer, and after the last one."""
        if self.turn is not None:
            points = self.turn(points)
        near = self.first(points)
        return near, self.last(self.middle(near))


class PointTurn(nn.Module):
    """A matrix for all points of a surface, the identity before training."""

    def __init__(self, channels: int, config: PointConfig) -> None:
        """Build a network that reads so many numbers of each point."""
        super().__init__()
        self.channels = channels
        widths = (channels, config.near, config.middle, config.whole)
        self.points = nn.Sequential(*(layer(a, b) for a, b in pairwise(widths)))
        half, quarter = config.whole // 2, config.whole // 4
        self.whole = nn.Sequential(
            layer(config.whole, half),
            layer(half, quarter),
            zeroed(nn.Linear(quarter, channels * channels)),
        )

    def forward(self, points: Float[Tensor, "B P C"]) -> Float[Tensor, "B P C"]:
        """The points in the axes that are chosen for them."""
        change = self.whole(self.points(points).amax(1)).unflatten(-1, (self.channels, -1))
        return points + points @ change


def layer(before: int, after: int) -> nn.Sequential:
    """A linear layer, normalised and rectified."""
    return nn.Sequential(nn.Linear(before, after), nn.LayerNorm(after), nn.ReLU())


def pooled(features: Float[Tensor, "B P W"], group: Tensor, count: int) -> Float[Tensor, "B K W"]:
    """The largest value of each feature over the points of each of `count` groups."""
    index = group[..., None].expand_as(features)
    start = features.new_full((len(features), count, features.shape[-1]), -torch.inf)
    found = start.scatter_reduce(1, index, features, "amax")
    return torch.where(found.isinf(), 0.0, found)
