"""The surface point nearest to each keypoint: where a hand touches, or how deep it is."""

import torch
from jaxtyping import Float
from torch import Tensor


def nearest_points(
    joints: Float[Tensor, "*B N 3"],
    points: Float[Tensor, "*B P 3"],
    normals: Float[Tensor, "*B P 3"],
) -> tuple[Float[Tensor, "*B N 3"], Float[Tensor, "*B N 3"]]:
    """The nearest of the surface points to each keypoint and its outward normal, same frame."""
    center = points.mean(-2, keepdim=True)  # the squares below lose digits far from the origin
    around, apart = points - center, joints - center
    # |j - p|^2 less |j|^2, which is the same for every point, as one product
    right = torch.cat([-2 * around, around.square().sum(-1, keepdim=True)], dim=-1)
    left = torch.cat([apart, torch.ones_like(apart[..., :1])], dim=-1)
    index = (left @ right.mT).min(-1).indices[..., None].expand(*joints.shape)
    return points.gather(-2, index), normals.gather(-2, index)
