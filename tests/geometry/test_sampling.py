import numpy as np
import pytest
import torch
import trimesh
from draws import seeded

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.sampling import sample_surface
from geneoh.geometry.solid import build_solid


def ragged_box() -> trimesh.Trimesh:
    """A box whose +x side has far more and smaller triangles than the others."""
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    return box.subdivide(face_index=np.flatnonzero(box.face_normals[:, 0] > 0.9)).subdivide()


def test_equal_generators_draw_equal_points():
    mesh = from_trimesh(trimesh.creation.icosphere(2, 0.05))
    first, second = (sample_surface(mesh, 50, generator=seeded(3)) for _ in range(2))
    assert torch.equal(first.points, second.points)
    assert torch.equal(first.normals, second.normals)
    other = sample_surface(mesh, 50, generator=seeded(4))
    assert not torch.equal(first.points, other.points)


def test_points_fall_on_each_side_by_its_area():
    samples = sample_surface(from_trimesh(ragged_box()), 6000, generator=seeded())
    side = samples.points.abs().argmax(-1) * 2 + (samples.points.amax(-1) > 0.0499)
    count = torch.bincount(side, minlength=6)
    assert bool(((count - 1000).abs() < 60).all())
    assert samples.points.mean(0).abs().max() < 2e-3


def test_points_are_even_within_a_triangle():
    corners = torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 1e-5]])
    thin = Mesh(corners, torch.tensor([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    points = sample_surface(thin, 4000, generator=seeded()).points
    torch.testing.assert_close(points.mean(0)[:2], torch.full((2,), 0.1 / 3), atol=1e-3, rtol=0)
    assert float((points[:, :2].sum(-1) < 0.05).float().mean()) == pytest.approx(0.25, abs=0.02)


@pytest.mark.parametrize("inverted", [False, True])
def test_normals_point_out_of_the_solid(inverted):
    ball = trimesh.creation.icosphere(4, 0.05)
    if inverted:
        ball.invert()
    samples = sample_surface(from_trimesh(ball), 200, generator=seeded())
    radial = torch.nn.functional.normalize(samples.points, dim=-1)
    assert float((samples.normals * radial).sum(-1).min()) > 0.99
    torch.testing.assert_close(samples.normals.norm(dim=-1), torch.ones(200))


def test_points_of_an_open_bowl_lie_where_its_distance_is_zero():
    bowl = trimesh.creation.icosphere(3, 0.06)
    bowl.update_faces(bowl.triangles_center[:, 2] < 0)
    samples = sample_surface(from_trimesh(bowl), 300, generator=seeded())
    field = SurfaceDistance(from_trimesh(bowl))
    assert float(field.query(samples.points).distance.abs().max()) < 1e-6
    ahead = field.query(samples.points + 3e-4 * samples.normals).distance
    assert float(ahead.min()) > 0


def test_a_solid_that_is_there_already_gives_the_same_points():
    mesh = from_trimesh(trimesh.creation.icosphere(2, 0.05))
    once = sample_surface(mesh, 20, generator=seeded())
    again = sample_surface(build_solid(mesh), 20, generator=seeded())
    assert torch.equal(once.points, again.points)
