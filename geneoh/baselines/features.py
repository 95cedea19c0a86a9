"""What the baselines read: the noisy hand, and its relations to the contact points."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.denoisers.base import HAND_SCALE, NOISE_SCALE
from geneoh.denoisers.motion import jitter_of
from geneoh.denoisers.relations import contact_features
from geneoh.hand.skeleton import bone_lengths
from geneoh.representation.spatial import SpatialRelations

OBSERVATION_FEATURES = 63 + 60 + 63 + 21 + 20 + 1  # width of `Observation.features`
RELATION_FEATURES = 6 + 63 + 42  # width of `relation_features`


@dataclass(frozen=True)
class Observation(Bundle):
    """The noisy hand."""

    joints: Float[Tensor, "B T 21 3"]  # keypoints in the canonical frame, metres, gaps filled
    trust: Float[Tensor, "B T 21"]  # 0 where a keypoint was filled in, else its confidence, <= 1

    def turned(self, axes: Float[Tensor, "B 3 3"]) -> "Observation":
        """The same observation in other axes, given as columns."""
        return replace(self, joints=self.joints @ axes[:, None])

    def features(self) -> Float[Tensor, "B T F"]:
        """Network input per frame: position, pose, jitter, trust, bone lengths, and a one."""
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
    """Each contact point's position and normal (6), then how the hand lies around it."""
    offsets = relations.offsets.flatten(-2) / HAND_SCALE
    place = [relations.points / HAND_SCALE, relations.normals]
    return torch.cat([*place, offsets, contact_features(relations)], dim=-1)
