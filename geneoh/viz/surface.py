"""Meshes made ready for drawing: coarse enough, with sharp edges, with normals."""

import numpy as np
import torch
from jaxtyping import Float, Int

from geneoh.geometry.mesh import Mesh
from geneoh.interrupts import interrupts_wait

with interrupts_wait():
    import igl
    import trimesh

SHARP_ANGLE = np.deg2rad(50.0)  # faces that meet at more do not share normals, radians


def vertex_normals(
    verts: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "V 3"]:
    """Unit normals averaged over the faces around each vertex by area; zero without any face."""
    by_area = igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_AREA
    normals = igl.per_vertex_normals(verts.astype(np.float64), faces.astype(np.int64), by_area)
    return np.nan_to_num(normals).astype(np.float32)


def with_sharp_edges(mesh: Mesh) -> Mesh:
    """The same surface with vertices duplicated along sharp edges, where normals must not blend.

    Each region without an inner sharp edge gets vertices of its own. trimesh's `smooth_shade` also
    splits large flat faces, and takes ten times as long on a noisy scan of 300,000 faces.
    """
    whole = trimesh.Trimesh(mesh.verts.detach().numpy(), mesh.faces.numpy(), process=False)
    smooth = whole.face_adjacency[whole.face_adjacency_angles <= SHARP_ANGLE]
    part = trimesh.graph.connected_component_labels(smooth, node_count=len(whole.faces))
    count = len(mesh.verts)
    kept, faces = np.unique(part[:, None] * count + whole.faces, return_inverse=True)
    return Mesh(mesh.verts[torch.from_numpy(kept % count)], torch.from_numpy(faces).view(-1, 3))


def coarser(mesh: Mesh, most: int) -> Mesh:
    """A mesh of at most `most` faces: vertices in one cell of a grid become their mean.

    For drawing only. A mesh that has few enough faces is returned as it is.
    """
    cells = 256.0
    while len(mesh.faces) > most:
        cell = (mesh.verts - mesh.verts.amin(0)) / float(mesh.extent().max()) * cells
        # one key for each cell: `unique` over rows of three is slower
        key = (cell.long() * torch.tensor([1 << 18, 1 << 9, 1])).sum(-1)
        _, group = torch.unique(key, return_inverse=True)
        count = torch.bincount(group)
        verts = torch.zeros(len(count), 3).index_add_(0, group, mesh.verts) / count[:, None]
        a, b, c = group[mesh.faces].unbind(-1)
        faces = torch.stack([a, b, c], -1)[(a != b) & (b != c) & (c != a)]
        mesh, cells = Mesh(verts, faces), cells * 0.8
    return mesh
