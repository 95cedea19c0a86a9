"""The reflection between left and right hands."""

import numpy as np
import pytest
import torch

from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mirror import (
    mirror_axes,
    mirror_axis_angle,
    mirror_faces,
    mirror_points,
    mirror_rotations,
    mirror_signs,
)
from geneoh.geometry.rotations import axis_angle_to_matrix

GENERATOR = torch.Generator().manual_seed(5)
VECTORS, POINTS = (torch.randn(7, 3, generator=GENERATOR) for _ in range(2))


@pytest.mark.parametrize("mirror", [mirror_points, mirror_axis_angle])
def test_mirroring_twice_gives_the_same_digits(mirror):
    assert torch.equal(mirror(mirror(POINTS)), POINTS)


def test_the_mirrored_rotation_turns_mirrored_points_to_the_mirrored_place():
    rotation = axis_angle_to_matrix(VECTORS)
    turned = (rotation @ POINTS[..., None])[..., 0]
    mirrored = mirror_rotations(rotation)
    other = (mirrored @ mirror_points(POINTS)[..., None])[..., 0]
    torch.testing.assert_close(other, mirror_points(turned))
    torch.testing.assert_close(axis_angle_to_matrix(mirror_axis_angle(VECTORS)), mirrored)


def test_axes_of_turns_and_of_slides_are_mirrored_as_what_they_are():
    found = mirror_axes(VECTORS[:2], torch.tensor([True, False]))
    assert torch.equal(found[0], mirror_points(VECTORS[0]))
    assert torch.equal(found[1], mirror_axis_angle(VECTORS[1]))


def test_mirrored_faces_still_look_outward():
    verts = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    faces = torch.tensor([[0, 1, 2]])
    mirrored = Mesh(mirror_points(verts), mirror_faces(faces))
    assert torch.equal(mirrored.face_vectors(), mirror_points(Mesh(verts, faces).face_vectors()))


def test_arrays_are_mirrored_like_tensors():
    for mirror in (mirror_points, mirror_axis_angle):
        assert np.array_equal(mirror(POINTS.numpy()), mirror(POINTS).numpy())
    rotation = axis_angle_to_matrix(VECTORS)
    assert np.array_equal(mirror_rotations(rotation.numpy()), mirror_rotations(rotation).numpy())


def test_the_signs_have_the_type_of_what_they_are_for():
    assert mirror_signs(POINTS.double()).dtype == torch.float64
    assert mirror_points(POINTS.numpy()).dtype == np.float32
