"""The baseline "w/o Diffusion": regression of the clean keypoints from the same representation.

Its input is that of MotionDiff and SpatialDiff together: the observed trajectory and its relations
to the contact points. One call of the network gives the clean keypoints, without any diffusion
noise. It is part of `geneoh eval`, not of the cleaner. Source: paper, section 4.4 (ablation of the
diffusion), which uses an autoencoder in its place.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.baselines.features import (
    OBSERVATION_FEATURES,
    RELATION_FEATURES,
    Observation,
    relation_features,
)
from geneoh.denoisers.base import NOISE_SCALE
from geneoh.nn.blocks import FrameTransformer, mlp, zeroed
from geneoh.nn.sizes import NetworkConfig
from geneoh.representation.spatial import SpatialRelations
from geneoh.sequence.keypoints import palm_axes


@dataclass(frozen=True)
class RegressionConfig(NetworkConfig):
    """Size of the network, whose transformer has one token per frame."""

    width: int = 96
    depth: int = 3
    heads: int = 4
    point_width: int = 48


class RegressionDenoiser(nn.Module):
    """Noisy keypoints to clean ones: a PointNet over contact points, a transformer over frames."""

    def __init__(self, config: RegressionConfig) -> None:
        """Build the network; its last layer is zero, so that untrained it changes nothing."""
        super().__init__()
        self.config = config
        self.encode_point = mlp(RELATION_FEATURES, config.point_width, config.point_width)
        self.embed = nn.Linear(2 * config.point_width + OBSERVATION_FEATURES, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, 63))

    def forward(
        self, observation: Observation, relations: SpatialRelations
    ) -> Float[Tensor, "B T 21 3"]:
        """The clean keypoints behind an observation, canonical frame, metres."""
        axes = palm_axes(observation.joints)
        turned = observation.turned(axes)
        each = self.encode_point(relation_features(relations.turned(axes)))
        pooled = torch.cat([each.mean(2), each.amax(2)], dim=-1)
        tokens = self.embed(torch.cat([pooled, turned.features()], dim=-1))
        tokens = self.trunk(tokens, tokens.new_zeros(len(tokens)))
        change = NOISE_SCALE * self.head(tokens).unflatten(-1, (21, 3))
        return (turned.joints + change) @ axes[:, None].transpose(-1, -2)
