import pytest
import torch
import trimesh

from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.mesh_files import from_trimesh

BALL = from_trimesh(trimesh.creation.icosphere(4, 0.05))
SHIFTS = torch.tensor([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]])


@pytest.fixture(scope="module")
def ball() -> ChangingSurface:
    """A ball of 5 cm that jumps by 2 cm."""
    return ChangingSurface(BALL.verts + SHIFTS[:, None], BALL.faces)


def test_points_inside_know_their_depth_and_the_nearest_way_out_in_their_frame(ball):
    found = ball.query(torch.tensor([[[0.0, 0.0, 0.04]], [[0.06, 0.0, 0.0]]]))
    torch.testing.assert_close(found.distance, torch.tensor([[-0.01], [-0.01]]), atol=1e-4, rtol=0)
    out = torch.tensor([[[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]])
    torch.testing.assert_close(found.normal, out, atol=0.05, rtol=0)
    exits = torch.tensor([[[0.0, 0.0, 0.05]], [[0.07, 0.0, 0.0]]])
    torch.testing.assert_close(found.closest, exits, atol=2e-3, rtol=0)


def test_points_outside_are_infinitely_far_where_they_are(ball):
    points = torch.tensor([[[0.049, 0.049, 0.049]], [[-0.04, 0.0, 0.0]]])
    found = ball.query(points)
    assert torch.isinf(found.distance).all()
    assert torch.equal(found.closest, points)


def test_samples_of_points_share_the_frames(ball):
    points = torch.randn(3, 2, 40, 3, generator=torch.Generator().manual_seed(0)) * 0.03
    found = ball.query(points)
    for sample in range(3):
        assert torch.equal(found.distance[sample], ball.query(points[sample]).distance)


def test_rays_leave_at_the_far_side(ball):
    start, ahead = torch.tensor([[0.0, 0.0, 0.04]] * 2), torch.tensor([[0.0, 0.0, -1.0]] * 2)
    reach, normal = ball.exits(torch.tensor([0, 0]), start, ahead)
    torch.testing.assert_close(reach, torch.tensor([0.09, 0.09]), atol=1e-3, rtol=0)
    torch.testing.assert_close(normal, ahead, atol=0.1, rtol=0)


def test_a_hole_of_the_wrist_counts_as_closed(ball):
    low = BALL.verts[BALL.faces].mean(1)[:, 2] > -0.045
    open_ = ChangingSurface(ball.verts, BALL.faces[low])
    found = open_.query(torch.zeros(2, 1, 3)).distance
    torch.testing.assert_close(found, torch.tensor([[-0.05], [-0.03]]), atol=1e-3, rtol=0)


def test_the_mirror_image_is_as_deep(ball):
    points = torch.tensor([[[-0.03, 0.0, 0.0]], [[-0.06, 0.0, 0.0]]])
    mirrored = ball.mirrored().query(points)
    again = ball.query(points * torch.tensor([-1.0, 1.0, 1.0]))
    torch.testing.assert_close(mirrored.distance, again.distance)
    assert float(mirrored.normal[1, 0, 0]) < -0.9
