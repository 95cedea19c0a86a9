"""TemporalDiff in the paper's form: a denoiser of the latent of temporal relations (paper C.5).

As in the paper, a PointNet over the contact points of each frame pair and a transformer over pairs
encode the relations T, a fully connected layer decodes them, and the diffusion runs on the latent.
Ours: the layer decodes keypoint positions and velocities, from which all statistics follow and so
agree with each other. Before training, the latent is these positions (by trilateration from the
distances) and velocities; the network learns a residual.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import HAND_SCALE
from geneoh.diffusion.precondition import preconditioned
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, mlp, zeroed
from geneoh.representation.temporal import (
    PairStatistics,
    TemporalRelations,
    differences,
    pair_statistics,
    places_by_distance,
)

SPEED_SCALE = 0.2  # typical relative speed near contact, m/s
HAND_NUMBERS = 2 * 63  # positions and velocities of 21 keypoints


@dataclass(frozen=True)
class LatentConfig(NetworkConfig):
    """Size of the autoencoder and of the latent denoiser."""

    latent: int = 128  # from `HAND_NUMBERS` on, the untrained autoencoder is exact
    point_width: int = 96
    encoder_depth: int = 1
    width: int = 160
    depth: int = 4
    heads: int = 4


class TemporalAutoencoder(nn.Module):
    """Encodes the relations T to one latent per frame pair; decodes it at any contact points."""

    def __init__(self, config: LatentConfig) -> None:
        """Build encoder and decoder; latent statistics are buffers set after training."""
        super().__init__()
        point, width = config.point_width, config.width
        self.encode_point = mlp(3 + 6 + 21 * 7, point, point)
        self.embed = nn.Linear(2 * point + HAND_NUMBERS, width)
        self.trunk = FrameTransformer(width, config.encoder_depth, config.heads)
        self.to_latent = zeroed(nn.Linear(width, config.latent))
        self.from_hand = nn.Linear(HAND_NUMBERS, config.latent)
        self.to_hand = nn.Linear(config.latent, HAND_NUMBERS)
        for layer in (self.from_hand, self.to_hand):  # the identity before training
            nn.init.eye_(layer.weight)
            nn.init.zeros_(layer.bias)
        self.latent_mean: Tensor
        self.latent_std: Tensor
        self.register_buffer("latent_mean", torch.zeros(config.latent))
        self.register_buffer("latent_std", torch.ones(config.latent))

    def encode(
        self, relations: TemporalRelations, points: Float[Tensor, "B T K 3"]
    ) -> Float[Tensor, "B T Z"]:
        """Whitened latent of each frame pair; `points` are the canonical contact points."""
        near = torch.exp(-relations.distance / HAND_SCALE)
        features = torch.cat(
            [
                relations.object_velocity / SPEED_SCALE,
                relations.normals,
                points / HAND_SCALE,
                relations.distance / HAND_SCALE,
                near,
                relations.tangential / SPEED_SCALE,
                relations.normal / SPEED_SCALE,
                (relations.velocity / SPEED_SCALE).flatten(-2),
            ],
            dim=-1,
        )
        each = self.encode_point(features)
        places = places_by_distance(relations.distance, points) / HAND_SCALE
        moving = (relations.velocity + relations.object_velocity[..., None, :]).mean(2)
        hand = torch.cat([places.flatten(-2), moving.flatten(-2) / SPEED_SCALE], dim=-1)
        pooled = torch.cat([each.mean(2), each.amax(2), hand], dim=-1)
        tokens = self.trunk(self.embed(pooled), features.new_zeros(len(features)))
        latent = self.from_hand(hand) + self.to_latent(tokens)
        return (latent - self.latent_mean) / self.latent_std

    def decode(
        self,
        latent: Float[Tensor, "B T Z"],
        object_velocity: Float[Tensor, "B T K 3"],
        normals: Float[Tensor, "B T K 3"],
        points: Float[Tensor, "B T K 3"],
    ) -> PairStatistics:
        """Pair statistics at contact points of known velocity, normal and position."""
        latent = latent * self.latent_std + self.latent_mean
        places, velocity = self.to_hand(latent).unflatten(-1, (2, 21, 3)).unbind(-3)
        return pair_statistics(
            differences(places * HAND_SCALE, points),
            differences(velocity * SPEED_SCALE, object_velocity),
            normals,
        )


class LatentDenoiser(nn.Module):
    """The autoencoder with a transformer over frame pairs that denoises its latent."""

    def __init__(self, config: LatentConfig) -> None:
        """Build autoencoder and latent denoiser; the denoiser's last layers start at zero."""
        super().__init__()
        self.config = config
        self.autoencoder = TemporalAutoencoder(config)
        self.embed = nn.Linear(config.latent, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, config.latent))
        self.gate = zeroed(nn.Linear(config.width, config.latent))

    def forward(
        self, x: Float[Tensor, "B T Z"], sigma: Float[Tensor, " B"]
    ) -> Float[Tensor, "B T Z"]:
        """The clean whitened latent, predicted from `x` = clean + sigma * noise."""

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            tokens = self.trunk(self.embed(scaled), level.flatten())
            return self.head(tokens) + self.gate(tokens) * scaled

        sigma = sigma[:, None, None]
        return preconditioned(network, x, torch.zeros_like(x), sigma, torch.ones_like(sigma))
