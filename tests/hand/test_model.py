from dataclasses import fields, replace

import pytest
import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import OPENPOSE_FROM_MANO, PARENTS, TIP_PARENTS, bone_lengths

SIDES = ("right", "left")
FLIP = torch.tensor([-1.0, 1.0, 1.0])


def in_float64(model):
    """The same model with all numbers in double precision."""
    values = {field.name: getattr(model, field.name) for field in fields(model)}
    return replace(
        model, **{k: v.double() for k, v in values.items() if torch.is_tensor(v) and k != "faces"}
    )


def draw(*shape, seed=0, scale=1.0):
    return scale * torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def slow_skin(model: HandModel, betas, pose, wrist):
    """Vertex by vertex, joint by joint, as the equations are written."""
    verts = model.template + model.shape_dirs @ betas
    joints = model.joint_regressor @ verts
    verts, joints = verts - joints[0], joints - joints[0]
    local = axis_angle_to_matrix(pose)
    feature = (local[1:] - torch.eye(3, dtype=pose.dtype)).reshape(-1)
    verts = verts + model.pose_dirs @ feature
    turn, place = [local[0]], [wrist]
    for joint in range(1, 16):
        parent = PARENTS[joint]
        turn.append(turn[parent] @ local[joint])
        place.append(place[parent] + turn[parent] @ (joints[joint] - joints[parent]))
    posed = torch.zeros_like(verts)
    for joint in range(16):
        moved = (verts - joints[joint]) @ turn[joint].T + place[joint]
        posed += model.skin_weights[:, joint, None] * moved
    return posed


@pytest.mark.parametrize("side", SIDES)
def test_skinning_equals_the_sum_over_joints(side):
    model = in_float64(load_hand(side))
    betas, pose, wrist = draw(10).double(), draw(16, 3, seed=1).double(), draw(3, seed=2).double()
    posed = model.shaped(betas).posed(pose, wrist)
    torch.testing.assert_close(posed.verts, slow_skin(model, betas, pose, wrist))


def test_rest_pose_is_the_template_with_its_wrist_at_the_origin():
    model = load_hand("right")
    shaped = model.shaped(torch.zeros(10))
    posed = shaped.posed(torch.zeros(16, 3), torch.zeros(3))
    root = model.joint_regressor[0] @ model.template
    torch.testing.assert_close(posed.verts, model.template - root)
    torch.testing.assert_close(posed.joints[0], torch.zeros(3))


def test_keypoints_of_the_rest_pose_are_joints_and_tip_vertices():
    shaped = load_hand("right").shaped(draw(10))
    rest = torch.cat([shaped.joints, shaped.verts[list(shaped.model.tip_verts)]])
    posed = shaped.posed(torch.zeros(16, 3), torch.zeros(3))
    torch.testing.assert_close(posed.joints, rest[list(OPENPOSE_FROM_MANO)])


def test_tips_are_rigid_on_the_distal_bone():
    shaped = load_hand("right").shaped(torch.zeros(10))
    pose = draw(40, 16, 3, scale=0.4)
    lengths = bone_lengths(shaped.posed(pose, torch.zeros(3)).joints)
    torch.testing.assert_close(lengths, lengths[:1].expand(40, 20), atol=1e-6, rtol=0)
    assert len(shaped.offsets) == 15 + len(TIP_PARENTS)


@pytest.mark.parametrize("side", SIDES)
def test_turning_the_wrist_turns_the_whole_hand_about_it(side):
    shaped = load_hand(side).shaped(draw(10))
    pose, wrist = draw(16, 3, scale=0.5), draw(3, seed=3)
    upright = pose.clone()
    upright[0] = 0.0
    turn = axis_angle_to_matrix(pose[0])
    still, turned = shaped.posed(upright, torch.zeros(3)), shaped.posed(pose, wrist)
    torch.testing.assert_close(turned.verts, still.verts @ turn.T + wrist, atol=2e-6, rtol=0)
    torch.testing.assert_close(turned.joints, still.joints @ turn.T + wrist, atol=2e-6, rtol=0)


