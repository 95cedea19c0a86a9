"""The trained baselines of `geneoh eval`: one call predicts clean keypoints, without diffusion.

`TochAutoencoder` is after TOCH (Zhou et al., ECCV 2022), which also describes the hand at points of
the object's surface. TOCH's field holds the distance along the normal and the point of the hand
that a ray from the object point hits. Ours holds relations of contact points to the 21 keypoints,
and is trained on the data of the cleaner. It follows the idea of TOCH, not the authors' code, so
its results say nothing about theirs.

`RegressionDenoiser` is after "w/o Diffusion" (paper, section 5 and C.4: an autoencoder for each of
J, S and T, and a fit to all three). It gets J and S together.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.choices import BaselineName
from geneoh.denoisers.base import HAND_SCALE, NOISE_SCALE
from geneoh.denoisers.motion import jitter_of
from geneoh.denoisers.relations import contact_features
from geneoh.hand.skeleton import bone_lengths
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, mlp, zeroed
from geneoh.nn.weights import file_or_shipped, load_network
from geneoh.representation.spatial import SpatialRelations, decode_spatial
from geneoh.sequence.keypoints import palm_axes

OBSERVATION_FEATURES = 63 + 60 + 63 + 21 + 20 + 1  # width of `Observation.features`
RELATION_FEATURES = 6 + 63 + 42  # width of `relation_features`


@dataclass(frozen=True)
class Observation(Bundle):
    """The noisy hand as a network sees it."""

    joints: Float[Tensor, "B T 21 3"]  # keypoints in the canonical frame, metres, gaps filled
    trust: Float[Tensor, "B T 21"]  # 0 where a keypoint was filled in, else its confidence, <= 1

    def turned(self, axes: Float[Tensor, "B 3 3"]) -> "Observation":
        """The same observation in the rotated frame whose axes are the columns of `axes`."""
        return replace(self, joints=self.joints @ axes[:, None])

    def features(self) -> Float[Tensor, "B T F"]:
        """Features per frame: position, pose, jitter, trust, bone lengths, and a constant 1."""
        joints, wrist = self.joints, self.joints[:, :, :1]
        bones = bone_lengths(joints).median(dim=1, keepdim=True).values
        parts = [
            (joints / HAND_SCALE).flatten(2),
            ((joints - wrist)[:, :, 1:] / 0.04).flatten(2),
            jitter_of(joints.flatten(2)) / NOISE_SCALE,
            self.trust,
            ((bones - 0.03) / 0.03).expand(-1, joints.shape[1], -1),
            torch.ones_like(self.trust[..., :1]),
        ]
        return torch.cat(parts, dim=-1)


def relation_features(relations: SpatialRelations) -> Float[Tensor, "B T K F"]:
    """Features per contact point: position, normal, offsets to the keypoints, closeness, height."""
    offsets = relations.offsets.flatten(-2) / HAND_SCALE
    place = [relations.points / HAND_SCALE, relations.normals]
    return torch.cat([*place, offsets, contact_features(relations)], dim=-1)


@dataclass(frozen=True)
class RegressionConfig(NetworkConfig):
    """Size of the network; its transformer has one token per frame."""

    width: int = 96
    depth: int = 3
    heads: int = 4
    point_width: int = 48


class RegressionDenoiser(nn.Module):
    """Noisy keypoints to clean ones: a PointNet over contact points, a transformer over frames."""

    def __init__(self, config: RegressionConfig) -> None:
        """Build the network; its last layer is zero, so that it starts as the identity."""
        super().__init__()
        self.config = config
        self.encode_point = mlp(RELATION_FEATURES, config.point_width, config.point_width)
        self.embed = nn.Linear(2 * config.point_width + OBSERVATION_FEATURES, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, 63))

    def forward(
        self, observation: Observation, relations: SpatialRelations
    ) -> Float[Tensor, "B T 21 3"]:
        """The predicted clean keypoints in the canonical frame, metres."""
        axes = palm_axes(observation.joints)
        turned = observation.turned(axes)
        each = self.encode_point(relation_features(relations.turned(axes)))
        pooled = torch.cat([each.mean(2), each.amax(2)], dim=-1)
        tokens = self.embed(torch.cat([pooled, turned.features()], dim=-1))
        tokens = self.trunk(tokens, tokens.new_zeros(len(tokens)))
        change = NOISE_SCALE * self.head(tokens).unflatten(-1, (21, 3))
        return (turned.joints + change) @ axes[:, None].transpose(-1, -2)


@dataclass(frozen=True)
class TochConfig(NetworkConfig):
    """Size of the network."""

    point_width: int = 64
    hidden: int = 96  # width of the recurrent layer in each direction of time
    latent: int = 64  # numbers per frame in the bottleneck


class TochAutoencoder(nn.Module):
    """Relations of a noisy hand in a window to clean keypoints, through one latent per frame."""

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
        """The predicted clean keypoints in the canonical frame, metres.

        Of the observation, only the mean palm axes are used.
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


SHIPPED = Path(__file__).parent / "assets"  # NAME.safetensors inside the package
BASELINES: tuple[BaselineName, ...] = get_args(BaselineName)

Baseline = TochAutoencoder | RegressionDenoiser


def baseline_weights(name: BaselineName, folder: Path | None) -> Path:
    """The weights file of a baseline: in the user's folder if it has one, else the shipped one."""
    return file_or_shipped(name, folder, SHIPPED)


def load_baseline(name: BaselineName, folder: Path | None = None) -> Baseline:
    """The network of a baseline, with the weights in `folder` or, by default, the shipped ones."""
    path = (folder or SHIPPED) / f"{name}.safetensors"
    if name == "toch":
        return load_network(path, TochAutoencoder, TochConfig)
    return load_network(path, RegressionDenoiser, RegressionConfig)
