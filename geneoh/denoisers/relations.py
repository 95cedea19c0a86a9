"""SpatialDiff in the paper's form, on relations (3.2; appendices A.2, C.4, C.5).

Every contact point predicts the offsets of a whole hand from its position, normal and noisy
offsets, and eq. (8) averages them. Unlike in the paper, the points of a frame exchange information
through a pooled token: a finger's front and back can be told apart, and frames alone cost.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import HAND_SCALE, OBSERVATION_FEATURES, Observation
from geneoh.diffusion.precondition import preconditioned
from geneoh.nn.blocks import FrameTransformer, mlp, zeroed
from geneoh.representation.spatial import SpatialRelations

CONTACT_SCALE = 0.02  # distance over which the closeness features decay, metres
RELATION_FEATURES = 6 + 63 + 42  # width of `relation_features`


@dataclass(frozen=True)
class RelationConfig:
    """Size of the network; one token per frame, one small MLP per contact point."""

    width: int = 160
    depth: int = 4
    heads: int = 4
    point_width: int = 96


def contact_features(relations: SpatialRelations) -> Float[Tensor, "B T K 42"]:
    """Closeness of each keypoint to each point, and its signed height over the surface there."""
    offsets = relations.offsets
    near = torch.exp(-offsets.norm(dim=-1) / CONTACT_SCALE)
    height = (offsets * relations.normals[..., None, :]).sum(-1) * near / 0.01
    return torch.cat([near, height], dim=-1)


def relation_features(relations: SpatialRelations) -> Float[Tensor, "B T K F"]:
    """Each contact point's position and normal (6), then how the hand lies around it."""
    offsets = relations.offsets.flatten(-2) / HAND_SCALE
    place = [relations.points / HAND_SCALE, relations.normals]
    return torch.cat([*place, offsets, contact_features(relations)], dim=-1)


class RelationDenoiser(nn.Module):
    """A network per contact point around a transformer over frames: noisy to clean offsets."""

    def __init__(self, config: RelationConfig) -> None:
        """Build the network; its last layers start at zero, so it starts as the skip path."""
        super().__init__()
        self.config = config
        width, point = config.width, config.point_width
        self.encode_point = mlp(RELATION_FEATURES + 42 + 63, point, point)
        self.embed = nn.Linear(2 * point + 63 + OBSERVATION_FEATURES, width)
        self.trunk = FrameTransformer(width, config.depth, config.heads)
        self.decode_point = mlp(width + point, width, 63)
        zeroed(self.decode_point[-1])
        self.gate = zeroed(nn.Linear(width, 63))

    def forward(
        self, noisy: SpatialRelations, sigma: Float[Tensor, " B"], observation: Observation
    ) -> SpatialRelations:
        """The clean relations in `noisy` = clean + sigma * noise, canonical frame, metres.

        The noise may differ per point, and the observation is given or withheld per batch item.
        """
        axes = observation.palm()
        observation, relations = observation.turned(axes), noisy.turned(axes)
        frame_features = observation.features()
        observed = relations.of_hand(observation.anchor)
        place, seen = relation_features(observed).split([6, RELATION_FEATURES - 6], dim=-1)
        fixed = [place, seen * observation.mask, contact_features(relations)]

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            each = self.encode_point(torch.cat([*fixed, scaled.flatten(-2)], dim=-1))
            pooled = torch.cat([each.mean(2), each.amax(2)], dim=-1)
            mean = scaled.mean(2).flatten(-2)
            tokens = self.embed(torch.cat([pooled, mean, frame_features], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            around = tokens[:, :, None].expand(-1, -1, scaled.shape[2], -1)
            out = self.decode_point(torch.cat([around, each], dim=-1)).unflatten(-1, (21, 3))
            # the gate scales the sample itself: how far this input's observation is to be trusted
            return out + self.gate(tokens).unflatten(-1, (21, 3))[:, :, None] * scaled

        sigma, scale = (level.view(-1, 1, 1, 1, 1) for level in (sigma, observation.scale))
        clean = preconditioned(network, relations.hands, observed.hands, sigma, scale)
        return replace(noisy, hands=clean @ axes[:, None, None].mT)
