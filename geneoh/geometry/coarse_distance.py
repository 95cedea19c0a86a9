"""A grid of distances around a mesh, which tells at once which points are far from its surface."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float64, Int
from torch import Tensor

CELLS = 16384
"""Most cells of a grid. More tell more points, but take longer to make."""
SURE = 0.99  # below 1, because distances are rounded
MARGIN = 0.01  # metres by which the grid is larger than the mesh on every side

Found = tuple[Float64[Tensor, " N"], Float64[Tensor, "N 3"], Float64[Tensor, "N 3"]]


@dataclass(frozen=True)
class CoarseDistance:
    """Signed distance and closest point of the middle of each cell of a grid, in metres."""

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
        """A lower bound of the signed distance of finite points, and about where the surface is
        closest and the normal there.

        The distance changes by no more than the way from the middle of the nearest cell. Closest
        point and normal are those of that middle, seen from the point.
        """
        cell, away = self._nearest(points)
        closest = self.closest[cell]
        normal = torch.nn.functional.normalize(points - closest, dim=-1)
        return self.distance[cell] - away, closest, normal

    def is_inside(
        self, points: Float64[Tensor, "N 3"], distance: Float64[Tensor, " N"]
    ) -> tuple[Bool[Tensor, " N"], Bool[Tensor, " N"]]:
        """Whether points are inside of a closed mesh, and for which of them this is sure.

        `distance` is theirs to the surface, without a sign. No surface is nearer than that to a
        point, nor nearer to the middle of its cell than that one's distance: where the two balls
        meet, there is no surface between point and middle.
        """
        cell, away = self._nearest(points)
        signed = self.distance[cell]
        return signed < 0, away < SURE * (distance + signed.abs())

    def _nearest(
        self, points: Float64[Tensor, "N 3"]
    ) -> tuple[tuple[Int[Tensor, " N"], ...], Float64[Tensor, " N"]]:
        """The cell whose middle is nearest to each point, and how far that is."""
        last = torch.tensor(self.distance.shape) - 1
        index = ((points - self.low) / self.cell).long().clamp(min=0).minimum(last)
        middle = self.low + (index + 0.5) * self.cell
        return index.unbind(-1), (points - middle).norm(dim=-1)
