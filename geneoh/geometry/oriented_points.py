"""Signed distance to a surface that is known only by points on it and their outward normals."""

import torch
from jaxtyping import Float, Int
from scipy.spatial import KDTree
from torch import Tensor

CANDIDATES = 6  # nearest points that may tell the distance
SPACING = 0.004
"""How much farther than the nearest point another may be, metres: about the distance of 1,024
points on an object from the hand, from one another."""
FAR = 1e3  # coordinate in metres of what is nowhere


def signed_to_points(
    query: Float[Tensor, "N V 3"],
    points: Float[Tensor, "N P 3"],
    normals: Float[Tensor, "N P 3"],
    *,
    within: float,
) -> tuple[Float[Tensor, "N V"], Int[Tensor, "N V"]]:
    """Distance along the normal of the surface point that tells it, metres, and that point.

    Of the nearest points the one that has the query farthest in front of it counts, so that the
    other side of a thin wall says nothing. From `within` metres on, and for NaN, the distance is
    infinite and the point 0. Found on the CPU, by a tree of each set of points.
    """
    distance = torch.full(query.shape[:2], torch.inf)
    index = torch.zeros(query.shape[:2], dtype=torch.long)
    queries = query.detach().nan_to_num(nan=FAR).cpu()
    places, outward = points.detach().cpu(), normals.detach().cpu()
    count = min(CANDIDATES, points.shape[1])
    for i, tree in enumerate(map(KDTree, places.numpy())):
        asked = tree.query(
            queries[i].numpy(), list(range(1, count + 1)), distance_upper_bound=within
        )
        apart, near = map(torch.from_numpy, asked)
        found = torch.nonzero(apart[:, 0].isfinite())[:, 0]
        apart, near = apart[found], near[found]
        there = apart <= apart[:, :1] + SPACING
        near = torch.where(there, near, near[:, :1])
        along = ((queries[i, found, None] - places[i, near]) * outward[i, near]).sum(-1)
        best = along.argmax(1, keepdim=True)
        distance[i, found] = along.gather(1, best)[:, 0]
        index[i, found] = near.gather(1, best)[:, 0]
    return distance.to(query), index.to(query.device)
