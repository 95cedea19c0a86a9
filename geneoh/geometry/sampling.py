"""Points on surfaces: drawn evenly by area, thinned to spread."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.geometry.mesh import Mesh
from geneoh.geometry.solid import Solid, build_solid


@dataclass(frozen=True)
class SurfaceSamples:
    """Points on a surface, in the mesh's frame."""

    points: Float[Tensor, "P 3"]
    normals: Float[Tensor, "P 3"]
    """Unit, out of the solid."""


def sample_surface(mesh: Mesh | Solid, count: int, *, generator: torch.Generator) -> SurfaceSamples:
    """Draw points evenly by area from the surface between inside and outside.

    Faces that overlapping shells bury are not drawn from; an open sheet is drawn from on both sides
    of its wall, as `SurfaceDistance` sees it. Stratified: each of `count` equal shares of the area,
    in the order of the faces, holds one point.

    Args:
        mesh: give a `Solid` when there is one already, it saves building it.
        count: how many points.
        generator: on the CPU, so that every device gets the same points.
    """
    surface = (mesh if isinstance(mesh, Solid) else build_solid(mesh)).surface
    draws = torch.rand(count, 3, generator=generator, dtype=torch.float64)
    areas = surface.face_vectors().double().norm(dim=-1).cumsum(0)
    place = (torch.arange(count) + draws[:, 0]) / count * areas[-1]
    face = torch.searchsorted(areas, place, right=True).clamp(max=len(areas) - 1)
    # The root makes the points even over the triangle (Osada et al. 2002, section 4.1).
    root = draws[:, 1].sqrt()
    weights = torch.stack([1 - root, root * (1 - draws[:, 2]), root * draws[:, 2]], dim=-1)
    points = (weights[..., None] * surface.corners()[face].double()).sum(-2)
    return SurfaceSamples(points.to(surface.verts), surface.face_normals()[face].to(surface.verts))


def farthest_points(points: Float[Tensor, "P 3"], count: int) -> Int[Tensor, " K"]:
    """Indices of `count` points spread as far apart as greed gets; all P when there are no more.

    Starts from the point farthest from the mean, so that the same points give the same answer.
    """
    count = min(count, len(points))
    chosen = torch.zeros(count, dtype=torch.long, device=points.device)
    if count == 0:
        return chosen
    spread = (points - points.mean(0)).square().sum(-1)
    chosen[0] = spread.argmax()
    spread = torch.full_like(spread, torch.inf)
    for i in range(1, count):
        apart = (points - points[chosen[i - 1]]).square().sum(-1)
        spread = torch.minimum(spread, apart)
        chosen[i] = spread.argmax()
    return chosen
