import math

import numpy as np
import pytest
import torch
import trimesh

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.metrics.volume import intersection_volume


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    verts = torch.tensor(np.array(shape.vertices), dtype=torch.float32)
    return Mesh(verts, torch.tensor(np.array(shape.faces), dtype=torch.int64))


def box(size: float) -> trimesh.Trimesh:
    return trimesh.creation.box((size, size, size)).subdivide()


STILL = (torch.eye(3).expand(3, 1, 3, 3), torch.zeros(3, 1, 3))
SHIFTS = torch.tensor([[0.0307, 0.0113, 0.0004], [0.0452, 0.0003, 0.0004], [0.2, 0.0, 0.0]])
CUBE, HAND = SurfaceDistance(mesh_of(box(0.06))), mesh_of(box(0.04))
EXPECTED = (0.05 - SHIFTS.abs()).clamp(0, 0.04).prod(-1)


def test_boxes_that_overlap_share_a_box():
    found = intersection_volume(HAND.verts + SHIFTS[:, None], HAND.faces, (CUBE,), *STILL)
    assert (found.method, found.voxel) == ("exact", None)
    torch.testing.assert_close(found.volume, EXPECTED, rtol=1e-4, atol=1e-10)


def test_a_hand_open_at_the_wrist_is_measured_in_voxels():
    opened = HAND.faces[HAND.corners().mean(-2)[:, 0] < 0.0199]
    found = intersection_volume(HAND.verts + SHIFTS[:, None], opened, (CUBE,), *STILL, voxel=0.001)
    assert (found.method, found.voxel) == ("voxels", 0.001)
    torch.testing.assert_close(found.volume, EXPECTED, rtol=0.06, atol=1e-10)


def test_ball_inside_a_ball_shares_all_of_itself():
    field = SurfaceDistance(mesh_of(trimesh.creation.icosphere(3, 0.05)))
    ball = trimesh.creation.icosphere(3, 0.02)
    still = (STILL[0][:1], STILL[1][:1])
    exact = intersection_volume(mesh_of(ball).verts[None], mesh_of(ball).faces, (field,), *still)
    assert float(exact.volume) == pytest.approx(ball.volume, rel=1e-5)
    assert float(exact.volume) == pytest.approx(4 / 3 * math.pi * 0.02**3, rel=0.02)


@pytest.mark.parametrize("keep", [slice(None), slice(1, None)])
def test_volume_does_not_change_with_a_rigid_motion(keep):
    faces, verts = HAND.faces[keep], HAND.verts + SHIFTS[:, None]
    rotation = axis_angle_to_matrix(torch.tensor([[0.5, -1.0, 2.0]] * 3))[:, None]
    translation = torch.tensor([0.3, -0.2, 0.5]).expand(3, 1, 3)
    moved = verts @ rotation[:, 0].mT + translation
    rest = intersection_volume(verts, faces, (CUBE,), *STILL)
    found = intersection_volume(moved, faces, (CUBE,), rotation, translation)
    assert found.method == rest.method
    torch.testing.assert_close(found.volume, rest.volume, rtol=1e-3, atol=1e-10)


def test_frames_without_a_hand_have_no_volume():
    verts = (HAND.verts + SHIFTS[:, None]).clone()
    verts[0] = torch.nan
    found = intersection_volume(verts, HAND.faces, (CUBE,), *STILL)
    assert found.volume.isnan().tolist() == [True, False, False]
