"""T: hand-object temporal relations of every contact point and frame pair (paper 3.1, eq. 1)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.representation.region import ContactRegion

DISTANCE_DECAY = 50.0
"""k of the paper in 1/m: the weight exp(-k d) is near 1 in contact and a third at 2 cm. The paper
gives no value; with the 1/m of the public code it hardly decays over a hand."""
TANGENTIAL_GAIN = 1.0
NORMAL_GAIN = 1.0
"""k_a and k_b of the paper, dimensionless."""
FLATNESS = 5e-4
"""Standard deviation of points from a plane, metres, below which they count as coplanar."""


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
    found = pair_statistics(
        differences(joints[..., :-1, :, :], region.points[..., :-1, :, :]),
        differences(joint_velocity, object_velocity),
        normals,
    )
    return TemporalRelations(**vars(found), object_velocity=object_velocity, normals=normals)


def pair_statistics(
    apart: list[Float[Tensor, "*B T1 K 21"]],
    velocity: list[Float[Tensor, "*B T1 K 21"]],
    normals: Float[Tensor, "*B T1 K 3"],
) -> PairStatistics:
    """Statistics of the offset from each contact point to each keypoint and its relative velocity.

    Both are one tensor per axis (see `differences`). Only the length of the offset is used, so its
    frame does not matter; `velocity` and `normals` share a frame.
    """
    # the lower limit keeps the gradient of the root finite where a keypoint is on the point
    distance = squared(apart).clamp(min=1e-18).sqrt()
    x, y, z = (v * n[..., None] for v, n in zip(velocity, normals.unbind(-1), strict=True))
    along = x + y + z
    # and here where a keypoint moves with the point
    across = (squared(velocity) - along.square()).clamp(min=1e-12).sqrt()
    near = torch.exp(-DISTANCE_DECAY * distance)
    return PairStatistics(
        distance=distance,
        velocity=torch.stack(velocity, dim=-1),
        tangential=near * TANGENTIAL_GAIN * across,
        normal=near * NORMAL_GAIN * along.abs(),
    )


def places_by_distance(
    distance: Float[Tensor, "*B K 21"], points: Float[Tensor, "*B K 3"]
) -> Float[Tensor, "*B 21 3"]:
    """Keypoints from their distances to points (trilateration), metres, by linear least squares.

    Coplanar points (see `FLATNESS`) leave the coordinate along the plane's normal undetermined; the
    keypoint is then placed in the plane.
    """
    centre = points.mean(-2, keepdim=True)
    arm = points - centre
    squares = distance.square() - arm.square().sum(-1, keepdim=True)
    small = points.shape[-2] * FLATNESS**2 * torch.eye(3).to(points)
    return centre - 0.5 * torch.linalg.solve(arm.mT @ arm + small, arm.mT @ squares).mT


def differences(
    joints: Float[Tensor, "*B 21 3"], points: Float[Tensor, "*B K 3"]
) -> list[Float[Tensor, "*B K 21"]]:
    """Offsets from each point to each joint, one tensor per axis: sums over a list of axes are much
    faster than over a last axis of three."""
    pairs = zip(joints.unbind(-1), points.unbind(-1), strict=True)
    return [joint[..., None, :] - point[..., None] for joint, point in pairs]


def squared(axes: list[Float[Tensor, "*B"]]) -> Float[Tensor, "*B"]:
    """Squared length of vectors that are passed as one tensor per axis."""
    x, y, z = axes
    return x.square() + y.square() + z.square()
