"""Edges of a mesh, its boundary loops, and two ways to close them."""

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from torch import Tensor

from geneoh.geometry.mesh import TINY, Mesh, tidied

SHEET_THICKNESS = 0.002  # metres of a sheet's wall: about the thinnest bowl a hand holds


def open_edges(faces: Int[Tensor, "F 3"]) -> Bool[Tensor, "F 3"]:
    """Whether edge i of each face, from its corner i to the next, belongs to no other face."""
    _, index, count = torch.unique(edge_keys(faces), return_inverse=True, return_counts=True)
    return count[index] == 1


def edges_of(faces: Int[Tensor, "F 3"]) -> Int[Tensor, "E 2"]:
    """The edges of a mesh, each once, from its lower vertex to its higher one."""
    keys, size = torch.unique(edge_keys(faces)), int(faces.max()) + 1
    return torch.stack([keys // size, keys % size], dim=-1)


def edge_keys(faces: Int[Tensor, "F 3"]) -> Int[Tensor, "F 3"]:
    """An integer key for the edge from corner i of each face to the next, in either direction.

    One integer for each edge, because sorting pairs is fifty times slower.
    """
    start, end = faces, faces.roll(-1, dims=-1)
    return torch.minimum(start, end) * (int(faces.max()) + 1) + torch.maximum(start, end)


def rims(
    faces: Int[Tensor, "F 3"], rim: Bool[Tensor, "F 3"]
) -> tuple[Int[Tensor, "E 2"], Int[Tensor, " E"]]:
    """The open edges, each from its start to its end, and the index of the opening that each
    bounds; `rim` is the result of `open_edges`."""
    edges = torch.stack([faces[rim], faces.roll(-1, dims=-1)[rim]], dim=-1)
    if not len(edges):
        return edges, edges[:, 0]
    piece = connected(edges)[edges[:, 0]]
    return edges, torch.unique(piece, return_inverse=True)[1]


def connected(edges: Int[Tensor, "E 2"]) -> Int[Tensor, " V"]:
    """Index of the connected component of each vertex, up to the highest vertex of an edge."""
    start, end = edges.cpu().int().numpy().T  # scipy before 1.12 takes 32 bits only
    size = int(edges.max()) + 1
    links = coo_array((np.ones(len(start)), (start, end)), (size, size))
    label = connected_components(links, directed=False)[1]
    return torch.from_numpy(label).to(edges)


def capped(
    verts: Float[Tensor, "*B V 3"], faces: Int[Tensor, "F 3"]
) -> tuple[Float[Tensor, "*B W 3"], Int[Tensor, "G 3"]]:
    """The mesh with each opening closed by a triangle fan around the mean of its rim.

    It closes the wrist of a MANO hand as TOCH does. It suits solids with holes, not open sheets,
    because it closes every opening.
    """
    edges, opening = rims(faces, open_edges(faces))
    if not len(edges):
        return verts, faces
    middles = [
        verts[..., torch.unique(edges[opening == hole]), :].mean(-2)
        for hole in range(int(opening.max()) + 1)
    ]
    fan = torch.stack([edges[:, 1], edges[:, 0], verts.shape[-2] + opening], dim=-1)
    closed = torch.cat([verts, torch.stack(middles, dim=-2)], dim=-2)
    return closed, torch.cat([faces, fan])


def thickened(mesh: Mesh, thickness: float = SHEET_THICKNESS) -> Mesh:
    """A closed wall around an open sheet: half the thickness to either side, joined at the rims.

    The sheet's faces must share vertices and have consistent orientation. The wall is centred,
    because the outer side is unknown and the result must commute with mirroring. Unused vertices
    are dropped.
    """
    sheet = tidied(mesh)
    faces = sheet.faces
    across = sheet.face_vectors().double()
    normals = torch.zeros_like(sheet.verts, dtype=torch.float64)
    for corner in range(3):
        normals.index_add_(0, faces[:, corner], across)
    shift = torch.nn.functional.normalize(normals, dim=-1, eps=TINY).to(sheet.verts) * thickness / 2
    rim = open_edges(faces)
    start, end, count = faces[rim], faces.roll(-1, dims=-1)[rim], len(sheet.verts)
    corners = (end, start, start + count), (end, start + count, end + count)
    stitches = [torch.stack(each, -1) for each in corners]
    verts = torch.cat([sheet.verts + shift, sheet.verts - shift])
    return Mesh(verts, torch.cat([faces, faces.flip(-1) + count, *stitches]))
