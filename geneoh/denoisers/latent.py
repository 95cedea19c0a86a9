"""TemporalDiff in the paper's form: a denoiser of the latent of temporal relations (paper C.5).

As in the paper, a PointNet over the contact points of each frame pair and a transformer over pairs
encode T, fully connected layers decode each statistic, and the diffusion runs on the latent.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import HAND_SCALE
from geneoh.diffusion.precondition import preconditioned
from geneoh.nn.blocks import FrameTransformer, mlp, zeroed
from geneoh.representation.temporal import PairStatistics, TemporalRelations

SPEED_SCALE = 0.2  # typical relative speed near contact, m/s
LATENT_NOISE_SCALE = 0.5
"""Deviation of a clean latent from the observed one, relative to the latent's own deviation."""


@dataclass(frozen=True)
class LatentConfig:
    """Size of the autoencoder and of the latent denoiser."""

    latent: int = 96
    point_width: int = 96
    encoder_depth: int = 1
    width: int = 160
    depth: int = 4
    heads: int = 4


class TemporalAutoencoder(nn.Module):
    """Encodes T to one latent per frame pair and decodes it around any contact points."""

    def __init__(self, config: LatentConfig) -> None:
        """Build encoder and decoder; latent statistics are buffers set after training."""
        super().__init__()
        self.config = config
        point, width = config.point_width, config.width
        self.encode_point = mlp(3 + 6 + 21 * 7, point, point)
        self.embed = nn.Linear(2 * point, width)
        self.trunk = FrameTransformer(width, config.encoder_depth, config.heads)
        self.to_latent = nn.Linear(width, config.latent)
        self.decode_point = mlp(config.latent + 9, width, width, 21 * 6)
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
                self._place(relations.object_velocity, relations.normals, points),
                relations.distance / HAND_SCALE,
                near,
                relations.tangential / SPEED_SCALE,
                relations.normal / SPEED_SCALE,
                (relations.velocity / SPEED_SCALE).flatten(-2),
            ],
            dim=-1,
        )
        each = self.encode_point(features)
        pooled = torch.cat([each.mean(2), each.amax(2)], dim=-1)
        tokens = self.trunk(self.embed(pooled), features.new_zeros(len(features)))
        return (self.to_latent(tokens) - self.latent_mean) / self.latent_std

    def decode(
        self,
        latent: Float[Tensor, "B T Z"],
        object_velocity: Float[Tensor, "B T K 3"],
        normals: Float[Tensor, "B T K 3"],
        points: Float[Tensor, "B T K 3"],
    ) -> PairStatistics:
        """Statistics around contact points of known velocity, normal and position."""
        latent = latent * self.latent_std + self.latent_mean
        place = self._place(object_velocity, normals, points)
        around = latent[:, :, None].expand(-1, -1, points.shape[2], -1)
        out = self.decode_point(torch.cat([around, place], dim=-1)).unflatten(-1, (21, 6))
        return PairStatistics(
            distance=out[..., 0] * HAND_SCALE,
            velocity=out[..., 3:] * SPEED_SCALE,
            tangential=out[..., 1] * SPEED_SCALE,
            normal=out[..., 2] * SPEED_SCALE,
        )

    @staticmethod
    def _place(velocity: Tensor, normals: Tensor, points: Tensor) -> Tensor:
        return torch.cat([velocity / SPEED_SCALE, normals, points / HAND_SCALE], dim=-1)


class LatentDenoiser(nn.Module):
    """The autoencoder with a transformer over frame pairs that denoises its latent."""

    def __init__(self, config: LatentConfig) -> None:
        """Build autoencoder and latent denoiser; the denoiser's last layers start at zero."""
        super().__init__()
        self.config = config
        self.autoencoder = TemporalAutoencoder(config)
        self.embed = nn.Linear(2 * config.latent + 1, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, config.latent))
        self.gate = zeroed(nn.Linear(config.width, config.latent))

    def forward(
        self,
        x: Float[Tensor, "B T Z"],
        sigma: Float[Tensor, " B"],
        observed: Float[Tensor, "B T Z"],
        given: Float[Tensor, " B"],
    ) -> Float[Tensor, "B T Z"]:
        """The clean latent in `x` = clean + sigma * noise, whitened; sees `observed` if `given`."""
        mask = given[:, None, None]
        anchor = observed * mask

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            shown = mask.expand(-1, x.shape[1], 1)
            tokens = self.embed(torch.cat([scaled, anchor, shown], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            return self.head(tokens) + self.gate(tokens) * scaled

        scale = torch.where(mask > 0, LATENT_NOISE_SCALE, 1.0)
        return preconditioned(network, x, anchor, sigma[:, None, None], scale)
