from dataclasses import replace

import torch
from made_actions import made_actions

from geneoh.generators.text2hoi.networks.objects import CONTACT_EVERY, Objects, contact_maps
from geneoh.synthesis.actions.action import TOUCHED


def test_points_are_normalised_to_the_unit_ball_around_their_mean():
    objects = Objects.of(made_actions())
    normalised = objects.normalised
    torch.testing.assert_close(normalised.mean(1), torch.zeros(6, 3), atol=1e-5, rtol=0)
    torch.testing.assert_close(normalised.norm(dim=-1).amax(1), torch.ones(6))


def test_a_point_is_touched_within_two_centimetres_of_a_keypoint_of_a_hand_that_takes_part():
    actions = made_actions(count=3)
    at = torch.tensor([0.3, 0.0, 0.0])
    points = actions.points.clone()
    points[:, 0] = at + torch.tensor([-0.9 * TOUCHED, 0.0, 0.0])
    points[:, 1] = at + torch.tensor([-1.1 * TOUCHED, 0.0, 0.0])
    wrist = torch.zeros(3, 2, 20, 3)
    wrist[..., 0] = 0.5
    wrist[:, 1, CONTACT_EVERY] = at  # the right hand comes near in a single frame
    actions = replace(
        actions,
        points=points,
        part=torch.zeros_like(actions.part),
        wrist=wrist,
        pose=0 * actions.pose,
        translation=0 * actions.translation,
    )
    # fingers of the flat right hand point away from the points
    touched = contact_maps(actions)[:, :2]
    assert touched.tolist() == [[True, False], [False, False], [True, False]]


def test_points_of_the_second_part_are_touched_where_the_joint_has_brought_them():
    actions = made_actions(count=3)
    turn = torch.pi / 2
    points = actions.points.clone()
    points[2, 1] = torch.tensor([0.3, 0.0, 0.0])  # on the joint, about z
    wrist = torch.zeros(3, 2, 20, 3)
    wrist[2, :] = torch.tensor([0.0, 0.3, 0.0])
    actions = replace(
        actions,
        points=points,
        wrist=wrist,
        translation=0 * actions.translation,
        joint=torch.zeros(3, 20),
    )
    assert not contact_maps(actions)[2, 1]
    assert contact_maps(replace(actions, joint=torch.full((3, 20), turn)))[2, 1]
