import pytest
import torch

from geneoh.geometry.oriented_points import signed_to_points


def sphere(count: int = 1024, radius: float = 0.05) -> tuple[torch.Tensor, torch.Tensor]:
    """Points of a sphere, evenly on a spiral, and their normals."""
    height = 1 - 2 * (torch.arange(count) + 0.5) / count
    angle = torch.arange(count) * 2.399963
    across = (1 - height**2).sqrt()
    normals = torch.stack([across * angle.cos(), across * angle.sin(), height], -1)
    return radius * normals, normals


def sheet(thickness: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Both sides of a plate, with points 6 mm apart, those of one side between the other's."""
    line = torch.arange(-5, 6) * 0.006
    above = torch.cat([torch.cartesian_prod(line, line), torch.zeros(121, 1)], -1)
    below = above + torch.tensor([0.003, 0.003, -thickness])
    normals = torch.tensor([[0.0, 0, 1]]).expand(121, 3)
    return torch.cat([above, below]), torch.cat([normals, -normals])


@pytest.mark.parametrize("radius", [0.04, 0.047, 0.05, 0.053, 0.06])
def test_distance_to_a_sphere_is_the_difference_of_the_radii(radius: float):
    points, normals = sphere()
    query = sphere(333, radius)[0]
    found, index = signed_to_points(query[None], points[None], normals[None], within=0.02)
    assert torch.allclose(found[0], torch.full((333,), radius - 0.05), atol=7e-4)
    assert (points[index[0]] - query).norm(dim=-1).amax() < 0.02


@pytest.mark.parametrize("height", [0.0005, 0.002, 0.005])
def test_other_side_of_a_thin_wall_says_nothing(height: float):
    points, normals = sheet(0.002)
    query = torch.rand(50, 3, generator=torch.Generator().manual_seed(0)) * 0.04 - 0.02
    query[:, 2] = height
    found, index = signed_to_points(query[None], points[None], normals[None], within=0.01)
    assert torch.allclose(found, torch.full_like(found, height), atol=1e-6)
    assert (normals[index[0], 2] == 1).all()


def test_beside_the_edge_of_a_thin_plate_is_outside():
    points, normals = sheet(0.002)
    query = torch.tensor([[0.05, 0.0, -0.001], [0.05, 0.0, 0.001], [0.0, 0.0, -0.001]])
    found, _ = signed_to_points(query[None], points[None], normals[None], within=0.03)
    assert found[0].tolist() == pytest.approx([0.017, 0.02, -0.001], abs=1e-3)


def test_deep_inside_is_as_deep_as_the_nearest_side():
    points, normals = sphere()
    found, _ = signed_to_points(torch.zeros(1, 1, 3), points[None], normals[None], within=0.06)
    assert found.item() == pytest.approx(-0.05, abs=1e-4)


def test_far_queries_and_absent_ones_are_infinitely_far():
    points, normals = sphere()
    query = torch.tensor([[0.0, 0.0, 0.08], [torch.nan, 0.0, 0.0]])
    found, index = signed_to_points(query[None], points[None], normals[None], within=0.02)
    assert found.isinf().all()
    assert (index == 0).all()


def test_each_set_of_a_batch_has_its_own_points():
    points, normals = sphere()
    query = torch.tensor([[0.0, 0.0, 0.055]]).expand(2, 1, 3)
    away = torch.stack([points, points + torch.tensor([0.0, 0.0, 0.01])])
    found, _ = signed_to_points(query, away, normals.expand(2, -1, 3), within=0.02)
    assert found[:, 0].tolist() == pytest.approx([0.005, -0.005], abs=7e-4)
