"""PointNet: features of surface points and of the whole object, and tokens made from them.

Source: Qi et al. 2017; Text2HOI, supplement, table of the contact network. Ours: layer norm at each
point, where the paper has batch norm, so that a clip does not depend on the rest of its batch,
which several processes may divide.
"""

from dataclasses import dataclass
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.bundle import spread
from geneoh.generators.text2hoi.networks.objects import CHANNELS, Objects
from geneoh.nn.blocks import NetworkConfig, zeroed
from geneoh.representation.region import farthest_points

SUMMARY = 19
"""Number of features of `_summary`."""


@dataclass(frozen=True)
class PointConfig(NetworkConfig):
    """Size of a PointNet (defaults: ours; the paper has 64, 128, 1024 and a T-Net)."""

    near: int = 48  # features of each point after the first layer
    middle: int = 96
    whole: int = 192  # features of the surface
    turned: bool = False  # whether a matrix predicted from the points transforms them first (T-Net)


class PointNet(nn.Module):
    """Layers on each point with shared weights; callers pool over the points."""

    def __init__(self, channels: int, config: PointConfig) -> None:
        """Build a network for points with `channels` features."""
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
    """A predicted matrix that transforms all points of a surface; the identity before training."""

    def __init__(self, channels: int, config: PointConfig) -> None:
        """Build a network for points with `channels` features."""
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
        """The transformed points."""
        change = self.whole(self.points(points).amax(1)).unflatten(-1, (self.channels, -1))
        return points + points @ change


def layer(before: int, after: int) -> nn.Sequential:
    """A linear layer, normalised and rectified."""
    return nn.Sequential(nn.Linear(before, after), nn.LayerNorm(after), nn.ReLU())


def pooled(features: Float[Tensor, "B P W"], group: Tensor, count: int) -> Float[Tensor, "B K W"]:
    """The largest value of each feature over the points of each of `count` groups; 0 if empty."""
    index = group[..., None].expand_as(features)
    start = features.new_full((len(features), count, features.shape[-1]), -torch.inf)
    found = start.scatter_reduce(1, index, features, "amax")
    return torch.where(found.isinf(), 0.0, found)


class ObjectTokens(nn.Module):
    """A token of the whole object, and tokens of places on it with their neighbourhoods (ours)."""

    def __init__(self, points: PointConfig, width: int, count: int, places: int) -> None:
        """Build the networks, for `count` points and tokens of `width` features."""
        super().__init__()
        self.count, self.places = count, places
        self.points = PointNet(CHANNELS + 1, points)
        self.whole = nn.Linear(points.whole + SUMMARY, width)
        self.place = nn.Linear(points.whole + 7, width)

    def forward(
        self, objects: Objects, contact: Float[Tensor, "B P"]
    ) -> tuple[Float[Tensor, "B D"], Float[Tensor, "B K D"]]:
        """Tokens of the whole object, and of at most `places` farthest points of it."""
        some = spread(contact.shape[1], min(self.count, contact.shape[1])).to(contact.device)
        objects, contact = objects.take(some, "P"), contact[:, some]
        channels = torch.cat([objects.channels, contact[..., None]], dim=-1)
        _, features = self.points(channels)
        whole = self.whole(torch.cat([features.amax(1), _summary(objects, contact)], dim=-1))
        kept = min(self.places, len(some))
        points, everywhere = objects.points, torch.ones_like(contact, dtype=torch.bool)
        first = torch.zeros_like(contact[:, 0], dtype=torch.long)
        chosen = farthest_points(points, everywhere, first, kept)[..., None].expand(-1, -1, 3)
        centre = points.gather(1, chosen)
        group = torch.cdist(points, centre).argmin(-1)
        around = pooled(features, group, kept)
        touched = pooled(contact[..., None], group, kept)
        place = [around, 10 * centre, objects.normals.gather(1, chosen), touched]
        return whole, self.place(torch.cat(place, dim=-1))


class WholeObject(nn.Module):
    """The paper's condition: features of the points, contact map, scale and centroid (code)."""

    def __init__(self, points: PointConfig, width: int, count: int) -> None:
        """Build the networks, for `count` points and a token of `width` features."""
        super().__init__()
        self.count = count
        self.points = PointNet(3, points)
        self.whole = nn.Linear(points.whole + count + 4, width)

    def forward(
        self, objects: Objects, contact: Float[Tensor, "B P"]
    ) -> tuple[Float[Tensor, "B D"], Float[Tensor, "B 0 D"]]:
        """Tokens of the whole object, and none of places."""
        some = spread(contact.shape[1], self.count).to(contact.device)
        _, features = self.points(objects.normalised[:, some])
        parts = [features.amax(1), contact[:, some], objects.scale, objects.centroid]
        whole = self.whole(torch.cat(parts, dim=-1))
        return whole, whole.new_zeros(len(whole), 0, whole.shape[-1])


def _summary(objects: Objects, contact: Float[Tensor, "B P"]) -> Float[Tensor, "B 19"]:
    """Size, centroid, joint, and mean position, normal and share of contact; lengths in dm."""
    share = contact / contact.sum(1, keepdim=True).clamp(min=1e-3)
    place = (share[..., None] * objects.points).sum(1)
    normal = (share[..., None] * objects.normals).sum(1)
    touched = contact.mean(1, keepdim=True)
    size = [10 * objects.scale, 10 * objects.centroid]
    return torch.cat([*size, objects.motion, 10 * place, normal, touched], dim=-1)
