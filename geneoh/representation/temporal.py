"""T: hand-object temporal relations of every contact point and frame pair (paper 3.1, eq. 1)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.representation.region import ContactRegion

DISTANCE_DECAY = 50.0
"""k of the paper in 1/m: contact (millimetres) is kept, 2 cm away counts a third. The paper gives
no value; the public code's 1/m hardly decays over a hand."""
TANGENTIAL_GAIN = 1.0
NORMAL_GAIN = 1.0
"""k_a and k_b of the paper, dimensionless."""


@dataclass(frozen=True)
class PairStatistics(Bundle):
    """Motion of keypoints relative to contact points (eq. 1) over T - 1 frame pairs.

    Canonical frame, metres and seconds.
    """

    distance: Float[Tensor, "*B T1 K 21"]
    velocity: Float[Tensor, "*B T1 K 21 3"]
    """v_ho: keypoint velocity minus contact-point velocity."""
    tangential: Float[Tensor, "*B T1 K 21"]
    """e_parallel = exp(-k d) k_a |v_ho in the tangent plane|."""
    normal: Float[Tensor, "*B T1 K 21"]
    """e_perpendicular = exp(-k d) k_b |v_ho along the normal|."""


@dataclass(frozen=True)
class TemporalRelations(PairStatistics):
    """T of eq. (1): the statistics of all pairs, with the object's own motion."""

    object_velocity: Float[Tensor, "*B T1 K 3"]
    normals: Float[Tensor, "*B T1 K 3"]


def encode_temporal(
    joints: Float[Tensor, "*B T 21 3"], region: ContactRegion, fps: float
) -> TemporalRelations:
    """Temporal relations of world keypoints; needs T of at least 2."""
    turn = region.rotation[..., :-1, :, :]
    object_velocity = (region.points.diff(dim=-3) * fps) @ turn
    joint_velocity = (joints.diff(dim=-3) * fps) @ turn
    normals = region.normals[..., :-1, :, :] @ turn
    offsets = joints[..., :-1, None, :, :] - region.points[..., :-1, :, None, :]
    distance = offsets.norm(dim=-1)
    velocity = joint_velocity[..., None, :, :] - object_velocity[..., :, None, :]
    along = (velocity * normals[..., :, None, :]).sum(-1)
    # max(.,0) and the floor keep the root's gradient finite where a keypoint moves with the point
    across = (velocity.square().sum(-1) - along.square()).clamp(min=1e-12).sqrt()
    near = torch.exp(-DISTANCE_DECAY * distance)
    return TemporalRelations(
        object_velocity=object_velocity,
        normals=normals,
        distance=distance,
        velocity=velocity,
        tangential=near * TANGENTIAL_GAIN * across,
        normal=near * NORMAL_GAIN * along.abs(),
    )
