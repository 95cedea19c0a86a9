"""The grid of coarse distances: what it says is safe, and answers with it are those without."""

import numpy as np
import pytest
import torch
import trimesh

from geneoh.geometry.coarse_distance import CELLS, CoarseDistance
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh

WITHIN = 0.005


def field_of(shape: trimesh.Trimesh) -> SurfaceDistance:
    verts = torch.tensor(np.array(shape.vertices), dtype=torch.float32)
    return SurfaceDistance(Mesh(verts, torch.tensor(np.array(shape.faces), dtype=torch.int64)))


def tool() -> trimesh.Trimesh:
    """Two shells that overlap, longer than wide."""
    head = trimesh.creation.box((0.02, 0.08, 0.02))
    handle = trimesh.creation.cylinder(0.008, 0.1, sections=16)
    handle.apply_translation([0, 0, -0.05])
    return trimesh.util.concatenate([head, handle])


def bowl() -> trimesh.Trimesh:
    """An open sheet, which gets a wall."""
    ball = trimesh.creation.icosphere(3, 0.05)
    ball.update_faces(ball.triangles_center[:, 2] < 0)
    return ball


@pytest.fixture(scope="module", params=[tool, bowl])
def field(request):
    return field_of(request.param())


def around(field: SurfaceDistance, count: int = 4 * CELLS) -> torch.Tensor:
    """Points inside of a mesh and around it, some of them beyond its grid."""
    low, size = field.solid.low - 0.015, field.solid.high - field.solid.low + 0.03
    share = torch.rand(count, 3, generator=torch.Generator().manual_seed(0))
    return (low + share * size).float()


def coarse(field: SurfaceDistance) -> CoarseDistance:
    return CoarseDistance.around(field.solid.low, field.solid.high, field._searched.exact)


def test_the_distance_is_never_less_than_the_grid_says_and_seldom_much_more(field):
    found = around(field).double()
    least, closest, normal = coarse(field).at_least(found)
    exact = field.query(found).distance
    assert (least <= exact + 1e-9).all()
    inside_the_grid = exact < 0.01
    assert (exact - least)[inside_the_grid].mean() < 0.004
    torch.testing.assert_close(normal.norm(dim=-1), torch.ones(len(normal)).double())
    assert field.query(closest).distance.abs().max() < 1e-6


def test_most_points_are_surely_inside_or_outside_and_these_are_right(field):
    found = around(field).double()
    distance = field.query(found).distance
    inside, sure = coarse(field).is_inside(found, distance.abs())
    assert sure.double().mean() > 0.8
    assert ((distance < 0) == inside)[sure].all()
    assert (distance < 0)[sure].any()


def test_near_points_are_answered_as_without_a_grid(field):
    found = around(field)
    fresh = SurfaceDistance(field.mesh)
    exact, quick = field.query(found), fresh.query(found, within=WITHIN)
    assert fresh._coarse is not None
    near = exact.distance <= WITHIN
    assert 0.02 < near.double().mean() < 0.5
    for name, value in vars(exact).items():
        torch.testing.assert_close(vars(quick)[name][near], value[near], rtol=0, atol=1e-6)
    assert (quick.distance[~near] > WITHIN).all()
    assert (quick.distance[~near] <= exact.distance[~near] + 1e-6).all()


def test_few_points_get_no_grid_which_would_take_longer_than_they(field):
    fresh = SurfaceDistance(field.mesh)
    fresh.query(around(field, 100), within=WITHIN)
    assert fresh._coarse is None
    fresh.query(around(field), within=WITHIN)
    assert fresh._coarse is not None
    assert fresh._coarse.distance.numel() <= 1.1 * CELLS


def test_the_grid_of_a_mesh_is_made_once_and_used_from_the_same_query_on(field):
    first, second = SurfaceDistance(field.mesh), SurfaceDistance(field.mesh)
    found = around(field)
    once, again = (each.query(found, within=WITHIN) for each in (first, second))
    assert first._coarse is second._coarse
    assert all(torch.equal(vars(once)[name], value) for name, value in vars(again).items())
    fresh = SurfaceDistance(field.mesh)
    fresh.query(found[:100], within=WITHIN)
    assert fresh._coarse is None


def test_points_that_are_not_finite_are_no_trouble(field):
    fresh = SurfaceDistance(field.mesh)
    found = around(field)
    found[0], found[1, 2] = torch.nan, torch.inf
    quick = fresh.query(found, within=WITHIN)
    assert not quick.distance[:2].isfinite().any()
    assert quick.distance[2:].isfinite().all()


def test_a_mesh_with_a_hole_gets_no_grid():
    ball = trimesh.creation.icosphere(3, 0.05)
    ball.update_faces(np.arange(len(ball.faces)) > 0)
    holed = field_of(ball)
    assert not holed.solid.closed
    holed.query(around(holed), within=WITHIN)
    assert holed._coarse is None
