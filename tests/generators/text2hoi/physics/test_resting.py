from dataclasses import replace

import pytest
import torch
from made_actions import box_actions

from geneoh.generators.text2hoi.physics.resting import (
    eased,
    finished,
    kept_on_table,
    moved_by_hands,
    retimed,
    touching_hands,
    with_object_motion,
)
from geneoh.geometry.rotations import axis_angle_to_matrix


def held_box():
    """A box that rises by 10 to 20 cm in a hand that is at its side."""
    actions = box_actions(["lift", "lift"], frames=30)
    near = actions.points[:, :1].mean(1)
    wrist = (actions.rotation @ near[:, None, :, None])[..., 0] + actions.translation
    return replace(actions, wrist=torch.stack([torch.zeros_like(wrist), wrist], 1))


def far_hand(actions):
    """The same object with its hand a metre away."""
    away = torch.tensor([1.0, 0.0, 0.0]) * actions.hands[:, :, None, None]
    return replace(actions, wrist=actions.wrist + away)


def test_a_hand_on_the_surface_touches_and_one_a_metre_away_does_not():
    assert touching_hands(held_box())[:, 1].all()
    assert not touching_hands(held_box())[:, 0].any()
    assert not touching_hands(far_hand(held_box())).any()


def test_what_is_held_moves_as_before():
    actions = held_box()
    moved = moved_by_hands(actions)
    assert torch.allclose(moved.translation, actions.translation, atol=1e-5)
    assert torch.allclose(moved.rotation, actions.rotation, atol=1e-5)
    assert torch.allclose(moved.wrist, actions.wrist, atol=1e-5)


def test_hands_that_are_mended_on_the_way_rest_at_the_ends():
    frames = torch.arange(30.0)[:, None]

    def settle(actions):
        side = 0.002 * frames * torch.tensor([0.0, 1.0, 0.0]) * actions.hands[:, :, None, None]
        return replace(actions, wrist=actions.wrist + side)

    steps = finished(held_box(), settle).wrist[:, 1].diff(dim=1).norm(dim=-1)
    assert steps[:, 12].min() > 0.0019
    assert steps[:, [0, -1]].max() < 0.3 * steps[:, 12].min()


@pytest.mark.parametrize("verb", ["slide", "rotate", "press", "lift"])
def test_objects_stay_on_the_table_where_their_verb_says_so(verb):
    actions = held_box()
    frames = torch.arange(actions.rotation.shape[1]) / actions.rotation.shape[1]
    turns = axis_angle_to_matrix(frames[:, None] * torch.tensor([0.2, 0.0, 1.0]))
    tilt = turns.expand_as(actions.rotation)
    lifted = actions.translation + frames[:, None] * torch.tensor([0.1, 0.0, 0.02])
    moving = with_object_motion(actions, tilt, lifted, actions.joint)
    found = kept_on_table(moving, verb)
    if verb == "lift":
        assert found is moving
        return
    assert (found.translation[..., 2] == 0).all()
    assert torch.allclose(found.rotation[..., 2, 2], torch.ones(()))
    moves = bool((found.translation.diff(dim=1).abs() > 1e-6).any())
    assert moves is (verb != "press")
    for each in (moving, found):  # the hand goes with it
        own = each.rotation.mT @ (each.wrist[:, 1] - each.translation)[..., None]
        torch.testing.assert_close(own, own[:, :1].expand_as(own), atol=1e-5, rtol=0)


def test_what_no_hand_touches_rests():
    moved = moved_by_hands(far_hand(held_box()))
    assert (moved.translation == moved.translation[:, :1]).all()
    assert (moved.rotation == moved.rotation[:, :1]).all()


def test_hands_stay_where_they_are_at_the_object():
    actions = far_hand(held_box())
    places = [
        (each.rotation.mT @ (each.wrist[:, 1] - each.translation)[..., None])[..., 0]
        for each in (actions, moved_by_hands(actions))
    ]
    assert torch.allclose(*places, atol=1e-5)


def test_an_object_that_nearly_stands_on_the_table_does_at_the_start_and_at_the_end():
    actions = held_box()
    lean = axis_angle_to_matrix(torch.tensor([0.1, 0.0, 0.0])).expand_as(actions.rotation)
    floating = replace(
        actions,
        rotation=lean,
        translation=0.0 * actions.translation + torch.tensor([0.05, 0.0, 0.02]),
    )
    wrist = (lean @ actions.points[:, :1].mean(1)[:, None, :, None])[..., 0]
    there = torch.stack([torch.zeros_like(wrist), wrist + floating.translation], 1)
    moved = moved_by_hands(replace(floating, wrist=there))
    for frame in (0, -1):
        assert moved.translation[:, frame, 2].abs().amax() < 1e-6
        assert torch.allclose(moved.rotation[:, frame], torch.eye(3).expand(2, 3, 3), atol=1e-5)


