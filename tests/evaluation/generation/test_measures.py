from dataclasses import replace

import pytest
import torch
from made_actions import HALF, box_actions

from geneoh.evaluation.generation.measures import measure_clip, measure_clips, posed_actions


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


def far(actions):
    """The same with the hands half a metre away."""
    return replace(actions, wrist=actions.wrist + torch.tensor([0.5, 0.0, 0.0]))


def test_box_that_rises_without_a_hand_is_moved_alone_and_unrealistic():
    found = measure_clip(far(box_actions(["lift"], points=512)))
    assert found.moved_alone.item() == 1
    assert found.realism.item() < 0.2
    assert found.contact.item() == 0
    assert found.depth_mm.item() == 0


def test_hand_in_the_middle_of_a_box_is_nearly_half_its_least_side_deep():
    actions = box_actions(["lift"], points=2048)
    size = actions.points.amax(1) - actions.points.amin(1)
    inside = actions.translation + torch.tensor([0.0, 0.0, float(HALF[2])])
    found = measure_clip(replace(actions, wrist=inside[:, None].expand(-1, 2, -1, -1).clone()))
    assert 0.7 < found.deepest_mm.item() / (500 * float(size.min())) < 1
    assert found.contact.item() == 1
    assert found.moved_alone.item() == 0


def test_frames_after_the_end_do_not_count():
    actions = box_actions(["lift"], frames=12, length=8, points=128)
    after = replace(actions, wrist=actions.wrist.clone())
    after.wrist[:, :, 8:] += 3
    first, second = measure_clip(actions), measure_clip(after)
    for name in ("realism", "depth_mm", "acceleration_mm", "contact"):
        assert torch.equal(getattr(first, name), getattr(second, name))


def test_acceleration_is_in_millimetres_per_frame_squared():
    actions = box_actions(["lift"], frames=8, points=64)
    time = torch.arange(8)[:, None]
    still = torch.zeros_like(actions.wrist)
    still[:, 1] = 0.002 * time**2 / 2 * torch.tensor([1.0, 0.0, 0.0])
    found = measure_clip(
        replace(actions, wrist=still, pose=actions.pose[:, :, :1].expand(-1, -1, 8, -1, -1))
    )
    assert found.acceleration_mm.item() == pytest.approx(2, rel=1e-3)


def test_each_clip_of_a_set_has_its_own_measures():
    near = box_actions(["lift", "carry"], points=128, frames=6)
    both = measure_clips(near)
    assert both.realism.shape == (2,)
    second = measure_clip(near.take(slice(1, 2), "B"))
    assert torch.equal(both.depth_mm[1:], second.depth_mm)
