import math

import pytest
import torch
import trimesh

from geneoh.geometry.reconstruction import mesh_of_points, winding_number


def sphere(count: int = 1024, radius: float = 0.05) -> tuple[torch.Tensor, torch.Tensor]:
    """Points of a sphere, evenly on a spiral, and their normals."""
    height = 1 - 2 * (torch.arange(count) + 0.5) / count
    angle = torch.arange(count) * 2.399963
    across = (1 - height**2).sqrt()
    normals = torch.stack([across * angle.cos(), across * angle.sin(), height], -1)
    return radius * normals, normals


def test_winding_number_is_one_inside_and_zero_outside():
    points, normals = sphere()
    inside, outside = 0.6 * points[::50], 1.5 * points[::50]
    assert torch.allclose(winding_number(inside, points, normals), torch.ones(21), atol=0.2)
    assert torch.allclose(winding_number(outside, points, normals), torch.zeros(21), atol=0.02)


def test_mesh_of_a_sphere_is_closed_and_has_its_volume():
    mesh = mesh_of_points(*sphere())
    whole = trimesh.Trimesh(mesh.verts.numpy(), mesh.faces.numpy())
    assert whole.is_watertight
    assert whole.volume == pytest.approx(4 / 3 * math.pi * 0.05**3, rel=0.1)
    assert (mesh.verts.norm(dim=-1) - 0.05).abs().max() < 0.004


def test_two_spheres_make_two_bodies():
    points, normals = sphere()
    apart = torch.tensor([0.15, 0.0, 0.0])
    mesh = mesh_of_points(torch.cat([points, points + apart]), torch.cat([normals, normals]))
    whole = trimesh.Trimesh(mesh.verts.numpy(), mesh.faces.numpy())
    assert whole.body_count == 2
