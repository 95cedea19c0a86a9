"""A baseline after TOCH (Zhou et al., ECCV 2022): a recurrent autoencoder of object-centric fields.

As in TOCH the hand is seen from the object's surface only, a PointNet encodes each frame, a
recurrent network joins the frames, everything passes a bottleneck, and the decoder answers around
the object's points; the hand is fitted to that. Unlike TOCH, whose field holds for each object
point the distance along its normal and the place on the hand that a ray hits, ours holds what our
data has, relations to the 21 keypoints, at the same contact points and trained on the same data as
the cleaner: written after the idea, not the authors' code, and no measure of their numbers. Part of
`geneoh eval`, not of the cleaner.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.baselines.regression import POINT_FEATURES, point_features
from geneoh.denoisers.base import HAND_SCALE, Observation
from geneoh.nn.blocks import mlp


@dataclass(frozen=True)
class TochConfig:
    """Size of the network."""

    point_width: int = 64
    hidden: int = 96
    """Width of the recurrent layer in each direction of time."""
    latent: int = 64
    """Numbers per frame in the bottleneck."""


class TochAutoencoder(nn.Module):
    """Noisy fields of a window to the clean hand, through one latent per frame."""

    def __init__(self, config: TochConfig) -> None:
        """Build encoder and decoder."""
        super().__init__()
        self.config = config
        point, hidden = config.point_width, config.hidden
        self.encode_point = mlp(POINT_FEATURES, point, point)
        self.recurrent = nn.GRU(2 * point, hidden, batch_first=True, bidirectional=True)
        self.to_latent = nn.Linear(2 * hidden, config.latent)
        self.decode_point = mlp(config.latent + 6, 2 * point, 63)

    def forward(
        self,
        observation: Observation,
        points: Float[Tensor, "B T K 3"],
        normals: Float[Tensor, "B T K 3"],
    ) -> Float[Tensor, "B T 21 3"]:
        """The clean keypoints behind an observation, canonical frame, metres.

        Args:
            observation: the noisy hand; beyond what the contact points see of it only the mean
                direction of its palm is used.
            points: contact points in the canonical frame, with outward `normals`.
        """
        axes = observation.palm()
        points, normals = points @ axes[:, None], normals @ axes[:, None]
        field = point_features(observation.joints @ axes[:, None], points, normals)
        each = self.encode_point(field)
        frames, _ = self.recurrent(torch.cat([each.mean(2), each.amax(2)], dim=-1))
        latent = self.to_latent(frames)[:, :, None].expand(-1, -1, points.shape[2], -1)
        place = torch.cat([points / HAND_SCALE, normals], dim=-1)
        offsets = self.decode_point(torch.cat([latent, place], dim=-1)).unflatten(-1, (21, 3))
        hand = (points[..., None, :] + HAND_SCALE * offsets).mean(2)
        return hand @ axes[:, None].transpose(-1, -2)
