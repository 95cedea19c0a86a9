"""Random points on surfaces, evenly by area."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.solid import Solid, build_solid


@dataclass(frozen=True)
class SurfaceSamples(Bundle):
    """Points on a surface, in the mesh's frame."""

    points: Float[Tensor, "P 3"]
    normals: Float[Tensor, "P 3"]  # unit length, pointing out of the solid


@dataclass(frozen=True)
class PartSamples(SurfaceSamples):
    """Points on the parts of an object, in the frame of each."""

    part: Int[Tensor, " P"]  # the part that each point is on

    @classmethod
    def of(cls, parts: list[SurfaceSamples]) -> "PartSamples":
        """The points of all parts."""
        counts = torch.tensor([len(each.points) for each in parts])
        part = torch.arange(len(parts)).repeat_interleave(counts)
        return cls(**vars(concatenated(parts, "P")), part=part)


def sample_surface(mesh: Mesh | Solid, count: int, *, generator: torch.Generator) -> SurfaceSamples:
    """Draw points uniformly by area from the surface between inside and outside, on the CPU.

    Faces inside overlapping shells get no points; an open sheet gets points on both sides of its
    wall, as in `SurfaceDistance`. The sampling is stratified: each of `count` equal shares of the
    area, in the order of the faces, gets one point. Pass a `Solid` where one is already built.
    """
    surface = (mesh if isinstance(mesh, Solid) else build_solid(mesh)).surface
    draws = torch.rand(count, 3, generator=generator, dtype=torch.float64)
    areas = surface.face_vectors().double().norm(dim=-1).cumsum(0)
    place = (torch.arange(count) + draws[:, 0]) / count * areas[-1]
    face = torch.searchsorted(areas, place, right=True).clamp(max=len(areas) - 1)
    # The root makes the points uniform over the triangle (Osada et al. 2002, section 4.1).
    root = draws[:, 1].sqrt()
    weights = torch.stack([1 - root, root * (1 - draws[:, 2]), root * draws[:, 2]], dim=-1)
    points = (weights[..., None] * surface.corners()[face].double()).sum(-2)
    return SurfaceSamples(points.to(surface.verts), surface.face_normals()[face].to(surface.verts))
