"""A closed mesh of an object that is known only by points on its surface and their normals."""

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial import KDTree
from torch import Tensor

from geneoh.geometry.mesh import Mesh
from geneoh.interrupts import interrupts_wait

with interrupts_wait():
    import igl

GRID_SPACING, MOST_CELLS = 0.004, 40
"""Spacing of the marching cubes grid in metres, where thinner walls get holes; and most cells along
a side, for large objects."""
MARGIN_POINTS = 3  # grid points around the object
NEIGHBOURS = 6  # nearest points that define the disc of surface that a point stands for
AT_ONCE = 20_000  # query points per batch


def mesh_of_points(points: Float[Tensor, "P 3"], normals: Float[Tensor, "P 3"]) -> Mesh:
    """The isosurface of the points' winding number at a half, by marching cubes; metres.

    Corners and edges are rounded by about the spacing of the points.
    """
    grid = max(GRID_SPACING, float((points.amax(0) - points.amin(0)).max()) / MOST_CELLS)
    low, high = points.amin(0) - MARGIN_POINTS * grid, points.amax(0) + MARGIN_POINTS * grid
    x, y, z = (torch.arange(float(a), float(b), grid) for a, b in zip(low, high, strict=True))
    # in libigl's grids x varies fastest
    planes = torch.meshgrid(z, y, x, indexing="ij")
    places = torch.stack(planes[::-1], -1).reshape(-1, 3)
    outside = 0.5 - winding_number(places, points, normals)
    values, corners = (each.double().numpy() for each in (outside, places))
    verts, faces, _ = igl.marching_cubes(values, corners, len(x), len(y), len(z))
    return Mesh(
        torch.from_numpy(np.ascontiguousarray(verts)).to(points),
        torch.from_numpy(np.ascontiguousarray(faces)).long(),
    )


def winding_number(
    places: Float[Tensor, "N 3"], points: Float[Tensor, "P 3"], normals: Float[Tensor, "P 3"]
) -> Float[Tensor, " N"]:
    """Winding number of the surface through the points at `places`: about 1 inside, 0 outside.

    Each point stands for a disc that reaches halfway to its neighbours. Near a disc the number is
    smoothed.

    Source: Barill et al., Fast Winding Numbers for Soups and Clouds, 2018, equation (1).
    """
    apart, _ = KDTree(points.numpy()).query(points.numpy(), NEIGHBOURS + 1)
    squared = torch.from_numpy(apart[:, -1]).to(points) ** 2 / NEIGHBOURS
    weighted = normals * squared[:, None] / 4
    offset = (weighted * points).sum(-1)
    found = []
    for some in places.split(AT_ONCE):
        ahead = offset - some @ weighted.T
        found.append((ahead / (torch.cdist(some, points) ** 2 + squared / 4) ** 1.5).sum(-1))
    return torch.cat(found)
