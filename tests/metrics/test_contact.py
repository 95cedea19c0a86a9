import math

import numpy as np
import pytest
import torch
import trimesh

from geneoh.geometry.distance import SurfaceDistance, query_parts
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.metrics.contact import (
    contact_iou,
    in_contact,
    motion_consistency,
    penetration_depth,
    proximity_error,
    tips_in_contact,
)


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    verts = torch.tensor(np.array(shape.vertices), dtype=torch.float32)
    return Mesh(verts, torch.tensor(np.array(shape.faces), dtype=torch.int64))


@pytest.fixture(scope="module")
def cube():
    return SurfaceDistance(mesh_of(trimesh.creation.box((0.1, 0.1, 0.1))))


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
    distance = query_parts((cube,), *still(2), verts).distance
    torch.testing.assert_close(penetration_depth(distance), torch.tensor([0.009, 0.0]))


def test_ball_that_sinks_into_a_ball_is_as_deep_as_their_centres_are_near():
    fixed = SurfaceDistance(mesh_of(trimesh.creation.icosphere(4, 0.05)))
    hand = mesh_of(trimesh.creation.icosphere(4, 0.02)).verts
    shifts = torch.tensor([0.08, 0.07, 0.066, 0.05])
    verts = hand + shifts[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
    depth = penetration_depth(query_parts((fixed,), *still(4), verts).distance)
    torch.testing.assert_close(depth, (0.07 - shifts).clamp(min=0), atol=1e-4, rtol=0)


def test_depth_does_not_change_with_a_rigid_motion(cube):
    verts = torch.randn(3, 40, 3, generator=torch.Generator().manual_seed(0)) * 0.04
    rotation, translation = turning(3)
    world = verts @ rotation[:, 0].mT + translation
    rest = penetration_depth(query_parts((cube,), *still(3), verts).distance)
    moved = penetration_depth(query_parts((cube,), rotation, translation, world).distance)
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
    query = query_parts((cube,), rotation, translation, verts)
    found = motion_consistency(verts, query, (cube,), rotation, translation)
    torch.testing.assert_close(found, torch.zeros(5), atol=1e-9, rtol=0)


def test_object_that_leaves_a_resting_hand_is_as_inconsistent_as_it_is_fast(cube):
    rotation, _ = still(3)
    translation = torch.tensor([[0.0, 0, 0], [0.0, 0.01, 0], [0.0, 0.01, 0.0001]])[:, None]
    verts = touching_hand().expand(3, 3, 3)
    query = query_parts((cube,), rotation, translation, verts)
    found = motion_consistency(verts, query, (cube,), rotation, translation)
    torch.testing.assert_close(found[0], torch.tensor(1e-4))
    assert bool(found[1].isnan())


def test_hold_of_a_distant_hand_fades(cube):
    rotation, _ = still(2)
    step = torch.tensor([0.0, 0.01, 0.0])
    translation = torch.stack([0 * step, step])[:, None]
    verts = torch.tensor([[0.06, 0.0, 0.0]]) + translation
    query = query_parts((cube,), rotation, translation, verts)
    found = motion_consistency(verts, query, (cube,), rotation, translation)
    expected = torch.tensor([(1 - math.exp(-100 * 0.01)) ** 2 * 1e-4])
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=0)


def test_hand_follows_the_part_that_it_touches(cube):
    rotation, translation = turning(5, parts=2)
    translation = translation + torch.tensor([[0.0, 0, 0], [0.5, 0, 0]])
    verts = touching_hand() @ rotation[:, 1].mT + translation[:, 1:]
    query = query_parts((cube, cube), rotation, translation, verts)
    found = motion_consistency(verts, query, (cube, cube), rotation, translation)
    torch.testing.assert_close(found, torch.zeros(4), atol=1e-9, rtol=0)
