"""SpatialDiff in the paper's form, on relations (3.2; appendices A.2, C.4, C.5).

Every contact point predicts the offsets of all keypoints, and eq. (8) averages the hands of all
points. Unlike in the paper, the points of a frame exchange information, through the mean of their
hands and a pooled token: the network can distinguish front and back of a finger, and the cost of
the transformer depends on the number of frames only.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import HAND_SCALE, VERSIONS, window_size, with_low_passed
from geneoh.diffusion.precondition import preconditioned
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, mlp, zeroed
from geneoh.representation.spatial import SpatialRelations, decode_spatial
from geneoh.representation.window_scale import WindowScale
from geneoh.sequence.keypoints import palm_axes

CONTACT_SCALE = 0.02  # distance over which the closeness features decay, metres


@dataclass(frozen=True)
class RelationConfig(NetworkConfig):
    """Size of the network; one token per frame, one small MLP per contact point."""

    width: int = 160
    depth: int = 4
    heads: int = 4
    point_width: int = 96


def contact_features(relations: SpatialRelations) -> Float[Tensor, "B T K 42"]:
    """Closeness of each keypoint to each contact point, and its signed height over the surface
    there in cm, decaying with distance."""
    offsets = relations.offsets
    near = torch.exp(-offsets.norm(dim=-1) / CONTACT_SCALE)
    height = (offsets * relations.normals[..., None, :]).sum(-1) * near / 0.01
    return torch.cat([near, height], dim=-1)


class RelationDenoiser(nn.Module):
    """Maps noisy to clean offsets: an MLP per contact point before and after a transformer over
    frames."""

    def __init__(self, config: RelationConfig) -> None:
        """Build the network; its last layers start at zero, which leaves the skip path alone."""
        super().__init__()
        self.config = config
        width, point = config.width, config.point_width
        self.encode_point = mlp(6 + 2 * 42 + 63, point, point)
        self.embed = nn.Linear(2 * point + 63 * VERSIONS + 1, width)
        self.trunk = FrameTransformer(width, config.depth, config.heads)
        self.decode_point = mlp(width + point, width, 63)
        zeroed(self.decode_point[-1])
        self.gate = zeroed(nn.Linear(width, 63))
        self.mix = zeroed(nn.Linear(width, 63 * VERSIONS))

    def forward(
        self, noisy: SpatialRelations, sigma: Float[Tensor, " B"], scale: WindowScale
    ) -> SpatialRelations:
        """The clean relations, from `noisy` = clean + sigma * noise, canonical frame, metres; the
        noise may differ per point. `sigma` is in units of `scale.deviation`."""
        middle = decode_spatial(noisy)
        axes = palm_axes(middle)  # makes the output rotation equivariant
        turned = axes[:, None, None]
        relations, mean = noisy.turned(axes), scale.mean @ turned
        place = [(relations.points - mean[..., 0, :]) / HAND_SCALE, relations.normals]
        together = contact_features(relations.of_hand(middle @ axes[:, None]))
        fixed = torch.cat([*place, together, contact_features(relations)], dim=-1)
        size = window_size(scale.deviation.flatten(), middle.shape[1])

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            each = self.encode_point(torch.cat([fixed, scaled.flatten(-2)], dim=-1))
            pooled = torch.cat([each.mean(2), each.amax(2)], dim=-1)
            means = with_low_passed(scaled.mean(2).flatten(-2))
            tokens = self.embed(torch.cat([pooled, means.flatten(2), size], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            around = tokens[:, :, None].expand(-1, -1, scaled.shape[2], -1)
            own = self.decode_point(torch.cat([around, each], dim=-1)).unflatten(-1, (21, 3))
            gate = self.gate(tokens).unflatten(-1, (21, 3))[:, :, None]
            mixed = (self.mix(tokens).unflatten(-1, means.shape[2:]) * means).sum(2)
            return own + gate * scaled + mixed.unflatten(-1, (21, 3))[:, :, None]

        sigma = sigma.view(-1, 1, 1, 1, 1) * scale.deviation
        clean = preconditioned(network, relations.hands, mean, sigma, scale.deviation)
        return replace(noisy, hands=clean @ turned.mT)
