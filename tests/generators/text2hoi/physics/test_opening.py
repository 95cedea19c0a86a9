from dataclasses import replace

import pytest
import torch
from made_actions import box_actions

from geneoh.generators.text2hoi.physics.opening import (
    guided,
    left_out,
    moved_by_hands_at_part,
    opener,
    part_gaps,
    rigid_part,
    starting_gap,
    under_table,
    with_joint,
)
from geneoh.generators.text2hoi.physics.resting import touching_hands
from geneoh.geometry.rigid import Rigid

MOST = 0.8


def drawn(frames=60, hands=(False, True)):
    """A box whose upper half opens by 1 radian while it rises, with hands beside it."""
    return box_actions(["open"], frames=frames, hands=hands, jointed=True)


def at_part(actions, part=1):
    """Wrists in the frame of a part, metres."""
    rotation, translation = actions.part_poses()
    pose = Rigid(rotation[0, :, part], translation[0, :, part]).inverse()
    return pose.apply(actions.wrist[0, 1][:, None])[:, 0]


@pytest.mark.parametrize("closes", [False, True])
def test_the_joint_goes_one_way_between_closed_and_a_state_in_its_range(closes):
    found = guided(drawn(), closes, MOST)
    ends = found.joint[0, [-1, 0] if closes else [0, -1]]
    assert ends[0] == 0
    assert MOST / 2 - 1e-6 <= float(ends[1]) <= MOST + 1e-6
    steps = found.joint[0].diff() * (-1 if closes else 1)
    assert (steps >= -1e-6).all()


def test_a_joint_that_was_drawn_still_is_made_to_move():
    still = replace(drawn(), joint=torch.zeros(1, 60))
    joint = guided(still, False, MOST).joint[0]
    assert joint[-1] == pytest.approx(MOST / 2)
    assert joint.diff().abs().amax() < 0.1


def test_the_first_part_rests_on_the_table_and_the_hand_goes_along_with_the_second():
    before = drawn()
    after = guided(before, False, MOST)
    assert torch.equal(after.rotation, torch.eye(3).expand_as(after.rotation))
    assert torch.equal(after.translation, torch.zeros_like(after.translation))
    assert torch.allclose(at_part(after), at_part(before), atol=1e-5)


def test_a_hand_at_the_first_part_stays_with_it():
    before = drawn()
    joint = torch.linspace(0, 0.5, 60)[None]
    after = with_joint(before, joint, torch.tensor([[False, False]]))
    assert torch.allclose(at_part(after, 0), at_part(before, 0), atol=1e-5)


def test_of_two_hands_the_one_nearer_to_the_second_part_opens():
    both = drawn(hands=(True, True))
    for number in range(2):
        wrist = both.wrist.clone()
        wrist[:, 1 - number] -= torch.tensor([0.0, 0.0, 0.3])
        near = replace(both, wrist=wrist)
        assert opener(near, near)[0].tolist() == [number == 0, number == 1]


def test_gaps_are_from_the_second_part_alone_and_without_end_for_absent_hands():
    gaps = part_gaps(drawn())
    assert gaps[0, 0].isinf().all()
    assert (gaps[0, 1] < 0.2).all()
    assert starting_gap(drawn(), drawn())[0, 1] < 0.2


def test_hands_under_the_table_are_measured():
    low = replace(drawn(), wrist=drawn().wrist - torch.tensor([0.0, 0.0, 0.5]))
    assert under_table(low) > 0.3
    assert under_table(replace(drawn(), wrist=drawn().wrist + 1.0)) == 0


@pytest.mark.parametrize("closes", [False, True])
def test_a_part_that_no_hand_is_at_rests_closed(closes):
    away = replace(drawn(), wrist=drawn().wrist + 1.0)
    after = moved_by_hands_at_part(guided(away, closes, MOST), closes)
    assert (after.joint == 0).all()
    assert left_out(drawn(), after) == 1


def test_a_part_moves_only_while_a_hand_is_at_it():
    opened = guided(drawn(), False, MOST)
    middle = opened.points[0][opened.part[0] > 0].mean(0)
    held = replace(opened, wrist=opened.wrist * 0 + middle + torch.tensor([0.05, 0, 0]))
    leaving = held.wrist + (torch.arange(60) > 30)[:, None] * torch.tensor([0.0, 0.0, 1.0])
    after = moved_by_hands_at_part(replace(held, wrist=leaving), False)
    touched = touching_hands(rigid_part(after, 1))[0, 1]
    steps = after.joint[0].diff().abs()
    assert (steps[~(touched[1:] & touched[:-1])] == 0).all()
    assert after.joint[0, 0] == 0
