"""Objects of the synthesis as triangle meshes, for metrics and pictures."""

import numpy as np
import torch

from geneoh.geometry.mesh import Mesh
from geneoh.interrupts import interrupts_wait
from geneoh.synthesis.shapes.solids import FAR_AWAY, TORUS, Solids

with interrupts_wait():
    import igl

SPACING = 0.002  # between grid points of marching cubes, metres; the thinnest parts are 3 mm thick
COARSEST, THICKNESS_SHARE = 0.004, 0.6
"""Spacing for pictures: the largest in metres, and as a share of the thinnest solid's thickness."""
MARGIN = 0.005  # margin of the grid around an object, metres


def mesh_of_solid(solid: Solids, spacing: float = SPACING) -> Mesh:
    """The surface of one object as a closed mesh, by marching cubes on its signed distance.

    Edges are rounded by about the spacing. A scanned object returns its own mesh.
    """
    centre, size, turn = solid.center[0], solid.size[0], solid.rotation[0]
    if solid.scans is not None and int(solid.scan) >= 0:
        mesh = solid.scans.meshes[int(solid.scan)]
        faces = mesh.faces.flip(-1) if float(size[0, 0]) < 0 else mesh.faces
        return Mesh(mesh.verts * size[0] @ turn[0].T + centre[0], faces)
    ring = (solid.kind[0] == TORUS)[:, None]
    outer = size[:, :2].sum(-1, keepdim=True)
    used = centre[:, 0] < FAR_AWAY / 2
    # the grid starts at the corner of the solids' bounding balls but spans their bounding boxes
    ball = torch.where(ring, outer, size.norm(dim=-1, keepdim=True)) + MARGIN
    half = torch.where(ring, torch.cat([outer, outer, size[:, 1:2]], -1), size)
    box = (turn.abs() @ half[..., None])[..., 0] + MARGIN
    corner = (centre - ball)[used].amin(0)
    first = (((centre - box)[used].amin(0) - corner) / spacing).floor().long()
    last = (((centre + box)[used].amax(0) - corner) / spacing).ceil().long()
    ends = zip(corner, first, last, strict=True)
    across, along, up = (start + spacing * torch.arange(int(a), int(b) + 1) for start, a, b in ends)
    # libigl counts x fastest
    z, y, x = torch.meshgrid(up, along, across, indexing="ij")
    grid = torch.stack([x, y, z], -1).reshape(-1, 3)
    distance = solid.signed_distance(grid[None])[0].double().numpy()
    sizes = len(across), len(along), len(up)
    verts, faces, _ = igl.marching_cubes(distance, grid.double().numpy(), *sizes)
    points = torch.from_numpy(np.ascontiguousarray(verts)).float()
    gap, normal = solid.distance_and_normal(points[None])
    points = points - (gap[..., None] * normal)[0]
    return Mesh(points, torch.from_numpy(np.ascontiguousarray(faces)).long())


def spacing_for_looks(solid: Solids) -> float:
    """A spacing in metres that resolves the thinnest solid and is fast on large objects."""
    size = solid.size[0]
    thin = torch.where(solid.kind[0] == TORUS, size[:, 1], size.amin(-1))
    thinnest = 2 * float(thin[solid.center[0, :, 0] < FAR_AWAY / 2].min())
    return min(COARSEST, max(SPACING, THICKNESS_SHARE * thinnest))
