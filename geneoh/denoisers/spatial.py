"""SpatialDiff: the denoiser of hand-object spatial relations (paper 3.2; appendices A.2, C.4, C.5).

Every contact point o predicts a whole hand around itself from its position, normal and offsets. As
in the paper each point has its own noise and its own hand, and eq. (8) averages them; unlike it,
points of a frame exchange what they see through a pooled token, so a finger's pads and back can be
told apart and cost grows with frames rather than with points times frames.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import FEATURES, HAND_SCALE, Observation
from geneoh.diffusion.precondition import denoised
from geneoh.nn.blocks import FrameTransformer, mlp, zeroed

CONTACT_SCALE = 0.02
"""Distance over which closeness to a contact point decays in the network's eyes, metres."""


@dataclass(frozen=True)
class SpatialConfig:
    """Size of the network; one token per frame, one small MLP per contact point."""

    width: int = 160
    depth: int = 4
    heads: int = 4
    point_width: int = 96


def contact_features(
    hands: Float[Tensor, "B T K 21 3"],
    points: Float[Tensor, "B T K 3"],
    normals: Float[Tensor, "B T K 3"],
) -> Float[Tensor, "B T K 42"]:
    """Closeness of each keypoint to each point, and its signed height over the surface there."""
    offsets = hands - points[..., None, :]
    near = torch.exp(-offsets.norm(dim=-1) / CONTACT_SCALE)
    height = (offsets * normals[..., None, :]).sum(-1) * near / 0.01
    return torch.cat([near, height], dim=-1)


class SpatialDenoiser(nn.Module):
    """Point MLPs around a transformer over frames: noisy offsets to clean offsets."""

    def __init__(self, config: SpatialConfig) -> None:
        """Build the network; its last layers start at zero."""
        super().__init__()
        self.config = config
        width, point = config.width, config.point_width
        self.encode_point = mlp(6 + 63 + 42 + 42 + 63, point, point)
        self.embed = nn.Linear(2 * point + 63 + FEATURES, width)
        self.trunk = FrameTransformer(width, config.depth, config.heads)
        self.decode_point = mlp(width + point, width, 63)
        zeroed(self.decode_point[-1])
        self.gate = zeroed(nn.Linear(width, 63))

    def forward(
        self,
        x: Float[Tensor, "B T K 21 3"],
        sigma: Float[Tensor, " B"],
        points: Float[Tensor, "B T K 3"],
        normals: Float[Tensor, "B T K 3"],
        observation: Observation,
    ) -> Float[Tensor, "B T K 21 3"]:
        """The clean hand around each contact point, canonical frame, metres.

        Args:
            x: noisy hands (offset plus contact point): clean + sigma * noise, one per point.
            sigma: noise level in metres.
            points: contact points in the canonical frame, with outward `normals`.
            observation: the hand to start from, or one withheld.
        """
        axes = observation.palm()
        observation = observation.turned(axes)
        points, normals, x = (
            points @ axes[:, None],
            normals @ axes[:, None],
            x @ axes[:, None, None],
        )
        frame_features = observation.features()
        anchor = observation.anchor[:, :, None].expand_as(x)
        seen = torch.cat(
            [
                (anchor - points[..., None, :]).flatten(-2) / HAND_SCALE,
                contact_features(anchor, points, normals),
            ],
            dim=-1,
        )
        fixed = torch.cat([points / HAND_SCALE, normals, seen * observation.mask], dim=-1)
        now = contact_features(x, points, normals)

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            each = self.encode_point(torch.cat([fixed, now, scaled.flatten(-2)], dim=-1))
            pooled = torch.cat([each.mean(2), each.amax(2)], dim=-1)
            mean = scaled.mean(2).flatten(-2)
            tokens = self.embed(torch.cat([pooled, mean, frame_features], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            around = tokens[:, :, None].expand(-1, -1, x.shape[2], -1)
            out = self.decode_point(torch.cat([around, each], dim=-1)).unflatten(-1, (21, 3))
            # the gate scales the sample itself: how far this input's observation is to be trusted
            return out + self.gate(tokens).unflatten(-1, (21, 3))[:, :, None] * scaled

        shape = (-1, 1, 1, 1, 1)
        scale = observation.scale.view(shape)
        clean = denoised(network, x, anchor, sigma.view(shape), scale)
        return clean @ axes[:, None, None].transpose(-1, -2)
