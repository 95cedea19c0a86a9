import numpy as np
import pytest
import torch
import trimesh

from geneoh.geometry.distance import MovingSurface, SurfaceDistance, SurfaceQuery
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.rotations import axis_angle_to_matrix

MICROMETRE = 1e-6
MIDDLES = (0.1 / 6, -0.1 / 6)
"""Where the two triangles of a square of 10 cm have their middles: at (x, -x)."""


def scattered(*shape: int, seed: int = 0, scale: float = 0.1) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return (torch.rand(*shape, 3, generator=generator) * 2 - 1) * scale


def along_normals(found: SurfaceQuery, points: torch.Tensor) -> torch.Tensor:
    """The distance as closest points and normals tell it."""
    return ((points - found.closest) * found.normal).sum(-1)


@pytest.fixture(scope="module")
def tool():
    """Two shells that overlap: a hammer."""
    head = trimesh.creation.box((0.02, 0.08, 0.02)).subdivide()
    handle = trimesh.creation.cylinder(0.008, 0.1, sections=16).subdivide_to_size(0.006)
    handle.apply_translation([0, 0, -0.05])
    return from_trimesh(trimesh.util.concatenate([head, handle]))


def closest_on_triangle(point: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The slow, obvious way: the projection where it falls inside, else the nearest edge point."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    projected = point - normal * ((point - a) @ normal) / (normal @ normal)
    sides = [np.cross(q - p, projected - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
    if min(sides) >= 0:
        return projected
    on_edges = []
    for p, q in ((a, b), (b, c), (c, a)):
        share = np.clip((point - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
        on_edges.append(p + share * (q - p))
    return min(on_edges, key=lambda edge: np.linalg.norm(edge - point))


def winding_number(point: np.ndarray, corners: np.ndarray) -> float:
    """Solid angle of every triangle, summed (Van Oosterom and Strackee 1983)."""
    total = 0.0
    for a, b, c in corners - point:
        la, lb, lc = (np.linalg.norm(v) for v in (a, b, c))
        below = la * lb * lc + (a @ b) * lc + (b @ c) * la + (c @ a) * lb
        total += 2 * np.arctan2(a @ np.cross(b, c), below)
    return total / (4 * np.pi)


def test_a_mesh_that_comes_again_has_the_tree_of_before_until_it_changes():
    mesh = from_trimesh(trimesh.creation.icosphere(2, radius=0.05))
    again = from_trimesh(trimesh.creation.icosphere(2, radius=0.05))
    assert SurfaceDistance(mesh).tree is SurfaceDistance(again).tree
    mesh.verts.mul_(2)
    assert SurfaceDistance(mesh).query(torch.zeros(1, 3)).distance.item() < -0.09


def test_query_agrees_with_the_slow_twin():
    mesh = from_trimesh(trimesh.creation.torus(0.05, 0.02, major_sections=10, minor_sections=6))
    points = scattered(15, scale=0.07)
    found = SurfaceDistance(mesh).query(points)
    corners = mesh.corners().double().numpy()
    for i, point in enumerate(points.double().numpy()):
        nearest = min(
            (closest_on_triangle(point, triangle) for triangle in corners),
            key=lambda q: np.linalg.norm(q - point),
        )
        sign = -1 if abs(winding_number(point, corners)) > 0.5 else 1
        assert float(found.distance[i]) == pytest.approx(
            sign * np.linalg.norm(point - nearest), abs=MICROMETRE
        )
        np.testing.assert_allclose(found.closest[i], nearest, atol=MICROMETRE)


def test_distance_to_sphere_is_radius_difference():
    field = SurfaceDistance(from_trimesh(trimesh.creation.icosphere(4, 0.05)))
    points = scattered(2, 50)
    found = field.query(points)
    radius = points.norm(dim=-1)
    torch.testing.assert_close(found.distance, radius - 0.05, atol=1e-4, rtol=0)
    off_centre = radius > 0.01
    radial = (points / radius[..., None] * found.normal).sum(-1)
    assert float(radial[off_centre].min()) > 0.99
    assert found.distance.dtype == torch.float32


def test_depth_in_a_cube_is_that_of_its_nearest_side():
    field = SurfaceDistance(from_trimesh(trimesh.creation.box((0.1, 0.1, 0.1))))
    found = field.query(torch.tensor([[0.04, 0.0, 0.01], [0.0, -0.08, 0.0], [0.09, 0.08, 0.05]]))
    torch.testing.assert_close(found.distance, torch.tensor([-0.01, 0.03, 0.05]))
    torch.testing.assert_close(
        found.normal, torch.tensor([[1.0, 0, 0], [0, -1, 0], [0.8, 0.6, 0]]), atol=1e-6, rtol=0
    )
    torch.testing.assert_close(found.closest[0], torch.tensor([0.05, 0.0, 0.01]))


def test_normal_is_the_finite_difference_of_the_distance(tool):
    field = SurfaceDistance(tool)
    points = scattered(400).double()
    step = 1e-7
    slopes = [
        (field.query(points + step * axis).distance - field.query(points - step * axis).distance)
        / (2 * step)
        for axis in torch.eye(3).double()
    ]
    error = (torch.stack(slopes, -1) - field.query(points).normal).norm(dim=-1)
    # The rest stand on a crease, where two surface points are equally near.
    assert float((error < 1e-4).double().mean()) > 0.98


def test_points_on_the_surface_have_distance_zero_and_the_normal_of_the_face():
    ball = trimesh.creation.icosphere(3, 0.05)
    ball.invert()
    points = torch.tensor(ball.triangles_center)
    found = SurfaceDistance(from_trimesh(ball)).query(points)
    assert float(found.distance.abs().max()) < 1e-8
    outward = -torch.tensor(np.array(ball.face_normals))
    torch.testing.assert_close(found.normal, outward, atol=1e-4, rtol=0)


def test_normals_are_unit_and_finite_everywhere(tool):
    for points in (scattered(500), tool.verts, torch.zeros(1, 3)):
        normal = SurfaceDistance(tool).query(points).normal
        torch.testing.assert_close(normal.norm(dim=-1), torch.ones(len(points)))


def test_depth_where_shells_overlap_is_to_the_outside(tool):
    found = SurfaceDistance(tool).query(torch.tensor([[0.0, 0.0, 0.0]]))
    torch.testing.assert_close(found.distance, torch.tensor([-0.01]), atol=MICROMETRE, rtol=0)


def test_a_large_face_that_a_part_pierces_stays_a_surface():
    block = trimesh.creation.box((0.1, 0.1, 0.02))
    through = [trimesh.creation.cylinder(0.005, 0.1).apply_translation([x, -x, 0]) for x in MIDDLES]
    field = SurfaceDistance(from_trimesh(trimesh.util.concatenate([block, *through])))
    found = field.query(torch.tensor([[0.04, 0.04, 0.015], [-0.04, 0.04, 0.005]]))
    torch.testing.assert_close(found.distance, torch.tensor([0.005, -0.005]))


def test_batch_axes_are_free(tool):
    field, points = SurfaceDistance(tool), scattered(2, 3, 4)
    together = field.query(points)
    assert together.distance.shape == (2, 3, 4)
    one = field.query(points[1, 2])
    assert torch.equal(together.normal[1, 2], one.normal)
    assert field.query(points[:, :, :0]).distance.shape == (2, 3, 0)


def test_points_that_are_not_finite_stay_so_and_harm_no_other(tool):
    points = scattered(3)
    points[1, 0] = torch.nan
    distance = SurfaceDistance(tool).query(points).distance
    assert distance.isfinite().tolist() == [True, False, True]


def test_broad_phase_is_exact_near_and_a_lower_bound_far(tool):
    field, points = SurfaceDistance(tool), scattered(1000, scale=0.3)
    exact, quick = field.query(points), field.query(points, within=0.02)
    same = quick.distance == exact.distance
    assert bool(same[exact.distance <= 0.02].all())
    assert bool((quick.distance <= exact.distance + MICROMETRE).all())
    assert float(quick.distance[~same].min()) > 0.02
    torch.testing.assert_close(quick.normal.norm(dim=-1), torch.ones(1000))
    torch.testing.assert_close(
        along_normals(quick, points), quick.distance, atol=MICROMETRE, rtol=0
    )


def test_gradient_of_the_distance_is_the_normal(tool):
    field, points = SurfaceDistance(tool), scattered(6, 5).requires_grad_()
    distance = along_normals(field.query(points), points)
    torch.testing.assert_close(distance, field.query(points).distance, atol=MICROMETRE, rtol=0)
    (gradient,) = torch.autograd.grad(distance.sum(), points)
    torch.testing.assert_close(gradient, field.query(points).normal)


def test_mirrored_mesh_gives_mirrored_answers(tool):
    flip = torch.tensor([-1.0, 1.0, 1.0])
    bowl = trimesh.creation.icosphere(3, 0.06)
    bowl.update_faces(bowl.triangles_center[:, 2] < 0)
    for mesh in (tool, from_trimesh(bowl)):
        points = scattered(200)
        found = SurfaceDistance(mesh).query(points)
        mirrored = SurfaceDistance(mesh.mirrored()).query(points * flip)
        torch.testing.assert_close(mirrored.distance, found.distance, atol=MICROMETRE, rtol=0)


def test_hand_in_an_open_bowl_is_outside_it_until_it_meets_the_wall():
    bowl = trimesh.creation.icosphere(5, 0.06)
    bowl.update_faces(bowl.triangles_center[:, 2] < 0)
    depth = torch.tensor([0.0, 0.03, 0.055, 0.0600, 0.065])
    found = SurfaceDistance(from_trimesh(bowl)).query(depth[:, None] * torch.tensor([0.0, 0, -1]))
    expected = torch.tensor([0.059, 0.029, 0.004, -0.001, 0.004])
    torch.testing.assert_close(found.distance, expected, atol=5e-5, rtol=0)


def random_motion(frames: int, parts: int, seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    rotation = axis_angle_to_matrix(scattered(frames, parts, seed=seed, scale=3.0))
    return rotation, scattered(frames, parts, seed=seed + 1)


def test_distance_moves_rigidly_with_the_object(tool):
    field, points = SurfaceDistance(tool), scattered(4, 30)
    rotation, translation = random_motion(4, 1, seed=5)
    world = points @ rotation[:, 0].mT + translation
    found, rest = MovingSurface((field,), rotation, translation).query(world), field.query(points)
    torch.testing.assert_close(found.distance, rest.distance, atol=MICROMETRE, rtol=0)
    moved = rest.closest @ rotation[:, 0].mT + translation
    torch.testing.assert_close(found.closest, moved, atol=MICROMETRE, rtol=0)
    torch.testing.assert_close(along_normals(found, world), found.distance, atol=MICROMETRE, rtol=0)


def test_the_nearest_part_answers(tool):
    ball = SurfaceDistance(from_trimesh(trimesh.creation.icosphere(2, 0.03)))
    rotation, translation = random_motion(3, 2, seed=7)
    points = scattered(2, 3, 20)
    both = MovingSurface((SurfaceDistance(tool), ball), rotation, translation).query(points)
    alone = [
        MovingSurface((field,), rotation[:, [i]], translation[:, [i]]).query(points)
        for i, field in enumerate((SurfaceDistance(tool), ball))
    ]
    assert torch.equal(both.distance, torch.minimum(alone[0].distance, alone[1].distance))
    torch.testing.assert_close(along_normals(both, points), both.distance, atol=MICROMETRE, rtol=0)
