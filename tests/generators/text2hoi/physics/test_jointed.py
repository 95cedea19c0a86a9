from dataclasses import replace

import pytest
import torch
from draws import seeded
from two_parts import HINGE, box_with_lid, cuboid

from geneoh.errors import ConfigError, InputError
from geneoh.generators.text2hoi.physics.jointed import (
    IN_TABLE,
    LEAST_POINTS,
    JointedObject,
    asked_joint,
    joined,
)
from geneoh.generators.text2hoi.physics.standing import stand_on_table
from geneoh.geometry.joint import Joint
from geneoh.geometry.mesh_files import from_trimesh


def test_parts_as_one_mesh_keep_their_faces():
    base, lid = box_with_lid()
    one = joined((base, lid))
    count = len(base.verts)
    assert torch.equal(one.verts[count:], lid.verts)
    assert torch.equal(one.faces[len(base.faces) :], lid.faces + count)
    assert joined((base,)) is base


def test_points_are_of_the_part_that_they_lie_on_and_the_joint_is_upright():
    meshes = box_with_lid()
    stood = stand_on_table(joined(meshes), "y", generator=seeded())
    found, _ = JointedObject.of(meshes, stood, Joint.read(HINGE), closes=False)
    height = (stood.points - stood.shift) @ stood.rotation
    assert torch.equal(found.part > 0, height[:, 2] > 0.0702)
    assert found.objects.motion[0, :2].tolist() == [1, 0]
    assert torch.allclose(found.joint.axis, stood.rotation @ torch.tensor([-1.0, 0, 0]), atol=1e-6)


@pytest.mark.parametrize("joint", [HINGE, "slide:0,1,0:5"])
def test_networks_see_the_same_joint_wherever_the_origin_of_the_meshes_is(joint):
    seen = []
    for off in (torch.zeros(3), torch.tensor([1.0, -2.0, 0.5])):
        meshes = tuple(replace(mesh, verts=mesh.verts + off) for mesh in box_with_lid())
        stood = stand_on_table(joined(meshes), "y", generator=seeded())
        found = Joint.read(joint)
        found = replace(found, pivot=found.pivot + off + 3 * found.axis)
        objects = JointedObject.of(meshes, stood, found, closes=False)[0].objects
        middle = objects.points[0, objects.part[0] == 0].mean(0)
        assert (objects.pivot[0] - middle).norm() < 0.1
        seen.append(objects.motion)
    assert torch.allclose(*seen, atol=1e-4)


def test_a_part_that_is_tiny_beside_the_other_one_has_points_all_the_same():
    case, knob = cuboid((0.6, 0.4, 0.1), (0, 0, 0.05)), cuboid((0.01, 0.01, 0.01), (0, 0, 0.1052))
    meshes = from_trimesh(case), from_trimesh(knob)
    stood = stand_on_table(joined(meshes), generator=seeded())
    found, _ = JointedObject.of(meshes, stood, Joint.read("slide:0,0,1:5"), closes=False)
    there = found.objects.points[0, found.part > 0]
    assert len(there) >= LEAST_POINTS
    assert len(found.stood.points) == len(stood.points)
    assert (there[:, 2] > 0.1).all()


@pytest.mark.parametrize(("angle", "told"), [("", True), (":80", False)])
def test_a_door_that_opens_downward_ends_at_the_table(angle, told):
    case, door = cuboid((0.2, 0.16, 0.15), (0, 0, 0.075)), cuboid((0.2, 0.01, 0.15), (0, -0.086, 0))
    meshes = from_trimesh(case), from_trimesh(door.apply_translation((0, 0, 0.075)))
    stood = stand_on_table(joined(meshes), generator=seeded())
    joint = Joint.read(f"hinge:0,-0.091,0:1,0,0{angle}")
    found, notes = JointedObject.of(meshes, stood, joint, closes=False)
    lowest = found.joint.pose(torch.tensor([found.most])).apply(found.meshes[1].verts)[..., 2].min()
    assert -IN_TABLE < float(lowest) < 0.03
    assert any("the part meets the table beyond 90 degrees" in note for note in notes) == told


@pytest.mark.parametrize(
    ("count", "joint", "said"),
    [
        (3, None, "one mesh, or two for the parts of an object, got 3"),
        (0, None, "got 0"),
        (1, HINGE, "a joint is of an object of two parts, got one mesh"),
        (2, "lid", "joint 'lid': expected hinge"),
    ],
)
def test_meshes_and_joints_that_do_not_fit_are_refused(count, joint, said):
    meshes = (box_with_lid()[0],) * count
    with pytest.raises(InputError) as refused:
        asked_joint(meshes, joint)
    assert said in str(refused.value)


def test_a_joint_may_be_a_text_or_a_joint_and_nothing_else():
    meshes = box_with_lid()
    assert str(asked_joint(meshes, HINGE)) == HINGE
    joint = Joint.read(HINGE)
    twice = asked_joint(meshes, replace(joint, axis=2 * joint.axis))
    assert str(twice) == str(asked_joint(meshes, joint)) == HINGE
    with pytest.raises(InputError, match="expected an axis with a direction"):
        asked_joint(meshes, replace(joint, axis=torch.zeros(3)))
    assert asked_joint(meshes, None) is None
    with pytest.raises(ConfigError, match="must be a text or a Joint, got int"):
        asked_joint(meshes, 3)  # type: ignore[arg-type]
