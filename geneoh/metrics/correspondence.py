"""Contact map on the object by the rays of TOCH.

From each object point a ray is cast along the normal, or against it where the point is inside the
hand. The first hand point on the ray is the correspondence of the object point, unless the ray
meets the object first. A point is in contact when its correspondence is at most 2 mm away.

Source: Zhou et al., TOCH, 2022, section 3.1; GeneOH Diffusion, C.2 (contact IoU).
"""

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.distance import MovingSurface, SearchTree, SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.openings import capped
from geneoh.geometry.sampling import SurfaceSamples, sample_surface
from geneoh.geometry.solid import as_arrays
from geneoh.interrupts import interrupts_wait
from geneoh.metrics.contact import CONTACT_MAP

with interrupts_wait():
    import igl

OBJECT_POINTS = 8000  # points on an object, as in TOCH, distributed over its parts by area
RAY_OFFSET = 1e-4  # metres from a point at which its ray may first be blocked by the object (TOCH)


def contact_points(
    fields: tuple[SurfaceDistance, ...], *, generator: torch.Generator, count: int = OBJECT_POINTS
) -> tuple[SurfaceSamples, ...]:
    """Points drawn evenly from the surface of an object's parts, in the parts' frames."""
    areas = [float(field.solid.surface.face_vectors().norm(dim=-1).sum()) for field in fields]
    return tuple(
        sample_surface(field.solid, max(1, round(count * area / sum(areas))), generator=generator)
        for field, area in zip(fields, areas, strict=True)
    )


def object_contact(
    verts: Float[Tensor, "T V 3"],
    faces: Int[Tensor, "F 3"],
    surface: MovingSurface,
    samples: tuple[SurfaceSamples, ...],
) -> Bool[Tensor, "T P"]:
    """Whether each object point has the hand within 2 mm along its ray, part after part.

    The hand is in the world frame; an opening at its wrist is closed. A frame where it is not
    finite has no contact. `samples` are the points of each part, from `contact_points`.
    """
    closed, closed_faces = capped(verts, faces)
    maps = []
    for (field, pose_world_part), points in zip(surface.parts, samples, strict=True):
        hands = pose_world_part.inverse().apply(closed)
        touched = torch.zeros(len(verts), len(points.points), dtype=torch.bool)
        for frame in torch.nonzero(hands.isfinite().flatten(1).all(-1))[:, 0].tolist():
            hand = Mesh(hands[frame], closed_faces)
            touched[frame] = rays_meet(hand, field, points)
        maps.append(touched)
    return torch.cat(maps, dim=-1).to(verts.device)


def rays_meet(hand: Mesh, field: SurfaceDistance, samples: SurfaceSamples) -> Bool[Tensor, " P"]:
    """Whether each point's correspondence is within 2 mm; on the CPU, in the part's frame."""
    verts, faces = as_arrays(hand)
    points, normals = (x.cpu().double().numpy() for x in (samples.points, samples.normals))
    met = np.zeros(len(points), dtype=bool)
    around = (points > verts.min(0) - CONTACT_MAP) & (points < verts.max(0) + CONTACT_MAP)
    near = np.flatnonzero(around.all(-1))
    if not len(near):
        return torch.from_numpy(met)
    tree = SearchTree(hand)
    # a ray is never shorter than the distance to the hand, so only near points can be in contact
    near = near[tree.nearest(points[near])[0] <= CONTACT_MAP**2]
    if not len(near):
        return torch.from_numpy(met)
    start = points[near]
    inside = np.abs(igl.winding_number(verts, faces, start)) > 0.5
    ahead = np.where(inside[:, None], -normals[near], normals[near])
    reach, _ = tree.first_hit(start, ahead)
    blocked = field.tree.first_hit(start + RAY_OFFSET * ahead, ahead)[0] + RAY_OFFSET < reach
    met[near] = (reach <= CONTACT_MAP) & ~blocked
    return torch.from_numpy(met)
