from dataclasses import replace

import pytest
import torch
from made_actions import made_actions

from geneoh.generators.text2hoi.networks.tokens import (
    actions_of,
    columns,
    from_columns,
    tokens_of,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand

ROTATION = torch.tensor([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])
"""Entries that tell where they are from; no rotation."""


def turned(seed: int = 0):
    """Actions whose object turns and shifts."""
    actions = made_actions()
    draw = torch.Generator().manual_seed(seed)
    count, frames = actions.joint.shape
    turn = axis_angle_to_matrix(torch.randn(count, frames, 3, generator=draw))
    return replace(actions, rotation=turn, slides=torch.arange(count) % 2 == 1).ended()


def test_six_numbers_are_the_first_two_columns_row_by_row():
    assert columns(ROTATION).tolist() == [1, 2, 4, 5, 7, 8]


def test_six_numbers_are_made_orthonormal_from_the_first_column_on():
    found = from_columns(torch.tensor([0.0, 3.0, 2.0, 1.0, 0.0, 0.0]))
    expected = torch.tensor([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    torch.testing.assert_close(found, expected)


@pytest.mark.parametrize("frame", ["object", "world"])
def test_actions_come_back_from_their_tokens(frame):
    actions = turned()
    back = actions_of(tokens_of(actions, frame), actions)
    there = actions.hands[:, :, None, None]
    torch.testing.assert_close(back.wrist, actions.wrist, atol=1e-5, rtol=0)
    torch.testing.assert_close(
        axis_angle_to_matrix(back.pose) * there[..., None, None],
        axis_angle_to_matrix(actions.pose) * there[..., None, None],
        atol=1e-5,
        rtol=0,
    )
    for name in ("rotation", "translation", "joint"):
        torch.testing.assert_close(getattr(back, name), getattr(actions, name), atol=1e-5, rtol=0)
    assert back.length.equal(actions.length)
    assert back.hands.equal(actions.hands)


def test_a_hand_that_moves_with_the_object_stands_still_in_its_frame():
    actions = turned()
    wrist = torch.tensor([0.1, 0.2, 0.3])
    held = actions.rotation @ wrist + actions.translation
    actions = replace(
        actions, wrist=held[:, None].expand(-1, 2, -1, -1), hands=actions.hands | True
    )
    tokens = tokens_of(actions)
    expected = wrist.expand(6, 2, 20, 3) * tokens.valid[:, None, :, None]
    torch.testing.assert_close(tokens.hands[..., :3], expected, atol=1e-6, rtol=0)


@pytest.mark.parametrize("frame", ["object", "world"])
def test_keypoints_on_the_object_do_not_depend_on_the_frame_that_hands_are_written_in(frame):
    actions = turned()
    tokens = tokens_of(actions, frame)
    hands = [load_hand(side).shaped(torch.zeros(10)) for side in ("left", "right")]
    for index, hand in enumerate(hands):
        posed = hand.posed(actions.pose[:, index], actions.wrist[:, index]).joints
        local = (posed - actions.translation[:, :, None]) @ actions.rotation
        shown = tokens.shown[:, index]
        torch.testing.assert_close(
            tokens.joints_on_object()[:, index][shown], local[shown], atol=1e-5, rtol=0
        )


def test_nothing_is_told_of_absent_hands_padded_frames_and_joints_that_are_not_there():
    tokens = tokens_of(made_actions())
    assert not tokens.flat[~tokens.defined].any()
    assert tokens.defined[0, 0].sum() == 99 + 9  # a rigid object and a right or a left hand
    assert tokens.defined[2, 0].sum() == 2 * 99 + 10
    assert not tokens.defined[1, 15:].any()


def test_a_sliding_joint_is_in_decimetres_and_a_turning_one_in_radians():
    actions = turned()
    joint = tokens_of(actions).object[..., 9]
    torch.testing.assert_close(joint[2], actions.joint[2])
    torch.testing.assert_close(joint[5, :15], 10 * actions.joint[5, :15])
