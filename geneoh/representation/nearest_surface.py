"""The surface point nearest to each keypoint: where the hand touches or enters the object."""

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.representation.region import ObjectSurface

CACHED = 2**18  # distances that are held at once


def nearest_points(
    joints: Float[Tensor, "*B N 3"],
    points: Float[Tensor, "*B P 3"],
    normals: Float[Tensor, "*B P 3"],
) -> tuple[Float[Tensor, "*B N 3"], Float[Tensor, "*B N 3"]]:
    """The nearest of the surface points to each keypoint and its outward normal, same frame."""
    center = points.mean(-2, keepdim=True)  # squares lose digits far from the origin
    around, apart = points - center, joints - center
    # |j - p|^2 - |j|^2 as one matrix product: |j|^2 is the same for every point
    right = torch.cat([-2 * around, around.square().sum(-1, keepdim=True)], dim=-1)
    left = torch.cat([apart, torch.ones_like(apart[..., :1])], dim=-1)
    # a few joints at a time, so that their distances to all points stay in the processor's cache
    size = max(1, CACHED * joints.shape[-2] // max(1, left[..., 0].numel() * points.shape[-2]))
    found = torch.empty(joints.shape[:-1], dtype=torch.long, device=joints.device)
    # written in place: results of their own would lie where the distances were, which then need
    # new memory for each few joints
    for part, into in zip(left.split(size, dim=-2), found.split(size, dim=-1), strict=True):
        into.copy_(index_of_least(part @ right.mT))
    index = found[..., None].expand(*joints.shape)
    return points.gather(-2, index), normals.gather(-2, index)


def index_of_least(values: Float[Tensor, "*B P"]) -> Int[Tensor, "*B"]:
    """Index of the least of the last axis; on a CPU by numpy, which takes a tenth of the time."""
    if values.device.type != "cpu":
        return values.argmin(-1)
    return torch.from_numpy(np.asarray(values.detach().numpy().argmin(-1)))


def nearest_on_parts(
    joints: Float[Tensor, "B T N 3"], surface: ObjectSurface
) -> tuple[Float[Tensor, "B T N 3"], Float[Tensor, "B T N 3"]]:
    """`nearest_points` in the world, where each surface point moves with its part of the object.

    They are compared in the frame of the part, which is faster than to move all points.
    """
    found, normal = torch.zeros_like(joints), torch.zeros_like(joints)
    least = joints.new_full(joints.shape[:-1], torch.inf)
    for index in range(surface.rotation.shape[2]):
        own = surface.part == index
        some = own.any(1)
        if not some.any():
            continue
        turn = surface.rotation[some, :, index]
        shift = surface.translation[some, :, index, None]
        # entries of other parts are replaced by a point of this part
        pick = torch.arange(own.shape[1]).to(surface.part)
        pick = torch.where(own, pick, own.int().argmax(1)[:, None])[some, :, None].expand(-1, -1, 3)
        near, outward = nearest_points(
            ((joints[some] - shift) @ turn).flatten(1, 2),
            surface.points[some].gather(1, pick),
            surface.normals[some].gather(1, pick),
        )
        near = near.unflatten(1, joints.shape[1:3]) @ turn.mT + shift
        outward = outward.unflatten(1, joints.shape[1:3]) @ turn.mT
        apart = (near - joints[some]).norm(dim=-1)
        nearer = (apart < least[some])[..., None]
        found[some] = torch.where(nearer, near, found[some])
        normal[some] = torch.where(nearer, outward, normal[some])
        least[some] = torch.minimum(apart, least[some])
    return found, normal
