import pytest
import torch
from draws import normal

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation import nearest_surface
from geneoh.representation.nearest_surface import (
    nearest_in_tree,
    nearest_of_all,
    nearest_on_parts,
    nearest_points,
)
from geneoh.representation.region import ObjectSurface


@pytest.mark.parametrize("away", [0.0, 3.0])
def test_the_nearest_point_is_that_of_a_slow_search(away):
    joints, points = 0.1 * normal(3, 7, 3) + away, 0.1 * normal(3, 50, 3, seed=1) + away
    normals = torch.nn.functional.normalize(normal(3, 50, 3, seed=2), dim=-1)
    nearest, outward = nearest_points(joints, points, normals)
    for b in range(3):
        for j in range(7):
            at = int((points[b].double() - joints[b, j].double()).norm(dim=-1).argmin())
            assert torch.equal(nearest[b, j], points[b, at])
            assert torch.equal(outward[b, j], normals[b, at])


def test_a_search_without_a_tree_finds_the_same_points_however_many_are_held_at_once(monkeypatch):
    joints, points = 0.1 * normal(3, 7, 3), 0.1 * normal(3, 50, 3, seed=1)
    for most in (nearest_surface.MOST_DISTANCES, 3 * 50 * 2):
        monkeypatch.setattr(nearest_surface, "MOST_DISTANCES", most)
        assert torch.equal(nearest_of_all(joints, points), nearest_in_tree(joints, points))


def test_on_parts_it_is_the_nearest_of_all_points_placed_in_the_world():
    """The first object is rigid, the second has a part that moves, the third's is all of it."""
    frames = 5
    points, joints = 0.1 * normal(3, 40, 3), 0.1 * normal(3, frames, 6, 3, seed=1)
    normals = torch.nn.functional.normalize(normal(3, 40, 3, seed=2), dim=-1)
    part = torch.zeros(3, 40, dtype=torch.long)
    part[1, 15:], part[2] = 1, 1
    rotation = axis_angle_to_matrix(normal(3, frames, 2, 3, seed=3))
    translation = 0.05 * normal(3, frames, 2, 3, seed=4)
    surface = ObjectSurface(points, normals, part, rotation, translation)
    nearest, outward, on = nearest_on_parts(joints, surface)
    world, facing = surface.in_world()
    index = torch.cdist(joints, world).argmin(-1)
    assert torch.equal(on, part[:, None].expand(-1, frames, -1).gather(2, index))
    at = index[..., None].expand(-1, -1, -1, 3)
    torch.testing.assert_close(nearest, world.gather(2, at), atol=1e-5, rtol=0)
    torch.testing.assert_close(outward, facing.gather(2, at), atol=1e-5, rtol=0)
