"""Points on the object's surface by which the networks know it, where the hand reaches it."""

import torch
from jaxtyping import Float, Float64
from scipy.spatial import KDTree
from torch import Tensor

from geneoh.denoisers.base import SELECT_EVERY
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.sampling import SurfaceSamples, sample_surface

SURFACE_POINTS, FEWEST_POINTS = 1024, 16
"""Points that are drawn on the surface, all parts together, and at least on each part."""
REACH = 0.2
"""Distance to the nearest keypoint of any frame up to which the surface is in reach, metres."""
REACHED_SHARE = 0.5
"""Share of the surface in reach of the hand below which all points are drawn there."""
CANDIDATES = 2**16
"""Points on the whole surface from which those in reach are chosen."""


def surface_points(
    surface: MovingSurface,
    joints: Float[Tensor, "T 21 3"],
    *,
    generator: torch.Generator,
    count: int = SURFACE_POINTS,
) -> list[SurfaceSamples]:
    """Random points on each part, about `count` in all, evenly by area, on the CPU.

    On a large object, such as furniture, they would be centimetres apart where the hand touches it,
    farther than on the objects of training. So where less than `REACHED_SHARE` of the surface is in
    reach of the hand, they are drawn there.
    """
    some = surface.at(slice(None, None, SELECT_EVERY))
    hands = [pose.inverse().apply(joints[::SELECT_EVERY]) for _, pose in some.parts]
    trees = [KDTree(hand.flatten(0, 1).cpu().numpy()) for hand in hands]
    everywhere = spread_points(surface, count, generator)
    if (torch.cat(distances(everywhere, trees)) <= REACH).double().mean() >= REACHED_SHARE:
        return everywhere
    candidates = spread_points(surface, CANDIDATES, generator)
    apart = distances(candidates, trees)
    every = torch.cat(apart)
    reach = every.kthvalue(min(count, len(every))).values.clamp(min=REACH)
    share = count / int((every <= reach).sum())
    return [
        share_within(reach, share, part, own) for part, own in zip(candidates, apart, strict=True)
    ]


def spread_points(
    surface: MovingSurface, count: int, generator: torch.Generator
) -> list[SurfaceSamples]:
    """Random points on the whole of each part, about `count` in all."""
    meshes = (field.mesh for field in surface.fields)
    areas = torch.tensor([float(mesh.face_vectors().norm(dim=-1).sum()) for mesh in meshes])
    counts = (count * areas / areas.sum()).round().long().clamp(min=FEWEST_POINTS)
    return [
        sample_surface(field.solid, int(own), generator=generator)
        for field, own in zip(surface.fields, counts, strict=True)
    ]


def distances(parts: list[SurfaceSamples], trees: list[KDTree]) -> list[Float64[Tensor, " P"]]:
    """Distance of each point of each part to the nearest point of its tree, metres."""
    return [
        torch.from_numpy(tree.query(part.points.numpy())[0])
        for part, tree in zip(parts, trees, strict=True)
    ]


def share_within(
    reach: Float64[Tensor, ""],
    share: float,
    points: SurfaceSamples,
    apart: Float64[Tensor, " P"],
) -> SurfaceSamples:
    """A share of the points of a part that are within reach, or its `FEWEST_POINTS` nearest."""
    near = torch.nonzero(apart <= apart.kthvalue(FEWEST_POINTS).values.maximum(reach))[:, 0]
    count = max(FEWEST_POINTS, round(share * len(near)))
    # as evenly as all points, whose order is that of the faces
    chosen = near[torch.linspace(0, len(near) - 1, count, dtype=torch.float64).round().long()]
    return points.take(chosen, "P")
