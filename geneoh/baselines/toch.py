"""A baseline after TOCH (Zhou et al., ECCV 2022): a recurrent autoencoder of object-centric fields.

As in TOCH, the hand is described at points of the object's surface. A PointNet encodes each frame,
a recurrent network joins the frames, a bottleneck holds one latent for each, and a decoder gives
the hand around each object point. TOCH's field holds the distance along the normal and the place on
the hand that a ray from the object point hits. Ours holds relations to the 21 keypoints, at the
contact points and trained on the data of the cleaner. It follows the idea of TOCH, not the authors'
code, and says nothing about their figures. It is part of `geneoh eval`, not of the cleaner.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.baselines.features import RELATION_FEATURES, Observation, relation_features
from geneoh.denoisers.base import HAND_SCALE
from geneoh.nn.blocks import mlp
from geneoh.nn.sizes import NetworkConfig
from geneoh.representation.spatial import SpatialRelations, decode_spatial
from geneoh.sequence.keypoints import palm_axes


@dataclass(frozen=True)
class TochConfig(NetworkConfig):
    """Size of the network."""

    point_width: int = 64
    hidden: int = 96  # width of the recurrent layer in each direction of time
    latent: int = 64  # numbers per frame in the bottleneck


class TochAutoencoder(nn.Module):
    """Noisy fields of a window to clean keypoints, through one latent per frame."""

    def __init__(self, config: TochConfig) -> None:
        super().__init__()
        self.config = config
        point, hidden = config.point_width, config.hidden
        self.encode_point = mlp(RELATION_FEATURES, point, point)
        self.recurrent = nn.GRU(2 * point, hidden, batch_first=True, bidirectional=True)
        self.to_latent = nn.Linear(2 * hidden, config.latent)
        self.decode_point = mlp(config.latent + 6, 2 * point, 63)

    def forward(
        self, observation: Observation, relations: SpatialRelations
    ) -> Float[Tensor, "B T 21 3"]:
        """The clean keypoints behind the relations of a noisy hand, canonical frame, metres.

        Of the observation only the mean direction of the palm is used.
        """
        axes = palm_axes(observation.joints)
        relations = relations.turned(axes)
        features = relation_features(relations)
        each = self.encode_point(features)
        frames, _ = self.recurrent(torch.cat([each.mean(2), each.amax(2)], dim=-1))
        latent = self.to_latent(frames)[:, :, None].expand(-1, -1, each.shape[2], -1)
        offsets = self.decode_point(torch.cat([latent, features[..., :6]], dim=-1))
        offsets = HAND_SCALE * offsets.unflatten(-1, (21, 3))
        hands = relations.points[..., None, :] + offsets
        hand = decode_spatial(replace(relations, hands=hands))
        return hand @ axes[:, None].transpose(-1, -2)
