"""Signed distance to a surface that is known only by points on it and their outward normals."""

import torch
from jaxtyping import Float, Int
from scipy.spatial import KDTree
from torch import Tensor

CANDIDATES = 6  # nearest points that may define the distance
WINDOW = 0.6  # how much farther than the nearest point a candidate may be, in point spacings
ASIDE = 1.3  # tangential distance, in point spacings, up to which a point stands for the surface
FAR = 1e3  # coordinate in metres that stands for NaN


def signed_to_points(
    query: Float[Tensor, "N V 3"],
    points: Float[Tensor, "N P 3"],
    normals: Float[Tensor, "N P 3"],
    *,
    within: float,
) -> tuple[Float[Tensor, "N V"], Int[Tensor, "N V"]]:
    """Signed distance to the surface in metres, negative inside, and the index of its point.

    Among the nearest points, the one with the largest distance along its normal counts, so that
    the far side of a thin wall is ignored. A query with a larger tangential than normal offset
    lies beside an edge: it is outside, at its Euclidean distance from the point. Beyond `within`
    metres, and for NaN, the distance is infinite and the index 0. Runs on the CPU, with one k-d
    tree for each set of points.
    """
    distance = torch.full(query.shape[:2], torch.inf)
    index = torch.zeros(query.shape[:2], dtype=torch.long)
    queries = query.detach().nan_to_num(nan=FAR).cpu()
    places, outward = points.detach().cpu(), normals.detach().cpu()
    spacing = spacing_of(places)
    nearest = list(range(1, min(CANDIDATES, points.shape[1]) + 1))
    for i, tree in enumerate(map(KDTree, places.numpy())):
        # scipy takes a list of ranks, but its type stubs do not
        neighbours = tree.query(queries[i].numpy(), nearest, distance_upper_bound=within)  # pyright: ignore
        apart, near = map(torch.from_numpy, neighbours)
        found = torch.nonzero(apart[:, 0].isfinite())[:, 0]
        apart, near = apart[found], near[found]
        near = torch.where(apart <= apart[:, :1] + WINDOW * spacing[i], near, near[:, :1])
        offset = queries[i, found, None] - places[i, near]
        along, best = (offset * outward[i, near]).sum(-1).max(1)
        offset = offset[torch.arange(len(best)), best].norm(dim=-1)
        aside = (offset.square() - along.square()).clamp(min=0).sqrt()
        beside = aside > torch.maximum(along.abs(), ASIDE * spacing[i])
        distance[i, found] = torch.where(beside, offset, along)
        index[i, found] = near.gather(1, best[:, None])[:, 0]
    return distance.to(query), index.to(query.device)


def spacing_of(points: Float[Tensor, "N P 3"]) -> Float[Tensor, " N"]:
    """Approximate spacing of points spread evenly on the surface of their bounding box, metres."""
    x, y, z = (points.amax(1) - points.amin(1)).unbind(-1)
    return (2 * (x * y + y * z + z * x) / points.shape[1]).sqrt()
