from dataclasses import replace

import pytest
import torch
import trimesh
from draws import seeded
from made_actions import box_actions, on_object

from geneoh.errors import InputError
from geneoh.generators.text2hoi.physics.standing import POINTS, stand_on_table
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh


def box(sides=(0.06, 0.08, 0.2), shift=(0.3, -0.2, 0.5)) -> Mesh:
    """A box away from the origin."""
    return from_trimesh(trimesh.creation.box(sides).apply_translation(shift))


def stood(up="z"):
    """The box with an axis of its frame up."""
    return stand_on_table(box(), up, generator=seeded())


def test_the_object_stands_on_the_table_over_the_origin():
    found = stood("x")
    assert found.points.shape == (POINTS, 3)
    assert found.points[:, 2].amin() > -1e-6
    assert found.points[:, 2].amax() == pytest.approx(0.06, abs=1e-3)
    assert found.points[:, :2].mean(0).abs().amax() < 1e-6
    verts = found.mesh.verts @ found.rotation.T + found.shift
    assert verts[:, 2].amin() == pytest.approx(0, abs=1e-6)


def test_poses_of_the_object_are_poses_of_the_mesh_as_its_file_has_it():
    found = stood("y")
    actions = on_object(box_actions(["lift"], frames=4), found)
    lifted = torch.tensor([0.0, 0.0, 0.1]).expand(1, 4, 3)
    actions = replace(actions, translation=lifted)
    rotation, translation = found.poses(actions)
    world = found.mesh.verts @ rotation[0].T + translation[0]
    assert world[:, 2].amin() == pytest.approx(0.1, abs=1e-6)


def test_values_at_points_come_to_the_vertices_nearby():
    found = stood()
    high = (found.points[:, 2] > 0.1).float()
    at = found.on_vertices(high)
    verts = found.mesh.verts @ found.rotation.T + found.shift
    assert torch.equal(at > 0.5, verts[:, 2] > 0.1)


@pytest.mark.parametrize(("factor", "said"), [(1000.0, "--unit mm"), (0.001, "--unit m")])
def test_objects_that_are_not_for_hands_are_refused_with_the_cure(factor, said):
    mesh = box()
    with pytest.raises(InputError, match=said):
        stand_on_table(Mesh(mesh.verts * factor, mesh.faces), generator=seeded())


@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (0.5, 0.4, 0.3)])
def test_an_object_that_hands_end_up_inside_of_is_refused(sides):
    with pytest.raises(InputError, match=r"at most 0\.2 m thick for hands, got"):
        stand_on_table(box(sides), generator=seeded())


def test_long_and_wide_objects_that_are_thin_stand():
    for sides in [(0.04, 0.04, 1.2), (0.8, 0.5, 0.03)]:
        assert stand_on_table(box(sides), generator=seeded()).points.isfinite().all()