def test_left_hand_is_the_mirror_of_the_right_in_every_pose():
    betas, pose, wrist = draw(10), draw(30, 16, 3, scale=0.7), draw(30, 3, seed=5)
    right = load_hand("right").shaped(betas).posed(pose, wrist)
    left = load_hand("left").shaped(betas).posed(pose * -FLIP, wrist * FLIP)
    torch.testing.assert_close(left.verts, right.verts * FLIP, atol=1e-6, rtol=0)
    torch.testing.assert_close(left.joints, right.joints * FLIP, atol=1e-6, rtol=0)


def test_mirroring_twice_changes_nothing():
    model = load_hand("right")
    back = model.mirrored().mirrored()
    assert (back.side, back.name, back.tip_verts) == (model.side, model.name, model.tip_verts)
    for field in fields(model):
        value = getattr(model, field.name)
        if torch.is_tensor(value):
            torch.testing.assert_close(getattr(back, field.name), value)


def test_mirrored_limits_are_ordered_and_hold_the_mirrored_pose():
    left = load_hand("left")
    assert (left.pose_low <= left.pose_high).all()
    assert (left.pose_low <= left.pose_mean).all()
    assert (left.pose_mean <= left.pose_high).all()


def test_betas_broadcast_against_poses():
    model = load_hand("right")
    pose, wrist, betas = draw(4, 16, 3), draw(4, 3), draw(3, 1, 10)
    posed = model.shaped(betas).posed(pose, wrist)
    assert posed.verts.shape == (3, 4, 778, 3)
    assert posed.joints.shape == (3, 4, 21, 3)
    one = model.shaped(betas[1, 0]).posed(pose[2], wrist[2])
    torch.testing.assert_close(posed.verts[1, 2], one.verts, atol=1e-6, rtol=0)


def test_one_pose_serves_many_wrists():
    shaped = load_hand("right").shaped(torch.zeros(10))
    posed = shaped.posed(draw(16, 3), draw(5, 3))
    shift = posed.verts[1] - posed.verts[0]
    torch.testing.assert_close(shift, shift[:1].expand(778, 3), atol=1e-6, rtol=0)


def test_rotations_and_axis_angles_pose_alike():
    shaped = load_hand("right").shaped(draw(10))
    pose, wrist = draw(4, 16, 3), draw(4, 3)
    by_angle = shaped.posed(pose, wrist)
    by_matrix = shaped.verts_from_rotations(axis_angle_to_matrix(pose), wrist)
    torch.testing.assert_close(by_matrix.verts, by_angle.verts)
    only = shaped.joints_from_rotations(axis_angle_to_matrix(pose), wrist)
    torch.testing.assert_close(only, by_angle.joints)


def test_gradients_match_finite_differences():
    model = in_float64(load_hand("right"))
    pick = torch.tensor([5, 320, 700])

    def points(betas, pose, wrist):
        posed = model.shaped(betas).posed(pose, wrist)
        return torch.cat([posed.verts[pick], posed.joints[::5]])

    inputs = (draw(10), draw(16, 3, scale=0.5), draw(3))
    inputs = tuple(x.double().requires_grad_() for x in inputs)
    assert torch.autograd.gradcheck(points, inputs, eps=1e-6, atol=1e-7)


def test_model_follows_its_tensors_to_another_precision():
    shaped = in_float64(load_hand("right")).shaped(torch.zeros(10, dtype=torch.float64))
    posed = shaped.posed(torch.zeros(16, 3, dtype=torch.float64), torch.zeros(3).double())
    assert posed.verts.dtype == torch.float64


def test_moving_a_model_keeps_what_is_no_tensor():
    model = load_hand("left").to("cpu")
    assert (model.side, model.tip_verts) == ("left", load_hand("left").tip_verts)


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_hand_poses_on_the_gpu_as_on_the_cpu():
    model, pose, wrist = load_hand("right"), draw(4, 16, 3), draw(4, 3)
    here = model.shaped(draw(10)).posed(pose, wrist)
    there = model.to("cuda").shaped(draw(10).cuda()).posed(pose.cuda(), wrist.cuda())
    torch.testing.assert_close(there.verts.cpu(), here.verts, atol=1e-5, rtol=0)
