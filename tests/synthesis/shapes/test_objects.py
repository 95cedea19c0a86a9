from dataclasses import fields, replace

import pytest
import torch
from draws import seeded
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.synthesis.shapes.families import FAMILIES, JOINTED_FAMILIES
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.solids import BOX, CYLINDER, ELLIPSOID, FAR_AWAY, TORUS, Solids


def around(count: int = 400, size: float = 0.06, seed: int = 0) -> Tensor:
    """Points inside and outside of solids of a few centimetres."""
    return size * torch.randn(1, count, 3, generator=seeded(seed))


def slow_box(p: Tensor, h: Tensor) -> float:
    """Distance to the nearest point of the box; inside, to the nearest of its six sides."""
    nearest = torch.maximum(torch.minimum(p, h), -h)
    outside = float((p - nearest).norm())
    return outside if outside > 0 else -min(float(h[i] - p[i].abs()) for i in range(3))


def slow_cylinder(p: Tensor, radius: float, half: float) -> float:
    """Side, end or rim, whichever is nearest."""
    r, z = float(p[:2].norm()), float(p[2].abs())
    if r <= radius and z <= half:
        return -min(radius - r, half - z)
    if r <= radius:
        return z - half
    if z <= half:
        return r - radius
    return ((r - radius) ** 2 + (z - half) ** 2) ** 0.5


def test_distance_to_a_box_is_that_to_its_nearest_point(make_solid):
    half = torch.tensor([0.03, 0.05, 0.02])
    points = around()
    want = [slow_box(p, half) for p in points[0]]
    got = make_solid(BOX, (0.03, 0.05, 0.02)).signed_distance(points)[0]
    torch.testing.assert_close(got, torch.tensor(want), atol=1e-6, rtol=0)
    assert 20 < int((got < 0).sum()) < 380, "points on both sides"


def test_distance_to_a_cylinder_is_that_to_side_end_or_rim(make_solid):
    points = around()
    want = [slow_cylinder(p, 0.04, 0.03) for p in points[0]]
    got = make_solid(CYLINDER, (0.04, 0.04, 0.03)).signed_distance(points)[0]
    torch.testing.assert_close(got, torch.tensor(want), atol=1e-6, rtol=0)


def test_distance_to_a_torus_is_that_to_its_ring_less_the_tube(make_solid):
    points = around()
    x, y, z = points[0].unbind(-1)
    ring = torch.hypot(torch.hypot(x, y) - 0.05, z)
    got = make_solid(TORUS, (0.05, 0.01, 1.0)).signed_distance(points)[0]
    torch.testing.assert_close(got, ring - 0.01, atol=1e-6, rtol=0)


@pytest.mark.parametrize("kind", [BOX, CYLINDER])
def test_rounding_is_the_distance_to_a_smaller_solid_less_a_radius(make_solid, kind):
    points = around()
    rounded = make_solid(kind, (0.03, 0.03, 0.05), rounding=0.01).signed_distance(points)
    core = make_solid(kind, (0.02, 0.02, 0.04)).signed_distance(points)
    torch.testing.assert_close(rounded, core - 0.01, atol=1e-6, rtol=0)


def test_an_ellipsoid_of_equal_axes_is_a_ball(make_solid):
    points = around()
    got = make_solid(ELLIPSOID, (0.04, 0.04, 0.04)).signed_distance(points)
    torch.testing.assert_close(got, points.norm(dim=-1) - 0.04, atol=1e-6, rtol=0)


def test_an_ellipsoid_is_zero_with_its_normal_on_the_surface_and_signed_around_it(make_solid):
    axes = torch.tensor([0.02, 0.03, 0.05])
    ball = torch.nn.functional.normalize(around(), dim=-1)
    normal = torch.nn.functional.normalize(ball / axes, dim=-1)
    solid = make_solid(ELLIPSOID, tuple(axes.tolist()))
    distance, got = solid.distance_and_normal(ball * axes)
    assert float(distance.abs().max()) < 1e-7
    torch.testing.assert_close(got, normal, atol=1e-4, rtol=0)
    # to first order it is the distance along the normal
    for step in (-0.0005, 0.0005):
        near = solid.signed_distance(ball * axes + step * normal)
        torch.testing.assert_close(near, torch.full_like(near, step), atol=5e-5, rtol=0)


