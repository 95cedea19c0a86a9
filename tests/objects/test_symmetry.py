"""Which rotations map a mesh onto itself."""

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.objects.symmetry import TURN_STEPS, area_moments, find_symmetry


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    verts = torch.from_numpy(np.array(shape.vertices, dtype=np.float32))
    return Mesh(verts, torch.from_numpy(np.array(shape.faces)))


def symmetry_of(shape: trimesh.Trimesh):
    return find_symmetry(SurfaceDistance(mesh_of(shape)))


def turned(shape: trimesh.Trimesh) -> trimesh.Trimesh:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec([0.4, -0.9, 0.2]).as_matrix()
    matrix[:3, 3] = 0.1, -0.2, 0.05
    return shape.apply_transform(matrix)


@pytest.mark.parametrize(
    ("shape", "count"),
    [
        (trimesh.creation.box((0.06, 0.1, 0.16)), 4),
        (trimesh.creation.cylinder(0.03, 0.12, sections=64), 2 * TURN_STEPS),
        (trimesh.creation.cone(0.04, 0.12, sections=64), TURN_STEPS),
        (trimesh.creation.icosphere(3, 0.04), 1),
    ],
)
def test_solids_have_the_rotations_of_their_shape(shape, count):
    found = symmetry_of(shape)
    assert len(found.rotations) == count
    assert found.is_ball == (count == 1)
    assert np.allclose(found.rotations[0], np.eye(3))


def test_a_can_that_lies_askew_has_the_same_rotations():
    found = symmetry_of(turned(trimesh.creation.cylinder(0.03, 0.12, sections=64)))
    assert len(found.rotations) == 2 * TURN_STEPS
    axis = Rotation.from_rotvec([0.4, -0.9, 0.2]).as_matrix()[:, 2]
    kept = np.abs(found.rotations @ axis @ axis)
    assert np.allclose(kept, 1, atol=1e-2)


def test_axes_of_inertia_do_not_depend_on_the_triangles():
    shape = trimesh.creation.box((0.06, 0.1, 0.16)).subdivide([0, 4, 5])
    center, axes = area_moments(mesh_of(turned(shape)))
    assert np.allclose(center, [0.1, -0.2, 0.05], atol=1e-6)
    along = axes[:3] @ Rotation.from_rotvec([0.4, -0.9, 0.2]).as_matrix()
    assert np.allclose(np.abs(along).max(1), 1, atol=1e-5)


def test_a_handle_breaks_the_symmetry():
    cup = trimesh.creation.cylinder(0.04, 0.1, sections=64)
    handle = trimesh.creation.box((0.04, 0.01, 0.06)).apply_translation((0.06, 0, 0))
    assert len(symmetry_of(trimesh.util.concatenate([cup, handle])).rotations) < 3


def test_the_nearest_equivalent_undoes_a_turn_of_the_symmetry():
    found = symmetry_of(trimesh.creation.box((0.06, 0.1, 0.16)))
    wanted = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix()
    flipped = wanted @ found.rotations[1]
    beside = wanted @ Rotation.from_rotvec([0.0, 0.2, 0.0]).as_matrix()
    onto, angle = found.nearest(flipped, np.stack([wanted, beside]))
    assert np.allclose(flipped @ onto, wanted, atol=1e-9)
    assert angle.tolist() == pytest.approx([0.0, 0.2], abs=1e-6)


def test_a_ball_reaches_any_rotation():
    found = symmetry_of(trimesh.creation.icosphere(3, 0.04))
    one, other = Rotation.random(2, random_state=0).as_matrix()
    onto, angle = found.nearest(one, other[None])
    assert np.allclose(one @ onto[0], other)
    assert angle[0] == 0
