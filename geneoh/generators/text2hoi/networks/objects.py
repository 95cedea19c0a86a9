"""Objects as the networks of Text2HOI see them: surface points, parts and the joint."""

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.generators.text2hoi.networks.tokens import tokens_of
from geneoh.synthesis.actions.action import TOUCHED, Actions

CHANNELS = 10
"""Number of features of each point in `Objects.channels`."""
CONTACT_EVERY = 6  # step between the frames in which contact is measured


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


def _near(actions: Actions) -> Bool[Tensor, "B P"]:
    some = actions.take(slice(None, None, CONTACT_EVERY), "T")
    some = replace(some, length=(some.length + CONTACT_EVERY - 1) // CONTACT_EVERY)
    tokens = tokens_of(some)
    joints, shown = tokens.joints()[0], tokens.shown[0, :2]
    hands, frames = shown.nonzero(as_tuple=True)
    points = some.posed_points()[0, frames] if bool(tokens.jointed) else some.points
    apart = torch.cdist(points, joints[hands, frames].view(len(points), -1, 3))
    return (apart.amin(-1).amin(0) < TOUCHED)[None]
