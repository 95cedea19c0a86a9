"""The object and its contact map as tokens of the interaction network."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.bundle import spread
from geneoh.generators.text2hoi.objects import CHANNELS, Objects
from geneoh.generators.text2hoi.pointnet import PointConfig, PointNet, pooled
from geneoh.representation.region import farthest_points

SUMMARY = 19
"""Numbers of `summary`."""


class ObjectTokens(nn.Module):
    """Features of the whole object, and of places on it with their neighbourhood (ours)."""

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
        """Features of the whole, and of so many places."""
        some = spread(contact.shape[1], min(self.count, contact.shape[1])).to(contact.device)
        objects, contact = objects.take(some, "P"), contact[:, some]
        given = torch.cat([objects.channels, contact[..., None]], dim=-1)
        _, features = self.points(given)
        whole = self.whole(torch.cat([features.amax(1), summary(objects, contact)], dim=-1))
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
        """Features of the whole, and no places."""
        some = spread(contact.shape[1], self.count).to(contact.device)
        _, features = self.points(objects.normalised[:, some])
        told = [features.amax(1), contact[:, some], objects.scale, objects.centroid]
        whole = self.whole(torch.cat(told, dim=-1))
        return whole, whole.new_zeros(len(whole), 0, whole.shape[-1])


def summary(objects: Objects, contact: Float[Tensor, "B P"]) -> Float[Tensor, "B 19"]:
    """Size and centroid, how parts move, and where and how much the object is touched (dm)."""
    share = contact / contact.sum(1, keepdim=True).clamp(min=1e-3)
    place = (share[..., None] * objects.points).sum(1)
    normal = (share[..., None] * objects.normals).sum(1)
    touched = contact.mean(1, keepdim=True)
    size = [10 * objects.scale, 10 * objects.centroid]
    return torch.cat([*size, objects.motion, 10 * place, normal, touched], dim=-1)
