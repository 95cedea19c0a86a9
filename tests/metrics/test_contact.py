import math

import pytest
import torch
import trimesh

from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.metrics.contact import (
    contact_agreement,
    contact_iou,
    depth_between,
    fingertip_slip,
    in_contact,
    motion_consistency,
    penetration_depth,
    proximity_error,
    tips_in_contact,
)


@pytest.fixture(scope="module")
def cube():
    return SurfaceDistance(from_trimesh(trimesh.creation.box((0.1, 0.1, 0.1))))


def still(frames: int, parts: int = 1) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.eye(3).expand(frames, parts, 3, 3), torch.zeros(frames, parts, 3)


def turning(frames: int, parts: int = 1) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    steps = torch.randn(frames, parts, 3, generator=generator).cumsum(0) * 0.02
    return axis_angle_to_matrix(steps * 5), steps


def test_depth_in_a_cube_is_that_of_the_deepest_vertex(cube):
    hand = torch.tensor([[0.0, 0.0, 0.047], [0.0, 0.0, 0.08], [0.041, 0.0, 0.0]])
    outside = hand + torch.tensor([0.2, 0.0, 0.0])
    verts = torch.stack([hand, outside])
    distance = MovingSurface((cube,), *still(2)).query(verts).distance
    torch.testing.assert_close(penetration_depth(distance), torch.tensor([0.009, 0.0]))


def test_ball_that_sinks_into_a_ball_is_as_deep_as_their_centres_are_near():
    fixed = SurfaceDistance(from_trimesh(trimesh.creation.icosphere(4, 0.05)))
    hand = from_trimesh(trimesh.creation.icosphere(4, 0.02)).verts
    shifts = torch.tensor([0.08, 0.07, 0.066, 0.05])
    verts = hand + shifts[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
    depth = penetration_depth(MovingSurface((fixed,), *still(4)).query(verts).distance)
    torch.testing.assert_close(depth, (0.07 - shifts).clamp(min=0), atol=1e-4, rtol=0)


def test_two_balls_are_as_deep_in_each_other_as_the_deeper_one_says():
    large = from_trimesh(trimesh.creation.icosphere(4, 0.05))
    small = from_trimesh(trimesh.creation.icosphere(2, 0.02))
    shifts = torch.tensor([0.08, 0.071, 0.066, 0.05])[:, None, None] * torch.eye(3)[2]
    one = ChangingSurface(large.verts.expand(4, -1, -1), large.faces)
    other = ChangingSurface(small.verts + shifts, small.faces)
    depth = depth_between(one, other)
    torch.testing.assert_close(depth, torch.tensor([0.0, 0.0, 0.004, 0.02]), atol=3e-4, rtol=0)
    assert torch.equal(depth, depth_between(other, one))


def test_depth_does_not_change_with_a_rigid_motion(cube):
    verts = torch.randn(3, 40, 3, generator=torch.Generator().manual_seed(0)) * 0.04
    rotation, translation = turning(3)
    world = verts @ rotation[:, 0].mT + translation
    rest = penetration_depth(MovingSurface((cube,), *still(3)).query(verts).distance)
    moved = penetration_depth(MovingSurface((cube,), rotation, translation).query(world).distance)
    torch.testing.assert_close(moved, rest, atol=1e-6, rtol=0)


def test_contact_is_5_mm_or_less():
    distance = torch.tensor([[0.0049, 0.1], [0.0051, 0.1], [-0.02, 0.1]])
    assert in_contact(distance).tolist() == [True, False, True]


def test_only_the_tips_that_touch_count():
    tips = torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0], [0.4, 0, 0]])[None]
    verts = torch.cat([tips + 0.005, tips + torch.tensor([0.0, 0.05, 0.0])], dim=1)
    distance = torch.full((1, 10), 0.02)
    distance[0, 1], distance[0, 5 + 3] = 0.004, -0.01
    assert tips_in_contact(distance, verts, tips).tolist() == [[False, True, False, False, False]]


