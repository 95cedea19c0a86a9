"""Generalised contact points and the canonical frame they carry (paper 3.1).

The contact points are object surface points close to the hand at any time of its trajectory. The
canonical frame (R_k, t_k) of video frame k has the orientation of the object's first part and its
origin at the centre of the points. The pipeline orders parts so that the first is the one that the
hand is at for longest (`geneoh.objects.carrying`). Vectors are columns: p_canon = R_k^T (p_world -
t_k), the transpose of the paper's row notation.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.distance import pairwise_distances

CONTACT_RADIUS = 0.015
"""Distance in metres from a keypoint within which a surface point counts as close: the paper's 5 mm
from the skin, plus 10 mm because keypoints lie inside the hand."""


@dataclass(frozen=True)
class ContactRegion(Bundle):
    """K contact points over T video frames, and the canonical frame of each of these."""

    points: Float[Tensor, "*B T K 3"]
    """World frame, metres; `normals` are unit and outward."""
    normals: Float[Tensor, "*B T K 3"]
    rotation: Float[Tensor, "*B T 3 3"]
    """R_k: canonical to world."""
    center: Float[Tensor, "*B T 3"]
    """t_k, world."""

    def to_canon(self, world: Float[Tensor, "*B T P 3"]) -> Float[Tensor, "*B T P 3"]:
        """World points of each video frame, in its canonical frame."""
        return (world - self.center[..., None, :]) @ self.rotation

    def to_world(self, canon: Float[Tensor, "*B T P 3"]) -> Float[Tensor, "*B T P 3"]:
        """Inverse of `to_canon`."""
        return canon @ self.rotation.transpose(-1, -2) + self.center[..., None, :]

    @property
    def points_canon(self) -> Float[Tensor, "*B T K 3"]:
        """The contact points in the canonical frame; constant over time for a rigid object."""
        return self.to_canon(self.points)

    @property
    def normals_canon(self) -> Float[Tensor, "*B T K 3"]:
        """Outward normals in the canonical frame."""
        return self.normals @ self.rotation

    def turned(self, turn: Float[Tensor, "*B 3 3"]) -> "ContactRegion":
        """The same region with its canonical frame turned: the train-time augmentation (eq. 25)."""
        return ContactRegion(
            self.points, self.normals, self.rotation @ turn[..., None, :, :], self.center
        )

    def held_still(self) -> "ContactRegion":
        """The same points in a static canonical frame: world axes, origin at the mean centre."""
        upright = torch.eye(3).to(self.rotation).expand_as(self.rotation)
        middle = self.center.mean(-2, keepdim=True).expand_as(self.center)
        return ContactRegion(self.points, self.normals, upright, middle)

    def nearest(self, joints: Float[Tensor, "*B T 21 3"], count: int) -> "ContactRegion":
        """The same region with only the `count` contact points nearest to world keypoints."""
        apart = distance_to_trajectory(self.points, joints)
        keep = apart.topk(min(count, apart.shape[-1]), dim=-1, largest=False).indices
        index = keep[..., None, :, None].expand(*self.points.shape[:-2], -1, 3)
        points, normals = self.points.gather(-2, index), self.normals.gather(-2, index)
        return ContactRegion(points, normals, self.rotation, self.center)


@dataclass(frozen=True)
class ObjectSurface(Bundle):
    """P surface points of an object whose Q parts move over T frames."""

    points: Float[Tensor, "*B P 3"]
    """In the frame of their part, metres; `normals` are outward, `part` is the part's index."""
    normals: Float[Tensor, "*B P 3"]
    part: Int[Tensor, "*B P"]
    rotation: Float[Tensor, "*B T Q 3 3"]
    """Part frame to world frame, with `translation`."""
    translation: Float[Tensor, "*B T Q 3"]

    def in_world(self) -> tuple[Float[Tensor, "*B T P 3"], Float[Tensor, "*B T P 3"]]:
        """Points and normals in the world frame, by the pose of their part in each frame."""
        points, normals = self.points[..., None, :, :], self.normals[..., None, :, :]
        frames = self.rotation.shape[-4]
        index = self.part[..., None, :, None].expand(*self.part.shape[:-1], frames, -1, 3)
        shift = self.translation.gather(-2, index)
        if self.rotation.shape[-3] == 1:
            turn = self.rotation[..., 0, :, :].transpose(-1, -2)
            return points @ turn + shift, normals @ turn
        turns = self.rotation.gather(-3, index[..., None].expand(*index.shape, 3))
        return (turns @ points[..., None])[..., 0] + shift, (turns @ normals[..., None])[..., 0]


def distance_to_trajectory(
    points: Float[Tensor, "*B T P 3"], joints: Float[Tensor, "*B T 21 3"]
) -> Float[Tensor, "*B P"]:
    """Least distance of each moving point to any keypoint over all frames, metres."""
    # exact distances: with rounded ones, the choice of points would depend on the world's origin
    return pairwise_distances(points, joints).amin(-1).amin(-2)


def select_points(
    distance: Float[Tensor, "*B P"], points: Float[Tensor, "*B P 3"], count: int
) -> Int[Tensor, "*B K"]:
    """`count` well-spread points among those near the hand's trajectory; deterministic.

    Points within CONTACT_RADIUS qualify, or the `count` nearest where fewer do, so the set is never
    empty however far the hand is (the paper states the radius only; the public code dilates the
    hand's projection instead). Farthest-point sampling then spreads them, starting at the nearest.
    """
    threshold = distance.kthvalue(min(count, distance.shape[-1]), dim=-1).values
    near = distance <= threshold.clamp(min=CONTACT_RADIUS)[..., None]
    return farthest_points(points, near, distance.argmin(-1), count)


def farthest_points(
    points: Float[Tensor, "*B P 3"],
    allowed: Bool[Tensor, "*B P"],
    first: Int[Tensor, "*B"],
    count: int,
) -> Int[Tensor, "*B K"]:
    """Indices of `count` of the `allowed` points by farthest-point sampling, from `first` on."""
    chosen = [first]
    remaining = points.new_full(points.shape[:-1], torch.inf)
    for _ in range(count - 1):
        latest = points.gather(-2, chosen[-1][..., None, None].expand(*points.shape[:-2], 1, 3))
        remaining = torch.minimum(remaining, (points - latest).square().sum(-1))
        chosen.append(torch.where(allowed, remaining, -1.0).argmax(-1))
    return torch.stack(chosen, dim=-1)


def contact_region(
    joints: Float[Tensor, "*B T 21 3"], surface: ObjectSurface, *, count: int, every: int = 1
) -> ContactRegion:
    """K = `count` contact points (N_o of the paper) near world keypoints, with canonical frames.

    `joints` are never the ground truth. Distances are measured in each `every`-th frame only.
    """
    points, normals, part = surface.points, surface.normals, surface.part
    rotation, translation = surface.rotation, surface.translation
    seen = rotation[..., ::every, :, :, :], translation[..., ::every, :, :]
    world, _ = ObjectSurface(points, normals, part, *seen).in_world()
    distance = distance_to_trajectory(world, joints[..., ::every, :, :])
    keep = select_points(distance, world[..., 0, :, :], count)
    # only the chosen points are moved in every frame
    index = keep[..., None].expand(*keep.shape, 3)
    chosen = points.gather(-2, index), normals.gather(-2, index), part.gather(-1, keep)
    world, normals_world = ObjectSurface(*chosen, rotation, translation).in_world()
    return ContactRegion(world, normals_world, rotation[..., 0, :, :], world.mean(-2))
