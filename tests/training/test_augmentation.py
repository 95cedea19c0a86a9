from dataclasses import replace

import pytest
import torch
from draws import seeded
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import TIP_KEYPOINTS, bone_lengths
from geneoh.representation.parameters import HandParameters
from geneoh.representation.region import ObjectSurface
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.grasp_types import FINGER_STD
from geneoh.training.augmentation import (
    AugmentationConfig,
    KeptContactConfig,
    augmented,
    with_kept_contact,
)


@pytest.fixture(scope="module")
def still(interactions) -> HandParameters:
    """Sixteen hands that do not move at all."""
    pick = torch.arange(16) % 4
    orient = torch.eye(3).expand(16, 30, 3, 3)
    fingers = interactions.pose[pick, :1, 1:].expand(16, 30, 15, 3)
    return HandParameters(torch.zeros(16, 30, 3), orient, fingers, interactions.offsets[pick])


def only(**kept: tuple[float, float]) -> AugmentationConfig:
    """Every hand moves in one way alone."""
    nothing = dict.fromkeys(("turn", "shift", "fingers"), (1e-9, 1.01e-9))
    return AugmentationConfig(share=1.0, style_share=0.0, **(nothing | kept))


def test_bones_keep_their_length(still):
    moved = augmented(still, Draws(16, seeded()))
    torch.testing.assert_close(
        bone_lengths(moved.joints), bone_lengths(still.joints), atol=1e-6, rtol=0
    )
    assert float((moved.joints - still.joints).norm(dim=-1).mean()) > 0.005


def test_a_hand_turns_about_its_fingertips(still):
    moved = augmented(still, Draws(16, seeded()), only(turn=(0.2, 0.201)))
    tips = [hand.joints[:, :, list(TIP_KEYPOINTS)].mean(2) for hand in (still, moved)]
    torch.testing.assert_close(tips[0], tips[1], atol=1e-6, rtol=0)
    assert float((moved.wrist - still.wrist).norm(dim=-1).mean()) > 0.01


def test_the_sizes_are_those_asked_for(still):
    config = only(shift=(0.01, 0.0101))
    shift = torch.cat([augmented(still, Draws(16, seeded(s)), config).wrist for s in range(8)])
    assert float(shift.std()) == pytest.approx(0.01, rel=0.15)
    config = only(fingers=(0.5, 0.501))
    bend = torch.cat(
        [augmented(still, Draws(16, seeded(s)), config).fingers - still.fingers for s in range(8)]
    )
    ratio = bend.std((0, 1)) / FINGER_STD
    assert float(ratio.mean()) == pytest.approx(0.5, rel=0.15)


def test_motion_is_smooth(still):
    wrist = augmented(still, Draws(16, seeded()), only(shift=(0.01, 0.0101))).wrist
    speed = wrist.diff(dim=1).norm(dim=-1).mean()
    assert 0 < float(speed) < 0.5 * float(wrist.norm(dim=-1).mean())


def test_equal_generators_vary_alike_and_some_windows_not_at_all(still):
    first, second = (augmented(still, Draws(16, seeded(3))) for _ in range(2))
    assert torch.equal(first.joints, second.joints)
    kept = (first.wrist - still.wrist).norm(dim=-1).amax(1) < 1e-6
    assert 0 < int(kept.sum()) < 16


FRAMES = 8
TOUCH = 0.01
"""Height of the keypoints of a flat hand that lies on the table, metres."""
USUAL, EXACT = KeptContactConfig(), KeptContactConfig(rounds=6, deviation=1e-4)


def table() -> ObjectSurface:
    """The plane y = 0, whose points are a centimetre apart."""
    row = torch.linspace(-0.3, 0.3, 61)
    points = torch.cartesian_prod(row, torch.zeros(1), row)[None]
    return ObjectSurface(
        points=points,
        normals=torch.tensor([0.0, 1, 0]).expand_as(points),
        part=torch.zeros(points.shape[:2], dtype=torch.long),
        rotation=torch.eye(3).expand(1, FRAMES, 1, 3, 3),
        translation=torch.zeros(1, FRAMES, 1, 3),
    )


def flat_hand(height: float) -> HandParameters:
    """A flat hand, palm down, whose lowest keypoint is so high over the table."""
    offsets = load_hand("right").shaped(torch.zeros(1, 10)).offsets
    turn = torch.eye(3).expand(1, FRAMES, 3, 3)
    hand = HandParameters(torch.zeros(1, FRAMES, 3), turn, torch.zeros(1, FRAMES, 15, 3), offsets)
    return shifted(hand, (0.0, height - float(hand.joints[..., 1].min()), 0.0))