def test_a_union_is_as_near_as_its_nearest_part(make_solid):
    one = make_solid(BOX, (0.02, 0.03, 0.01))
    two = make_solid(TORUS, (0.04, 0.01, 1.0), center=(0.05, 0.0, 0.0))
    solids = ("kind", "size", "rounding", "center", "rotation")
    both = replace(
        one,
        **{n: torch.cat([getattr(one, n)[:, :1], getattr(two, n)[:, :3]], dim=1) for n in solids},
    )
    points = around()
    want = torch.minimum(one.signed_distance(points), two.signed_distance(points))
    torch.testing.assert_close(both.signed_distance(points), want)


def test_a_posed_solid_is_the_solid_in_its_own_frame(make_solid):
    plain = make_solid(CYLINDER, (0.02, 0.02, 0.06), rounding=0.003)
    turn = axis_angle_to_matrix(torch.tensor([0.4, -1.0, 2.0]))
    shift = torch.tensor([0.02, -0.01, 0.03])
    center = plain.center.clone()
    center[:, 0] = shift
    posed = replace(plain, center=center, rotation=turn.expand(1, 4, 3, 3))
    points = around()
    torch.testing.assert_close(
        posed.signed_distance(points @ turn.T + shift), plain.signed_distance(points)
    )


@pytest.mark.parametrize("family", FAMILIES)
def test_normals_are_finite_difference_gradients(family):
    solids = draw_objects([family], generator=seeded(1))
    points = around(60)
    distance, normal = solids.distance_and_normal(points)
    step = 2e-4
    slopes = torch.stack(
        [
            (solids.signed_distance(points + e) - solids.signed_distance(points - e)) / (2 * step)
            for e in step * torch.eye(3)
        ],
        dim=-1,
    )
    slopes = torch.nn.functional.normalize(slopes, dim=-1)
    agree = (slopes * normal).sum(-1)
    # creases, where two features are equally near, have no gradient; few points lie on one
    assert float((agree > 0.999).float().mean()) > 0.9
    assert not distance.requires_grad
    assert not normal.requires_grad


@pytest.mark.parametrize("family", FAMILIES)
def test_surface_points_lie_on_the_surface_and_look_outward(family):
    solids = draw_objects([family, family], generator=seeded(2))
    points, normals = solids.surface_points(48, generator=seeded(3))
    assert points.shape == normals.shape == (2, 48, 3)
    assert float(solids.signed_distance(points).abs().max()) < 1e-5
    torch.testing.assert_close(normals.norm(dim=-1), torch.ones(2, 48))
    outside = solids.signed_distance(points + 5e-4 * normals)
    assert float((outside > 3e-4).float().mean()) > 0.9, "crevices of unions excepted"


@pytest.mark.parametrize(("family", "least"), [("mug", 0.03), ("loop_tool", 0.15), ("pan", 0.15)])
def test_surface_points_reach_every_part_of_a_union(family, least):
    solids = draw_objects([family], generator=seeded(4))
    points, _ = solids.surface_points(200, generator=seeded(5))
    for part in range(int((solids.center[0, :, 0] < FAR_AWAY).sum())):
        others = torch.arange(4)[:, None] != part
        alone = replace(solids, center=torch.where(others, FAR_AWAY, solids.center))
        on_part = (alone.signed_distance(points).abs() < 1e-5).float().mean()
        assert float(on_part) > least


def test_objects_are_of_the_size_of_things_people_hold():
    names = [name for name in FAMILIES for _ in range(4)]
    solids = draw_objects(names, generator=seeded(6))
    points, _ = solids.surface_points(64, generator=seeded(7))
    extent = (points.amax(1) - points.amin(1)).sort(-1).values
    assert float(extent[:, 2].min()) > 0.02
    assert float(extent[:, 2].max()) < 0.45


