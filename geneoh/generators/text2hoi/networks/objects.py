"""Objects as the networks of Text2HOI see them: points, parts and joint, and tokens made of these.

A PointNet computes features of the surface points and of the whole object. Source: Qi et al. 2017;
Text2HOI, supplement, table of the contact network. Ours: layer norm at each point, where the paper
has batch norm, so that a clip does not depend on the rest of its batch, which several processes may
divide.
"""

from dataclasses import dataclass, fields, replace
from itertools import pairwise

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from geneoh.bundle import Bundle, spread
from geneoh.generators.text2hoi.networks.tokens import tokens_of
from geneoh.nn.blocks import NetworkConfig, zeroed
from geneoh.representation.region import farthest_points
from geneoh.synthesis.actions.action import TOUCHED, Actions

CHANNELS = 10  # number of features of each point in `Objects.channels`
CONTACT_EVERY = 6  # step between the frames in which contact is measured
SUMMARY = 19  # number of features of `_summary`


@dataclass(frozen=True)
class Objects(Bundle):
    """B objects in their own frames (see `Actions`), metres, with the joint at 0."""

    points: Float[Tensor, "B P 3"]
    normals: Float[Tensor, "B P 3"]
    part: Int[Tensor, "B P"]
    axis: Float[Tensor, "B 3"]
    pivot: Float[Tensor, "B 3"]
    slides: Bool[Tensor, " B"]

    @classmethod
    def of(cls, actions: Actions) -> "Objects":
        """The objects of actions."""
        return cls(**{field.name: getattr(actions, field.name) for field in fields(cls)})

    @property
    def jointed(self) -> Bool[Tensor, " B"]:
        """Whether they have a second part."""
        return (self.part > 0).any(1)

    @property
    def centroid(self) -> Float[Tensor, "B 3"]:
        """Mean of the points."""
        return self.points.mean(1)

    @property
    def scale(self) -> Float[Tensor, "B 1"]:
        """Largest distance of a point from the centroid (paper, section 3.1), metres."""
        apart = (self.points - self.centroid[:, None]).norm(dim=-1)
        return apart.amax(1, keepdim=True)

    @property
    def normalised(self) -> Float[Tensor, "B P 3"]:
        """Points from the centroid in units of the scale."""
        return (self.points - self.centroid[:, None]) / self.scale[..., None]

    @property
    def channels(self) -> Float[Tensor, "B P 10"]:
        """Features of each point: normalised position, normal, part, and position in decimetres.

        The paper has the normalised position alone.
        """
        part = self.part[..., None].to(self.points)
        return torch.cat([self.normalised, self.normals, part, 10 * self.points], dim=-1)

    @property
    def motion(self) -> Float[Tensor, "B 8"]:
        """Features of the joint: whether there is one, whether it slides, axis, pivot (dm)."""
        flags = torch.stack([self.jointed, self.slides], dim=-1).to(self.points)
        return torch.cat([flags, self.axis, 10 * self.pivot * flags[:, :1]], dim=-1)


@torch.no_grad()
def contact_maps(actions: Actions) -> Bool[Tensor, "B P"]:
    """Points within `TOUCHED` of a keypoint of any hand that takes part, in any frame.

    Source: the code of Text2HOI. Ours: only every `CONTACT_EVERY`-th frame is used.
    """
    # clip by clip, so that all distances of a clip stay in the processor's cache
    return torch.cat([_near(actions.take(slice(i, i + 1), "B")) for i in range(len(actions.verb))])


def map_as_read(contact: Float[Tensor, "B P"], form: str) -> Float[Tensor, "B P"]:
    """A contact map as networks of a form read it: probabilities, or binary in the paper's form."""
    return (contact > 0.5).to(contact) if form == "paper" else contact


def _near(actions: Actions) -> Bool[Tensor, "B P"]:
    some = actions.take(slice(None, None, CONTACT_EVERY), "T")
    some = replace(some, length=(some.length + CONTACT_EVERY - 1) // CONTACT_EVERY)
    tokens = tokens_of(some)
    joints, shown = tokens.joints()[0], tokens.shown[0, :2]
    hands, frames = shown.nonzero(as_tuple=True)
    points = some.posed_points()[0, frames] if bool(tokens.jointed) else some.points
    apart = torch.cdist(points, joints[hands, frames].view(len(points), -1, 3))
    return (apart.amin(-1).amin(0) < TOUCHED)[None]


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
        if not kept:
            return whole, whole.new_zeros(len(whole), 0, whole.shape[-1])
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
