import math
from dataclasses import replace

import pytest
import torch
import trimesh
from two_parts import DEEP, DRAWER, HINGE, WALL, WIDE, box_with_lid, case_with_drawer, cuboid

from geneoh.errors import InputError
from geneoh.generators.text2hoi.physics.joint_finding import joint_of
from geneoh.geometry.joint import Joint
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh

OPENS = math.radians(90)


def test_a_flat_lid_turns_about_a_long_side_and_others_that_fit_are_told():
    joint, notes = joint_of(box_with_lid(), None)
    assert not joint.slides
    assert joint.axis.abs().tolist() == [1, 0, 0]
    assert abs(float(joint.pivot[1])) == pytest.approx(DEEP / 2, abs=0.002)
    assert joint.most is not None
    assert joint.most > OPENS
    assert f"--joint {joint}" in notes[0]
    assert len(notes) == 4
    assert all("another side fits as well: --joint hinge" in note for note in notes[1:])


def test_a_lid_opens_upward_about_what_was_found():
    meshes = box_with_lid()
    joint, _ = joint_of(meshes, None)
    opened = joint.pose(torch.tensor([OPENS])).apply(meshes[1].verts)
    assert float(opened[0, :, 2].amax()) > float(meshes[1].verts[:, 2].amax()) + 0.05


def test_a_drawer_slides_out_along_its_only_way():
    joint, (note,) = joint_of(case_with_drawer(), None)
    assert joint.slides
    assert joint.axis.tolist() == [0, -1, 0]
    assert "slide:0,-1,0" in note


def test_a_round_lid_has_no_joint_that_its_shape_tells():
    pot, lid = trimesh.creation.annulus(0.05, 0.06, 0.08), trimesh.creation.cylinder(0.06, 0.006)
    lid.apply_translation((0, 0, 0.0435))
    with pytest.raises(InputError, match=r"its joint cannot be found.*give the joint as --joint"):
        joint_of((from_trimesh(pot), from_trimesh(lid)), None)


def test_parts_that_are_modelled_through_each_other_are_told_to_be_so():
    solid, inner = cuboid((0.1, 0.1, 0.1), (0, 0, 0)), cuboid((0.08, 0.08, 0.08), (0.01, 0, 0))
    with pytest.raises(InputError, match=r"83% of its surface are inside of the first part"):
        joint_of((from_trimesh(solid), from_trimesh(inner)), None)


def test_parts_far_apart_are_refused():
    base, lid = box_with_lid()
    away = Mesh(lid.verts + torch.tensor([0.0, 0, 0.1]), lid.faces)
    with pytest.raises(InputError, match="part next to the first one, got one that is 10 cm away"):
        joint_of((base, away), Joint.read(HINGE))


@pytest.mark.parametrize(
    ("meshes", "text"), [(box_with_lid(), HINGE), (case_with_drawer(), DRAWER)]
)
def test_a_joint_that_is_given_keeps_its_range(meshes, text):
    joint, notes = joint_of(meshes, Joint.read(text))
    assert str(joint) == text
    assert notes == ()


@pytest.mark.parametrize(
    ("meshes", "text"),
    [
        *((box_with_lid(), HINGE), (box_with_lid(), HINGE.replace(":100", ":5"))),
        *((case_with_drawer(), DRAWER), (case_with_drawer(), "slide:0,-1,0:0.5")),
    ],
)
def test_a_joint_that_runs_into_the_other_part_is_refused_with_the_cure(meshes, text):
    assert joint_of(meshes, Joint.read(text))[1] == ()
    joint = Joint.read(text)
    with pytest.raises(InputError, match="runs into it at once; turn the axis round"):
        joint_of(meshes, replace(joint, axis=-joint.axis))


def test_a_range_beyond_which_parts_meet_ends_there():
    base, lid = box_with_lid()
    wall = from_trimesh(cuboid((WIDE, WALL, 0.2), (0, DEEP / 2 + 0.05, 0.1)))
    both = Mesh(
        torch.cat([base.verts, wall.verts]), torch.cat([base.faces, wall.faces + len(base.verts)])
    )
    joint, (note,) = joint_of((both, lid), Joint.read(HINGE.replace(":100", ":170")))
    assert joint.most is not None
    assert OPENS < joint.most < math.radians(150)
    assert "the parts meet beyond" in note


def test_a_hinge_far_from_the_parts_is_refused_as_not_in_metres():
    joint = Joint.read("hinge:0,55,70:-1,0,0")
    with pytest.raises(InputError, match=r"got one 8\d\.\d m away; give its point in metres"):
        joint_of(box_with_lid(), joint)
