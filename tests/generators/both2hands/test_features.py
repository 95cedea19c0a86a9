from dataclasses import replace

import pytest
import torch
from made_bodies import SKELETON, made_motion

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import BODY_JOINTS
from geneoh.generators.both2hands.features import (
    HANDS,
    PlacedBodies,
    body_features,
    hand_features,
    placed,
    with_fingers,
)
from geneoh.geometry.rotations import axis_angle_to_matrix

FRAMES = ("wrist", "world")


def flat_handed(motion):
    rotations = motion.rotations.clone()
    rotations[..., BODY_JOINTS:, :, :] = torch.eye(3)
    return replace(motion, rotations=rotations)


def carried(motion: BodyMotion, turn: float) -> BodyMotion:
    away = axis_angle_to_matrix(torch.tensor([0.0, turn, 0.0]))
    rotations = motion.rotations.clone()
    rotations[..., 0, :, :] = away @ rotations[..., 0, :, :]
    root = motion.root @ away.mT + torch.tensor([7.0, 0.0, -3.0])
    return BodyMotion(root, rotations)


def test_sizes_are_those_of_the_paper():
    posed = pose(SKELETON, made_motion())
    assert body_features(posed).shape[-1] == 198
    assert hand_features(posed, "world").shape[-1] == HANDS == 270


@pytest.mark.parametrize("frame", FRAMES)
def test_fingers_come_back_out_of_features(frame):
    motion = made_motion()
    posed = pose(SKELETON, motion)
    found = with_fingers(flat_handed(motion), posed, hand_features(posed, frame), frame)
    torch.testing.assert_close(found.rotations, motion.rotations, atol=1e-5, rtol=0)


@pytest.mark.parametrize("frame", FRAMES)
def test_local_hands_on_the_body_are_its_own_hands_root_translation_included(frame):
    motion = made_motion()
    posed, bare = pose(SKELETON, motion), flat_handed(motion)
    local = hand_features(posed, "wrist")
    found = PlacedBodies.of(SKELETON, bare).projected(local, frame)
    torch.testing.assert_close(found, hand_features(posed, frame), atol=1e-5, rtol=0)


def test_features_of_a_wrist_know_nothing_of_where_the_body_is():
    motion = made_motion()
    there = carried(motion, 2.0)
    pairs = [hand_features(pose(SKELETON, each), "wrist") for each in (motion, there)]
    torch.testing.assert_close(*pairs, atol=1e-5, rtol=0)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_body_that_is_carried_elsewhere_is_placed_the_same(frame):
    motion = made_motion()
    first, second = (placed(each, frame) for each in (motion, carried(motion, -1.3)))
    torch.testing.assert_close(first.root, second.root, atol=1e-4, rtol=0)
    torch.testing.assert_close(first.rotations, second.rotations, atol=1e-5, rtol=0)
    seen = slice(None) if frame == "wrist" else slice(1)
    ahead = first.rotations[:, seen, 0, :, 2]
    torch.testing.assert_close(ahead[..., 0], torch.zeros_like(ahead[..., 0]), atol=1e-5, rtol=0)
    assert ahead[..., 2].gt(0).all()
    assert first.root[:, seen, ::2].abs().max() < 1e-5
    torch.testing.assert_close(first.root[..., 1], motion.root[..., 1])