def height_of(actions):
    """Height of the lowest point of each object over the table, metres."""
    lowest = (actions.points[:, None] @ actions.rotation.mT).amin(2)
    return (lowest + actions.translation)[..., 2]


def test_an_object_that_is_let_go_in_the_air_stands_on_the_table_at_the_end():
    held = held_box()
    frames = torch.arange(held.wrist.shape[2])[:, None]
    let_go = torch.where(frames > 20, torch.tensor([1.0, 0.0, 0.0]), torch.zeros(1))
    moved = moved_by_hands(replace(held, wrist=held.wrist + let_go * held.hands[..., None, None]))
    assert held.translation[:, 20, 2].amin() > 0.05
    assert moved.translation[:, :20, 2].amax() > 0.02
    assert moved.translation[:, 20:, 2].abs().amax() < 1e-6


def test_no_object_is_under_the_table_wherever_a_hand_carries_it():
    held = held_box()
    down = torch.tensor([0.0, 0.0, -0.06]) * torch.sin(torch.linspace(0, 6, 30))[:, None].abs()
    sunk = replace(
        held,
        translation=down.expand(2, -1, -1).clone(),
        wrist=held.wrist + ((down - held.translation)[:, None] * held.hands[..., None, None]),
    )
    moved = moved_by_hands(sunk)
    assert height_of(sunk).amin() < -0.05
    assert height_of(moved).amin() > -1e-6
    apart = moved.wrist[:, 1] - moved.translation
    assert torch.allclose(apart, sunk.wrist[:, 1] - sunk.translation, atol=1e-5)


def test_an_object_that_starts_deep_in_the_table_starts_on_it():
    held = held_box()
    deep = torch.tensor([0.0, 0.0, -0.08])
    wrist = held.wrist + deep * held.hands[..., None, None]
    moved = moved_by_hands(replace(held, translation=held.translation + deep, wrist=wrist))
    assert moved.translation[:, 0, 2].abs().amax() < 1e-6
    assert height_of(moved).amin() > -1e-6


def test_a_clip_that_begins_and_ends_in_motion_does_so_from_rest():
    actions = box_actions(["lift", "lift"], frames=40)
    time = torch.arange(40.0)[None, :, None]
    speed = torch.tensor([0.01, 0.0, 0.0])
    going = replace(
        actions,
        translation=(time * speed).expand(2, -1, -1).clone(),
        rotation=axis_angle_to_matrix(0.05 * time * torch.eye(3)[2]).expand(2, -1, -1, -1).clone(),
        wrist=(time * speed)[:, None].expand(2, 2, -1, -1).clone(),
    )
    found = eased(going)
    for path in (found.translation, found.wrist[:, 1]):
        step = path.diff(dim=1).norm(dim=-1)
        assert (step[:, [0, -1]] < 2e-3).all()
        assert torch.allclose(step[:, 19], torch.tensor(0.01), atol=1e-4)
        assert torch.allclose(path[:, [0, -1]], going.translation[:, [0, -1]], atol=1e-5)
    assert torch.allclose(found.rotation[:, [0, -1]], going.rotation[:, [0, -1]], atol=1e-4)


def test_an_action_in_another_time_runs_from_the_same_start_to_the_same_end():
    actions = box_actions(["lift", "pour"], frames=21)
    lengths = torch.tensor([11, 31])
    found = retimed(actions, lengths)
    assert found.length.equal(lengths)
    torch.testing.assert_close(found.translation[0, :11], actions.translation[0, ::2])
    torch.testing.assert_close(found.translation[0, 11:], actions.translation[0, -1:].expand(20, 3))
    torch.testing.assert_close(found.wrist[1, 1, ::3], actions.wrist[1, 1, ::2])
    torch.testing.assert_close(found.rotation[1, 30], actions.rotation[1, 20])
    half = found.translation[1, 1]
    torch.testing.assert_close(half, torch.lerp(*actions.translation[1, :2], 2 / 3))


def test_the_same_number_of_frames_is_the_same_action():
    actions = box_actions(["lift", "pour"], frames=21)
    found = retimed(actions, actions.length)
    torch.testing.assert_close(found.wrist, actions.wrist)
    torch.testing.assert_close(found.rotation, actions.rotation, atol=1e-5, rtol=0)
