"""Points on the object's surface by which the stages know it, where the hand reaches it."""

import numpy as np
import torch
from jaxtyping import Float
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
    surface: MovingSurface, joints: Float[Tensor, "T 21 3"], *, generator: torch.Generator
) -> list[SurfaceSamples]:
    """Random points on each part, evenly by area, on the CPU.

    On a large object, such as furniture, they would be centimetres apart where the hand touches it,
    farther than on the objects of training. So where less than `REACHED_SHARE` of the surface is in
    reach of the hand, they are drawn there.
    """
    everywhere = spread_points(surface, SURFACE_POINTS, generator)
    apart = distances_of(everywhere, surface, joints)
    if (np.concatenate(apart) <= REACH).mean() >= REACHED_SHARE:
        return everywhere
    candidates = spread_points(surface, CANDIDATES, generator)
    apart = distances_of(candidates, surface, joints)
    every = np.concatenate(apart)
    reach = max(REACH, least(every, SURFACE_POINTS))
    share = SURFACE_POINTS / (every <= reach).sum()
    return [
        share_within(reach, share, part, distances)
        for part, distances in zip(candidates, apart, strict=True)
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


def distances_of(
    parts: list[SurfaceSamples], surface: MovingSurface, joints: Float[Tensor, "T 21 3"]
) -> list[Float[np.ndarray, " P"]]:
    """Distance of each point of each part to the nearest keypoint of any frame, metres."""
    found = []
    for points, (_, pose_world_part) in zip(parts, surface.parts, strict=True):
        hand = pose_world_part.inverse().apply(joints)[::SELECT_EVERY].flatten(0, 1)
        found.append(KDTree(hand.cpu().numpy()).query(points.points.numpy())[0])
    return found


def share_within(
    reach: float, share: float, points: SurfaceSamples, distances: Float[np.ndarray, " P"]
) -> SurfaceSamples:
    """A share of the points of a part that are within reach, or its `FEWEST_POINTS` nearest."""
    near = np.flatnonzero(distances <= max(reach, least(distances, FEWEST_POINTS)))
    count = max(FEWEST_POINTS, round(share * len(near)))
    # as evenly as all points, whose order is that of the faces
    chosen = near[np.linspace(0, len(near) - 1, count).round().astype(int)]
    return SurfaceSamples(points.points[chosen], points.normals[chosen])


def least(values: Float[np.ndarray, " P"], count: int) -> float:
    """The largest of the `count` smallest values."""
    return float(np.partition(values, count - 1)[count - 1])
