"""The border between the user's hands and the networks': there and back."""

from dataclasses import replace

import pytest
import torch

from geneoh.geometry.mirror import mirror_points
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.sequence.normalisation import NETWORK_FPS, normalised_hands
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

FRAMES = 61


def sequence(fps: float = 60.0) -> Sequence:
    """Two hands that move on straight lines, and an object that turns."""
    time = torch.linspace(0, 1, FRAMES)
    place = torch.tensor([0.3, -0.1, 0.2]) * time[:, None]
    joints = place[:, None] + torch.arange(21.0)[:, None] * torch.tensor([0.005, 0.003, -0.002])
    valid = torch.ones(FRAMES, dtype=torch.bool)
    right = HandTrack("right", valid, joints=joints)
    left = HandTrack("left", valid, joints=joints + 0.1)
    turn = axis_angle_to_matrix(torch.tensor([0.0, 0.0, 1.0]) * time[:, None])[:, None]
    return Sequence((right, left), ObjectTrack((), turn, place[:, None]), fps)


def test_every_hand_is_a_right_one_at_the_networks_rate():
    for hand in normalised_hands(sequence()):
        assert hand.track.side == "right"
        assert hand.fps == NETWORK_FPS
        assert hand.track.frames == 31
        assert len(hand.object.rotation) == 31


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_what_nothing_happened_to_comes_back_as_it_went(fps):
    given = sequence(fps)
    for hand, original in zip(normalised_hands(given), given.hands, strict=True):
        back = hand.track_to_user(hand.track)
        assert back.side == original.side
        torch.testing.assert_close(back.joints, original.joints, atol=1e-6, rtol=0)


def test_a_left_hand_keeps_its_place_on_its_object():
    right, left = normalised_hands(sequence())
    torch.testing.assert_close(left.object.translation, mirror_points(right.object.translation))
    gap = (left.track.joints - left.object.translation).norm(dim=-1)
    own = sequence().hands[1].joints - sequence().object.translation
    torch.testing.assert_close(gap, own.norm(dim=-1)[::2], atol=1e-6, rtol=0)


def test_results_take_the_side_and_the_frames_of_the_sequence():
    right, left = normalised_hands(sequence())
    points = torch.arange(6.0).reshape(2, 3)
    assert torch.equal(right.points_to_user(points), points)
    assert torch.equal(left.points_to_user(points), mirror_points(points))
    model = load_hand("left")
    assert left.right_model(model).side == "right"
    assert right.right_model(load_hand("right")) is load_hand("right")


def test_flags_go_to_the_nearest_frames():
    (hand,) = normalised_hands(replace(sequence(), hands=sequence().hands[:1]))
    flags = torch.zeros(31, dtype=torch.bool)
    flags[[0, 10]] = True
    back = hand.frames_to_user(flags)
    assert back.shape == (FRAMES,)
    assert back.nonzero().flatten().tolist() == [0, 1, 19, 20, 21]


@pytest.mark.parametrize("fps", [24.0, 60.0, 120.0])
def test_a_result_has_no_corners_at_the_frames_of_the_networks(fps):
    """Straight lines between them accelerate in those frames alone, four times as much at 120."""
    count = round(2 * fps) + 1
    given = replace(sequence(fps), object=ObjectTrack.resting((), count))
    track = swinging(torch.linspace(0, 2, count))
    (hand,) = normalised_hands(replace(given, hands=(track,)))
    back = hand.track_to_user(swinging(torch.linspace(0, 2, hand.track.frames)))
    for name, tolerance in (("wrist", 5e-5), ("joints", 5e-5), ("pose", 5e-4)):
        came, went = getattr(back, name), getattr(track, name)
        torch.testing.assert_close(came, went, atol=tolerance, rtol=0)
        bent = came[2:] - 2 * came[1:-1] + came[:-2]
        most = (went[2:] - 2 * went[1:-1] + went[:-2]).abs().max()
        assert bent.abs().max() < 1.3 * most


def swinging(seconds: torch.Tensor) -> HandTrack:
    """A hand that swings and turns once a second."""
    phase = torch.sin(2 * torch.pi * seconds)
    wrist = phase[:, None] * torch.tensor([0.03, 0.0, 0.04])
    pose = phase[:, None, None] * torch.full((16, 3), 0.3)
    joints = wrist[:, None] + torch.arange(21.0)[:, None] * torch.tensor([0.005, 0.003, -0.002])
    valid = torch.ones(len(seconds), dtype=torch.bool)
    return HandTrack("right", valid, joints=joints, pose=pose, wrist=wrist, betas=torch.zeros(10))