def shifted(hand: HandParameters, by: tuple[float, float, float]) -> HandParameters:
    return replace(hand, wrist=hand.wrist + torch.tensor(by))


def off(hand: HandParameters, other: HandParameters) -> Tensor:
    """By how much the heights of touching keypoints differ, metres."""
    touching = hand.joints[..., 1] < TOUCH + 0.002
    assert int(touching.sum()) >= 2 * FRAMES
    return (hand.joints - other.joints)[..., 1][touching].abs()


@pytest.mark.parametrize("height", [-0.01, 0.01])
def test_a_hand_that_was_moved_off_the_surface_or_into_it_comes_back(height):
    before = flat_hand(TOUCH)
    moved = shifted(before, (0.0, height, 0.0))
    assert float(off(before, moved).min()) > 0.009
    assert float(off(before, with_kept_contact(moved, before, table(), EXACT)).max()) < 0.0005
    assert float(off(before, with_kept_contact(moved, before, table(), USUAL)).max()) < 0.002


def test_fingers_that_bent_into_the_surface_come_back():
    before = flat_hand(TOUCH)
    fingers = before.fingers.clone()
    fingers[:, :, :12, 2] = 0.2
    bent = replace(before, fingers=fingers)
    assert float(off(before, bent).max()) > 0.01
    back = with_kept_contact(bent, before, table(), EXACT)
    assert float(off(before, back).max()) < 0.001
    torch.testing.assert_close(
        bone_lengths(back.joints), bone_lengths(before.joints), atol=1e-5, rtol=0
    )


def test_a_hand_may_slide_over_the_surface():
    before = flat_hand(TOUCH)
    moved = shifted(before, (0.03, 0.0, -0.02))
    back = with_kept_contact(moved, before, table(), USUAL)
    torch.testing.assert_close(back.joints, moved.joints, atol=1e-4, rtol=0)


def test_a_hand_that_does_not_touch_keeps_its_motion():
    before = flat_hand(0.1)
    moved = shifted(before, (0.01, -0.03, 0.02))
    back = with_kept_contact(moved, before, table(), USUAL)
    torch.testing.assert_close(back.joints, moved.joints, atol=1e-6, rtol=0)


def test_a_hand_that_did_not_touch_keeps_out_of_the_object():
    before = flat_hand(0.05)
    back = with_kept_contact(shifted(before, (0.0, -0.06, 0.0)), before, table(), EXACT)
    assert float(back.joints[..., 1].min()) > EXACT.near - 0.001


def test_the_object_may_move():
    before, moved = flat_hand(TOUCH), shifted(flat_hand(TOUCH), (0.01, -0.01, 0.0))
    turn = axis_angle_to_matrix(torch.linspace(0, 1, FRAMES)[None, :, None] * torch.ones(3))
    shift = torch.linspace(0, 0.5, FRAMES)[None, :, None] * torch.tensor([1.0, 2, 3])

    def carried(hand: HandParameters) -> HandParameters:
        wrist = (turn @ hand.wrist[..., None])[..., 0] + shift
        return replace(hand, wrist=wrist, turn=turn @ hand.turn)

    surface = replace(table(), rotation=turn[:, :, None], translation=shift[:, :, None])
    there = with_kept_contact(carried(moved), carried(before), surface, EXACT)
    assert float((there.joints - carried(before).joints).norm(dim=-1).max()) < 0.02
    height = (turn.mT @ (there.wrist - shift)[..., None])[..., 0][..., 1]
    torch.testing.assert_close(height, before.wrist[..., 1], atol=0.002, rtol=0)


def test_corrections_are_smooth_over_time():
    before = flat_hand(TOUCH)
    wrist = before.wrist.clone()
    wrist[:, FRAMES // 2 :, 1] -= 0.01
    back = with_kept_contact(replace(before, wrist=wrist), before, table(), USUAL)
    step = (back.joints - replace(before, wrist=wrist).joints)[..., 1].diff(dim=1).abs()
    assert float(step.max()) < 0.006


def test_without_rounds_nothing_changes():
    before, moved = flat_hand(TOUCH), shifted(flat_hand(TOUCH), (0.0, -0.01, 0.0))
    back = with_kept_contact(moved, before, table(), KeptContactConfig(rounds=0))
    assert torch.equal(back.joints, moved.joints)


def test_hands_that_are_not_chosen_stay_as_they_are():
    before, moved = flat_hand(TOUCH), shifted(flat_hand(TOUCH), (0.0, -0.01, 0.0))
    back = with_kept_contact(moved, before, table(), EXACT, torch.tensor([False]))
    torch.testing.assert_close(back.joints, moved.joints, atol=1e-6, rtol=0)