def test_objects_and_points_depend_on_the_generator_alone():
    first, second, other = (
        draw_objects(["mug", "cluster"], generator=seeded(s)) for s in (8, 8, 9)
    )
    for field in fields(Solids):
        if field.name == "scans":
            continue
        assert torch.equal(getattr(first, field.name), getattr(second, field.name))
    assert not torch.equal(first.size, other.size)
    points = [first.surface_points(16, generator=seeded(s))[0] for s in (1, 1, 2)]
    assert torch.equal(points[0], points[1])
    assert not torch.equal(points[0], points[2])


def test_jointed_families_have_a_second_part_and_others_none():
    solids = draw_objects(list(FAMILIES), generator=seeded(10))
    assert {name for name, two in zip(FAMILIES, solids.jointed, strict=True) if two} == set(
        JOINTED_FAMILIES
    )
    room = solids.travel[:, 1] - solids.travel[:, 0]
    assert torch.equal(room > 0, solids.jointed)
    assert bool((solids.travel[:, 0] <= 0).all())
    assert bool((solids.travel[:, 1] >= 0).all())


@pytest.mark.parametrize("family", FAMILIES)
def test_two_parts_together_are_the_object(family):
    solids, points = draw_objects([family], generator=seeded(11)), around()
    both = torch.minimum(*(solids.only(part).signed_distance(points) for part in range(2)))
    torch.testing.assert_close(both, solids.signed_distance(points))
    part = solids.nearest_part(points)
    assert bool(part.any()) == (family in JOINTED_FAMILIES)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_mirrored_object_is_as_far_from_mirrored_points(family):
    solids, points = draw_objects([family], generator=seeded(12)), around()
    flip = torch.tensor([-1.0, 1.0, 1.0])
    torch.testing.assert_close(
        solids.mirrored().signed_distance(points * flip), solids.signed_distance(points)
    )


@pytest.mark.parametrize("family", JOINTED_FAMILIES)
def test_a_mirrored_joint_moves_the_mirrored_part(family):
    solids, points = draw_objects([family], generator=seeded(13)), around()
    flip = torch.tensor([-1.0, 1.0, 1.0])
    state = solids.travel[:, 1:] - solids.travel[:, :1]
    turn, shift = (pose[:, 0] for pose in solids.joint_pose(state))
    other, along = (pose[:, 0] for pose in solids.mirrored().joint_pose(state))
    moved = points @ turn.mT + shift[:, None]
    mirrored = (points * flip) @ other.mT + along[:, None]
    torch.testing.assert_close(mirrored, moved * flip)
    assert float((moved - points).norm(dim=-1).max()) > 0.01


def test_a_joint_turns_about_its_pivot_or_slides_along_its_axis():
    solids = draw_objects(["laptop", "drawer"], generator=seeded(14))
    turn, shift = solids.joint_pose(torch.tensor([[0.0, 0.4], [0.0, 0.05]]))
    torch.testing.assert_close(turn[:, 0], torch.eye(3).expand(2, 3, 3))
    torch.testing.assert_close(shift[:, 0], torch.zeros(2, 3))
    torch.testing.assert_close(turn[0, 1] @ solids.pivot[0] + shift[0, 1], solids.pivot[0])
    assert float(matrix_to_axis_angle(turn[0, 1]).norm()) == pytest.approx(0.4, abs=1e-5)
    torch.testing.assert_close(turn[1, 1], torch.eye(3))
    torch.testing.assert_close(shift[1, 1], 0.05 * solids.axis[1])


def test_a_lid_lies_on_its_chest_at_the_end_of_its_travel():
    solids = draw_objects(["chest"], generator=seeded(15))
    turn, shift = (pose[:, 0] for pose in solids.joint_pose(solids.travel[:, :1]))
    lid, chest = solids.only(1), solids.only(0)
    points, _ = lid.surface_points(200, generator=seeded(16))
    closed = points @ turn.mT + shift[:, None]
    assert float(chest.signed_distance(closed).abs().min()) < 1e-4
    assert float(chest.signed_distance(closed).min()) > -1e-4
