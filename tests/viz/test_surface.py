import numpy as np
import torch
import trimesh

from geneoh.geometry.mesh import Mesh
from geneoh.viz.surface import coarser, vertex_normals, with_sharp_edges


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    return Mesh(torch.from_numpy(shape.vertices).float(), torch.from_numpy(shape.faces).long())


def test_a_cube_is_parted_along_its_edges_and_lit_side_by_side():
    cube = mesh_of(trimesh.creation.box())
    parted = with_sharp_edges(cube)
    assert len(parted.verts) == 24
    torch.testing.assert_close(parted.verts[parted.faces].sum(), cube.verts[cube.faces].sum())
    normals = vertex_normals(parted.verts.numpy(), parted.faces.numpy())
    np.testing.assert_allclose(np.abs(normals).max(1), 1, atol=1e-6)


def test_a_ball_stays_whole():
    ball = mesh_of(trimesh.creation.icosphere(3))
    assert len(with_sharp_edges(ball).verts) == len(ball.verts)


def test_a_mesh_of_too_many_faces_is_drawn_coarser_and_in_place():
    side = torch.linspace(0, 0.1, 61)
    grid = torch.cartesian_prod(side, side)
    verts = torch.cat([grid, torch.zeros(len(grid), 1)], -1)
    at = torch.arange(61 * 61).reshape(61, 61)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]
    faces = torch.cat([torch.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (b, d, c))])
    mesh = Mesh(verts, faces)
    small = coarser(mesh, 2000)
    assert 500 < len(small.faces) <= 2000
    torch.testing.assert_close(small.extent(), mesh.extent(), atol=0.004, rtol=0)
    assert coarser(mesh, 10_000) is mesh
