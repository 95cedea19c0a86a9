import torch
from made_actions import box_actions

from geneoh.evaluation.generation.posed import posed_actions


def test_absent_hands_are_nan_and_the_other_is_there():
    posed = posed_actions(box_actions(["lift"], frames=4, hands=(True, False)))
    assert posed.joints[0, 0].isfinite().all()
    assert posed.skin[0, 1].isnan().all()


def test_keypoints_are_those_of_the_skinned_hands():
    actions = box_actions(["lift", "pass"], frames=4, hands=(True, True))
    assert torch.allclose(actions.keypoints(), posed_actions(actions).joints, atol=1e-6)


def test_points_and_normals_move_with_the_object_and_its_joint():
    actions = box_actions(["open"], frames=6, jointed=True)
    surface = posed_actions(actions).surface
    turn, shift = actions.joint_poses()
    on_joint = actions.part[0] > 0
    assert 0 < on_joint.sum() < len(on_joint), "both parts have points"
    rotation, translation = actions.rotation[0, -1], actions.translation[0, -1]
    for part, extra, moved in (
        (~on_joint, torch.eye(3), 0.0),
        (on_joint, turn[0, -1], shift[0, -1]),
    ):
        points = (actions.points[0, part] @ extra.T + moved) @ rotation.T + translation
        normals = actions.normals[0, part] @ extra.T @ rotation.T
        assert torch.allclose(surface.points[0, -1, part], points, atol=1e-6)
        assert torch.allclose(surface.normals[0, -1, part], normals, atol=1e-6)
