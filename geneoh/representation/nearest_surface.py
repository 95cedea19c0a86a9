"""The surface point nearest to each keypoint: where the hand touches or penetrates the object."""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import KDTree
from torch import Tensor

from geneoh.geometry.distance import pairwise_distances
from geneoh.representation.region import ObjectSurface

MOST_DISTANCES = 2**24  # pairwise distances that `nearest_of_all` holds in memory at once


def nearest_points(
    joints: Float[Tensor, "*B N 3"],
    points: Float[Tensor, "*B P 3"],
    normals: Float[Tensor, "*B P 3"],
) -> tuple[Float[Tensor, "*B N 3"], Float[Tensor, "*B N 3"]]:
    """The nearest of the surface points to each keypoint and its outward normal, same frame."""
    nearest = nearest_in_tree if joints.device.type == "cpu" else nearest_of_all
    index = nearest(joints.detach(), points.detach())[..., None].expand(*joints.shape)
    return points.gather(-2, index), normals.gather(-2, index)


def nearest_in_tree(
    joints: Float[Tensor, "*B N 3"], points: Float[Tensor, "*B P 3"]
) -> Int[Tensor, "*B N"]:
    """Index of the point that is nearest to each joint, by one k-d tree per set of points."""
    sets = points.reshape(-1, *points.shape[-2:])
    if bool((sets == sets[:1]).all()):  # the windows of one track share their points
        sets = sets[:1]
    queries = joints.nan_to_num().reshape(len(sets), -1, 3)
    found = [
        # quick to build; a tree of few points answers as fast unbalanced
        KDTree(own, balanced_tree=False, compact_nodes=False).query(
            some, workers=torch.get_num_threads()
        )[1]
        for some, own in zip(queries.numpy(), sets.numpy(), strict=True)
    ]
    return torch.from_numpy(np.stack(found)).reshape(joints.shape[:-1])


def nearest_of_all(
    joints: Float[Tensor, "*B N 3"], points: Float[Tensor, "*B P 3"]
) -> Int[Tensor, "*B N"]:
    """As `nearest_in_tree`, by all pairwise distances, on any device."""
    size = max(1, MOST_DISTANCES // max(1, joints[..., :1, 0].numel() * points.shape[-2]))
    some = joints.split(size, -2)
    return torch.cat([pairwise_distances(each, points).argmin(-1) for each in some], dim=-1)


class Nearest(NamedTuple):
    """Surface points nearest to N keypoints of T frames, world frame, metres."""

    points: Float[Tensor, "B T N 3"]
    normals: Float[Tensor, "B T N 3"]  # outward normals there
    part: Int[Tensor, "B T N"]  # the part of the object that they are on


def nearest_on_parts(joints: Float[Tensor, "B T N 3"], surface: ObjectSurface) -> Nearest:
    """`nearest_points` for an object of moving parts, in the world frame. The search is in the
    frame of each part, which is faster than moving all surface points."""
    found, normal = torch.zeros_like(joints), torch.zeros_like(joints)
    least = joints.new_full(joints.shape[:-1], torch.inf)
    part = torch.zeros_like(least, dtype=torch.long)
    for index in range(surface.rotation.shape[2]):
        own = surface.part == index
        some = own.any(1)
        if not some.any():
            continue
        turn = surface.rotation[some, :, index]
        shift = surface.translation[some, :, index, None]
        # items with fewer points on this part are padded with their first such point
        pick = own.int().argsort(dim=1, descending=True, stable=True)[:, : int(own.sum(1).max())]
        pick = torch.where(own.gather(1, pick), pick, pick[:, :1])[some, :, None].expand(-1, -1, 3)
        near, outward = nearest_points(
            ((joints[some] - shift) @ turn).flatten(1, 2),
            surface.points[some].gather(1, pick),
            surface.normals[some].gather(1, pick),
        )
        near = near.unflatten(1, joints.shape[1:3]) @ turn.mT + shift
        outward = outward.unflatten(1, joints.shape[1:3]) @ turn.mT
        apart = (near - joints[some]).norm(dim=-1)
        nearer = apart < least[some]
        found[some] = torch.where(nearer[..., None], near, found[some])
        normal[some] = torch.where(nearer[..., None], outward, normal[some])
        part[some] = torch.where(nearer, index, part[some])
        least[some] = torch.minimum(apart, least[some])
    return Nearest(found, normal, part)
