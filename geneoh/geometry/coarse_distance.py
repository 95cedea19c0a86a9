"""A grid of signed distances around a mesh, to find quickly which points are far from it."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float64, Int
from torch import Tensor

CELLS = 16384
"""Approximate number of cells. More cells decide more points, but take longer to compute."""
DECIDED = 0.99  # safety factor, because distances are rounded
MARGIN = 0.01  # metres by which the grid is larger than the mesh on every side

Found = tuple[Float64[Tensor, " N"], Float64[Tensor, "N 3"], Float64[Tensor, "N 3"]]


@dataclass(frozen=True)
class CoarseDistance:
    """Signed distance and closest surface point of each cell centre of a grid, metres."""

    low: Float64[Tensor, " 3"]
    cell: float  # length of the edges of a cell
    distance: Float64[Tensor, "X Y Z"]
    closest: Float64[Tensor, "X Y Z 3"]

    @classmethod
    def around(
        cls,
        low: Float64[Tensor, " 3"],
        high: Float64[Tensor, " 3"],
        exact: Callable[[Float64[Tensor, "N 3"]], Found],
    ) -> "CoarseDistance":
        """The grid for a mesh between two corners; `exact` finds distances and closest points."""
        low, size = low - MARGIN, high - low + 2 * MARGIN
        cell = float((size.prod() / CELLS) ** (1 / 3))
        steps = [torch.arange(max(1, round(float(edge) / cell))) + 0.5 for edge in size]
        middles = low + cell * torch.stack(torch.meshgrid(*steps, indexing="ij"), dim=-1)
        distance, closest, _ = exact(middles.reshape(-1, 3))
        return cls(low, cell, distance.reshape(middles.shape[:-1]), closest.reshape(middles.shape))

    def at_least(self, points: Float64[Tensor, "N 3"]) -> Found:
        """A lower bound of the signed distance of finite points, and approximate closest points
        and normals.

        Signed distance changes by at most the way from the nearest cell centre to the point. The
        closest point is that of this centre, and the normal points from there to the point.
        """
        cell, away = self._nearest(points)
        closest = self.closest[cell]
        normal = torch.nn.functional.normalize(points - closest, dim=-1)
        return self.distance[cell] - away, closest, normal

    def is_inside(
        self, points: Float64[Tensor, "N 3"], distance: Float64[Tensor, " N"]
    ) -> tuple[Bool[Tensor, " N"], Bool[Tensor, " N"]]:
        """Whether points are inside a closed mesh, and for which of them this is certain.

        `distance` is their unsigned distance to the surface. The balls around a point and around
        the centre of its cell, with their distances as radii, hold no surface: where the balls
        overlap, point and centre are on the same side.
        """
        cell, away = self._nearest(points)
        signed = self.distance[cell]
        return signed < 0, away < DECIDED * (distance + signed.abs())

    def _nearest(
        self, points: Float64[Tensor, "N 3"]
    ) -> tuple[tuple[Int[Tensor, " N"], ...], Float64[Tensor, " N"]]:
        """The cell whose centre is nearest to each point, and the distance of that centre."""
        last = torch.tensor(self.distance.shape) - 1
        index = ((points - self.low) / self.cell).long().clamp(min=0).minimum(last)
        middle = self.low + (index + 0.5) * self.cell
        return index.unbind(-1), (points - middle).norm(dim=-1)
