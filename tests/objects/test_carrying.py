"""What carries a hand through the frames in which it is not seen."""

from dataclasses import replace

import pytest
import torch
import trimesh

from geneoh.geometry.mesh_files import from_trimesh
from geneoh.objects import carrying
from geneoh.objects.carrying import carrier_of, without_sparse_frames
from geneoh.sequence.sequence import HandTrack, ObjectTrack

FRAMES, LOST = 12, slice(4, 9)
BALL = from_trimesh(trimesh.creation.icosphere(subdivisions=2, radius=0.03))
PLACES = torch.zeros(FRAMES, 2, 3)
PLACES[:, 1, 0] = 1.0
OBJECT = ObjectTrack((BALL, BALL), torch.eye(3).repeat(FRAMES, 2, 1, 1), PLACES)
RELIED = torch.ones(FRAMES, 2)


def hand_at(before: float, after: float) -> HandTrack:
    """A hand so far from the surface of the second ball before its gap and after it, metres."""
    away = torch.cat([torch.full((6,), before), torch.full((6,), after)])
    joints = torch.zeros(FRAMES, 21, 3)
    joints[..., 0] = (1.03 + away)[:, None]
    valid = torch.ones(FRAMES, dtype=torch.bool)
    valid[LOST] = False
    return HandTrack("right", valid, joints=joints.masked_fill(~valid[:, None, None], torch.nan))


@pytest.mark.parametrize(
    ("before", "after", "share"), [(0.0, 0.01, (1, 1)), (0.0225, 0.1, (0.5, 0)), (0.1, 0.1, (0, 0))]
)
def test_a_hand_is_carried_by_the_part_that_it_is_at_beside_its_gap(before, after, share):
    carrier = carrier_of(hand_at(before, after), OBJECT.surface(), RELIED)
    assert carrier.pose.translation.equal(PLACES[:, 1])
    found = carrier.share[[LOST.start - 1, LOST.stop]]
    torch.testing.assert_close(found, torch.tensor(share).float(), atol=0.05, rtol=0)
    assert float(carrier.share[: LOST.start - 1].sum() + carrier.share[LOST.stop + 1 :].sum()) == 0


@pytest.mark.parametrize(
    ("speed", "along", "share"), [(0.0, 0.0, 1), (0.01, 1.0, 1), (0.01, 0.0, 0)]
)
def test_a_hand_is_carried_by_what_it_moves_with_and_not_by_what_passes_under_it(
    speed, along, share
):
    """A belt of two metres, on which the hand lies or which it lets pass, metres a frame."""
    belt = from_trimesh(trimesh.creation.box((2.0, 0.1, 0.02)))
    path = torch.arange(FRAMES)[:, None] * torch.tensor([speed, 0.0, 0.0])
    motion = ObjectTrack((belt,), torch.eye(3).repeat(FRAMES, 1, 1, 1), path[:, None])
    noise = 0.001 * torch.randn(FRAMES, 1, 3, generator=torch.Generator().manual_seed(0))
    joints = (along * path + torch.tensor([0.0, 0.0, 0.015]))[:, None].repeat(1, 21, 1) + noise
    valid = torch.arange(FRAMES) < LOST.start
    carrier = carrier_of(HandTrack("right", valid, joints=joints), motion.surface(), RELIED[:, :1])
    assert float(carrier.share[LOST.start - 1]) == pytest.approx(share, abs=0.1)


def test_a_part_carries_no_more_than_its_poses_are_relied_on():
    relied = RELIED.clone()
    relied[LOST.stop :, 1] = 0.25
    carrier = carrier_of(hand_at(0.0, 0.0), OBJECT.surface(), relied)
    assert carrier.share[[LOST.start - 1, LOST.stop]].tolist() == [1.0, 0.25]


def test_a_hand_that_is_seen_all_along_needs_no_carrier():
    joints = torch.zeros(FRAMES, 21, 3)
    seen = HandTrack("right", torch.ones(FRAMES, dtype=torch.bool), joints=joints)
    assert carrier_of(seen, OBJECT.surface(), RELIED) is None


@pytest.mark.parametrize(("count", "away", "kept"), [(6, 0.0, 0), (7, 0.0, 5), (6, 0.1, 5)])
def test_frames_of_few_keypoints_are_left_out_where_the_object_carries_the_hand(count, away, kept):
    hand = hand_at(away, away)
    trust = torch.ones(FRAMES, 21)
    trust[LOST, count:] = 0
    seen = torch.ones_like(hand.valid)
    hand = replace(hand, valid=seen, joints=hand.joints.nan_to_num(), confidence=trust)
    found = without_sparse_frames(hand, OBJECT.surface(), RELIED)
    assert int(found.valid[LOST].sum()) == kept
    assert int(found.valid.sum()) == kept + FRAMES - 5


def test_few_keypoints_in_most_frames_are_how_the_hand_is_seen():
    hand = hand_at(0.0, 0.0)
    trust = torch.ones(FRAMES, 21)
    trust[2:10, 6:] = 0
    seen = torch.ones_like(hand.valid)
    hand = replace(hand, valid=seen, joints=hand.joints.nan_to_num(), confidence=trust)
    assert without_sparse_frames(hand, OBJECT.surface(), RELIED) is hand


def test_few_keypoints_are_kept_where_the_gap_in_their_place_would_be_long(monkeypatch):
    monkeypatch.setattr(carrying, "LONGEST_SPARSE", 4.0)
    hand = hand_at(0.0, 0.0)
    trust = torch.ones(FRAMES, 21)
    trust[LOST, 6:] = 0
    seen = torch.ones_like(hand.valid)
    hand = replace(hand, valid=seen, joints=hand.joints.nan_to_num(), confidence=trust)
    assert without_sparse_frames(hand, OBJECT.surface(), RELIED) is hand