def test_contact_overlap_counts_vertices_over_all_frames():
    truth = torch.tensor([[0.001, 0.001, 0.01], [-0.001, 0.01, 0.01]])
    ours = torch.tensor([[0.001, 0.01, 0.01], [0.001, -0.001, -0.01]])
    assert float(contact_iou(ours, truth)) == 0.5
    assert float(contact_iou(truth, truth)) == 1.0
    assert math.isnan(float(contact_iou(truth + 1, truth + 1)))


def test_proximity_error_is_the_mean_difference_of_distances():
    truth = torch.tensor([[0.01, 0.02]])
    torch.testing.assert_close(
        proximity_error(torch.tensor([[0.013, -0.021]]), truth), torch.tensor([0.002])
    )


def touching_hand() -> torch.Tensor:
    return torch.tensor([[0.05, 0.0, 0.0], [0.09, 0.02, 0.0], [0.07, 0.0, 0.03]])


def test_object_carried_rigidly_is_consistent(cube):
    rotation, translation = turning(6)
    verts = touching_hand() @ rotation[:, 0].mT + translation
    surface = MovingSurface((cube,), rotation, translation)
    found = motion_consistency(verts, surface.query(verts), surface)
    torch.testing.assert_close(found, torch.zeros(5), atol=1e-9, rtol=0)


def test_object_that_leaves_a_resting_hand_is_as_inconsistent_as_it_is_fast(cube):
    rotation, _ = still(3)
    translation = torch.tensor([[0.0, 0, 0], [0.0, 0.01, 0], [0.0, 0.01, 0.0001]])[:, None]
    verts = touching_hand().expand(3, 3, 3)
    surface = MovingSurface((cube,), rotation, translation)
    found = motion_consistency(verts, surface.query(verts), surface)
    torch.testing.assert_close(found[0], torch.tensor(1e-4))
    assert bool(found[1].isnan())


def test_hold_of_a_distant_hand_fades(cube):
    rotation, _ = still(2)
    step = torch.tensor([0.0, 0.01, 0.0])
    translation = torch.stack([0 * step, step])[:, None]
    verts = torch.tensor([[0.06, 0.0, 0.0]]) + translation
    surface = MovingSurface((cube,), rotation, translation)
    found = motion_consistency(verts, surface.query(verts), surface)
    expected = torch.tensor([(1 - math.exp(-100 * 0.01)) ** 2 * 1e-4])
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=0)


def test_hand_follows_the_part_that_it_touches(cube):
    rotation, translation = turning(5, parts=2)
    translation = translation + torch.tensor([[0.0, 0, 0], [0.5, 0, 0]])
    verts = touching_hand() @ rotation[:, 1].mT + translation[:, 1:]
    surface = MovingSurface((cube, cube), rotation, translation)
    found = motion_consistency(verts, surface.query(verts), surface)
    torch.testing.assert_close(found, torch.zeros(4), atol=1e-9, rtol=0)


def test_agreement_counts_points_of_all_frames_together():
    truth = torch.tensor([[True, True, False, False], [False, True, False, False]])
    found = torch.tensor([[True, False, True, False], [False, True, False, False]])
    agreement = contact_agreement(found, truth)
    pairs = [
        (a, b)
        for row, other in zip(found.tolist(), truth.tolist(), strict=True)
        for a, b in zip(row, other, strict=True)
    ]
    hits, misses = pairs.count((True, True)), pairs.count((False, True))
    false = pairs.count((True, False))
    assert float(agreement.iou) == pytest.approx(hits / (hits + misses + false))
    assert float(agreement.precision) == pytest.approx(hits / (hits + false))
    assert float(agreement.recall) == pytest.approx(hits / (hits + misses))
    assert float(agreement.f_score) == pytest.approx(2 * hits / (2 * hits + misses + false))


def test_contact_that_is_missed_altogether_has_no_precision_and_no_recall():
    nothing, truth = torch.zeros(2, 3, dtype=torch.bool), torch.ones(2, 3, dtype=torch.bool)
    agreement = contact_agreement(nothing, truth)
    assert math.isnan(float(agreement.precision))
    assert (float(agreement.iou), float(agreement.recall), float(agreement.f_score)) == (0, 0, 0)


