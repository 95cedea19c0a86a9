"""Signed distance to a surface that is known only by points on it and their outward normals."""

import torch
from jaxtyping import Float, Int
from scipy.spatial import KDTree
from torch import Tensor

CANDIDATES = 6  # nearest points that may tell the distance
WINDOW = 0.6  # how much farther than the nearest one another may be, in spacings of the points
ASIDE = 1.3  # spacings from a point, along the surface, within which it tells the distance
FAR = 1e3  # coordinate in metres of what is nowhere


def signed_to_points(
    query: Float[Tensor, "N V 3"],
    points: Float[Tensor, "N P 3"],
    normals: Float[Tensor, "N P 3"],
    *,
    within: float,
) -> tuple[Float[Tensor, "N V"], Int[Tensor, "N V"]]:
    """Distance to the surface in metres, negative inside, and the surface point that tells it.

    Of the nearest points the one that has the query farthest in front of it counts, so that the
    other side of a thin wall says nothing, and the distance is that along its normal. A query that
    is more aside of the point than in front of it or behind it is beside an edge: it is outside,
    as far off as the point. From `within` metres on, and for NaN, the distance is infinite and the
    point 0. Found on the CPU, by a tree of each set of points.
    """
    distance = torch.full(query.shape[:2], torch.inf)
    index = torch.zeros(query.shape[:2], dtype=torch.long)
    queries = query.detach().nan_to_num(nan=FAR).cpu()
    places, outward = points.detach().cpu(), normals.detach().cpu()
    spacing = spacing_of(places)
    nearest = list(range(1, min(CANDIDATES, points.shape[1]) + 1))
    for i, tree in enumerate(map(KDTree, places.numpy())):
        # scipy takes a list of ranks, of which its types know nothing
        asked = tree.query(queries[i].numpy(), nearest, distance_upper_bound=within)  # pyright: ignore
        apart, near = map(torch.from_numpy, asked)
        found = torch.nonzero(apart[:, 0].isfinite())[:, 0]
        apart, near = apart[found], near[found]
        near = torch.where(apart <= apart[:, :1] + WINDOW * spacing[i], near, near[:, :1])
        off = queries[i, found, None] - places[i, near]
        along, best = (off * outward[i, near]).sum(-1).max(1)
        off = off[torch.arange(len(best)), best].norm(dim=-1)
        aside = (off.square() - along.square()).clamp(min=0).sqrt()
        beside = aside > torch.maximum(along.abs(), ASIDE * spacing[i])
        distance[i, found] = torch.where(beside, off, along)
        index[i, found] = near.gather(1, best[:, None])[:, 0]
    return distance.to(query), index.to(query.device)


def spacing_of(points: Float[Tensor, "N P 3"]) -> Float[Tensor, " N"]:
    """About how far points are from one another on the surface of the box around them, metres."""
    x, y, z = (points.amax(1) - points.amin(1)).unbind(-1)
    return (2 * (x * y + y * z + z * x) / points.shape[1]).sqrt()