def sliding(
    step: torch.Tensor, rotation: torch.Tensor, translation: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Five fingertips, the first on the cube's face x = 50 mm, that move by `step` in its frame."""
    frames = len(rotation)
    rest = torch.tensor([[0.051, 0.0, 0.0], [0.2, 0, 0], [0.3, 0, 0], [0.4, 0, 0], [0.5, 0, 0]])
    local = rest + torch.arange(frames)[:, None, None] * step
    verts = local @ rotation[:, 0].mT + translation
    return verts, verts


def slip(cube, step, rotation, translation) -> torch.Tensor:
    verts, tips = sliding(step, rotation, translation)
    surface = MovingSurface((cube,), rotation, translation)
    return fingertip_slip(verts, surface.query(verts), tips, surface, fps=30.0)


def test_fingertip_that_slides_a_millimetre_a_frame_slips_at_30_mm_a_second(cube):
    for motion in (still(5), turning(5)):
        found = slip(cube, torch.tensor([0.0, 0.0006, 0.0008]), *motion)
        torch.testing.assert_close(found, torch.full((4,), 0.03), rtol=1e-3, atol=0)


def test_fingertip_that_is_carried_or_presses_does_not_slip(cube):
    assert float(slip(cube, torch.zeros(3), *turning(5)).max()) < 2e-5
    pressing = slip(cube, torch.tensor([-0.0005, 0.0, 0.0]), *turning(5))
    assert float(pressing.max()) < 2e-5


def test_fingertip_that_lets_go_has_no_slip(cube):
    found = slip(cube, torch.tensor([0.003, 0.001, 0.0]), *still(4))
    # 1 mm off, then 4, 7 and 10: only the first step stays within 5 mm
    assert found.isnan().tolist() == [False, True, True]


def test_slip_agrees_with_one_finger_and_frame_at_a_time(cube):
    generator = torch.Generator().manual_seed(3)
    rotation, translation = turning(6)
    centres = torch.tensor(
        [[0.055, 0.0, 0.0], [0, 0.056, 0.0], [0, 0, 0.052], [0.3, 0, 0], [9, 0, 0]]
    )
    local = centres.repeat_interleave(4, 0) + 0.004 * torch.randn(6, 20, 3, generator=generator)
    verts = local @ rotation[:, 0].mT + translation
    tips = (centres @ rotation[:, 0].mT) + translation
    surface = MovingSurface((cube,), rotation, translation)
    query = surface.query(verts)
    found = fingertip_slip(verts, query, tips, surface, fps=30.0)
    for t in range(5):
        speeds = []
        for k in range(5):
            near = [v for v in range(20) if float((verts[t, v] - tips[t, k]).norm()) <= 0.015]
            if not near:
                continue
            v = min(near, key=lambda v: float(query.distance[t, v]))
            if max(float(query.distance[t, v]), float(query.distance[t + 1, v])) > 0.005:
                continue
            normal = rotation[t, 0].T @ query.normal[t, v]
            moved = local[t + 1, v] - local[t, v]
            speeds.append(30 * float((moved - moved.dot(normal) * normal).norm()))
        expected = sum(speeds) / len(speeds) if speeds else math.nan
        assert float(found[t]) == pytest.approx(expected, rel=1e-3, abs=1e-4, nan_ok=True)


def test_far_from_the_origin_the_tips_are_the_same():
    tips = torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0], [0.4, 0, 0]])[None]
    generator = torch.Generator().manual_seed(0)
    verts = tips.repeat_interleave(40, 1) + 0.0149 * torch.nn.functional.normalize(
        torch.randn(1, 200, 3, generator=generator), dim=-1
    )
    distance = torch.full((1, 200), 0.02)
    distance[:, ::7] = 0.0
    near = tips_in_contact(distance, verts, tips)
    assert bool(near.all())
    away = torch.tensor([3.0, -2.0, 4.0])
    for vertex in range(0, 200, 7):
        alone = torch.full((1, 200), 0.02)
        alone[:, vertex] = 0.0
        here = tips_in_contact(alone, verts, tips)
        there = tips_in_contact(alone, verts + away, tips + away)
        assert torch.equal(here, there)
