"""The direction from the camera to the hand: made from a position or rays, kept by every change."""

from dataclasses import replace

import pytest
import torch

from geneoh.errors import InputError
from geneoh.geometry.mirror import mirror_points
from geneoh.sequence.camera import seen_from, with_rays
from geneoh.sequence.normalisation import normalised_hands
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.validation import check_sequence

FRAMES = 61
ORIGIN = torch.zeros(1, 3)


def sequence(fps: float = 60.0) -> Sequence:
    """Two hands that move past a camera at the origin; the right one is lost in one frame."""
    place = torch.tensor([0.3, -0.1, 0.2]) * torch.linspace(-1, 1, FRAMES)[:, None]
    spread = torch.arange(21.0)[:, None] * torch.tensor([0.005, 0.003, -0.002])
    joints = torch.tensor([0.0, 0.0, 0.6]) + place[:, None] + spread
    valid = torch.arange(FRAMES) != 20
    right = HandTrack("right", valid, joints=torch.where(valid[:, None, None], joints, torch.nan))
    left = HandTrack("left", torch.ones(FRAMES, dtype=torch.bool), joints=joints - 0.2)
    still = torch.eye(3).expand(FRAMES, 1, 3, 3)
    return Sequence((right, left), ObjectTrack((), still, place[:, None]), fps)


def test_rays_of_a_camera_position_point_at_the_wrist_of_each_hand():
    for hand in seen_from(sequence(), ORIGIN, "here").hands:
        away = hand.joints[hand.valid, 0]
        along = (away * hand.camera_ray[hand.valid]).sum(-1)
        torch.testing.assert_close(along, away.norm(dim=-1))
        torch.testing.assert_close(hand.camera_ray.norm(dim=-1), torch.ones(FRAMES))


def test_a_camera_beyond_all_scenes_is_doubted(caplog):
    seen_from(sequence(), ORIGIN, "here")
    assert not caplog.messages
    path = torch.tensor([0.0, 0.0, 1000.0]) * torch.linspace(1, 2, FRAMES)[:, None]
    seen_from(sequence(), path, "here")
    assert "here is 1000 m from the origin of the world" in caplog.text


def test_a_moving_camera_has_one_place_for_each_frame():
    given = sequence()
    places = given.hands[1].joints[:, 0] - torch.tensor([0.0, 2.0, 0.0])
    (_, left) = seen_from(given, places, "here").hands
    torch.testing.assert_close(left.camera_ray, torch.tensor([[0.0, 1.0, 0.0]]).expand(FRAMES, 3))


def test_one_ray_of_any_length_serves_all_frames_and_hands():
    for hand in with_rays(sequence(), torch.tensor([[0.0, 0.0, 4.0]]), "here").hands:
        assert hand.camera_ray.equal(torch.tensor([0.0, 0.0, 1.0]).expand(FRAMES, 3))


def test_cutting_keeps_the_rays_of_the_frames():
    seen = seen_from(sequence(), ORIGIN, "here")
    assert seen[5:9].hands[0].camera_ray.equal(seen.hands[0].camera_ray[5:9])


def test_the_networks_get_mirrored_rays_at_their_own_rate():
    seen = seen_from(sequence(), ORIGIN, "here")
    for hand, given in zip(normalised_hands(seen), seen.hands, strict=True):
        wanted = given.camera_ray if given.side == "right" else mirror_points(given.camera_ray)
        there = given.valid[::2]  # rays of lost frames are filled as their hands are
        assert hand.track.frames == 31
        torch.testing.assert_close(
            hand.track.camera_ray[there],
            wanted[::2][there],
            atol=2e-4,
            rtol=0,  # of means
        )


def test_rays_between_two_frames_have_length_one():
    for hand in normalised_hands(seen_from(sequence(fps=47.0), ORIGIN, "here")):
        torch.testing.assert_close(
            hand.track.camera_ray.norm(dim=-1), torch.ones(hand.track.frames), atol=1e-6, rtol=0
        )


@pytest.mark.parametrize(
    ("rays", "message"),
    [
        (torch.zeros(1, 3), "x must give a direction in every frame, got length 0 in frame 0"),
        (torch.tensor([[0.0, torch.nan, 1.0]]), "x must be finite in every frame"),
        (torch.ones(60, 3), "x must be one vector or one for each of the 61 frames, got 60"),
    ],
)
def test_rays_that_are_none_are_refused(rays, message):
    with pytest.raises(InputError, match=message):
        with_rays(sequence(), rays, "x")


def test_a_camera_in_the_wrist_is_refused():
    with pytest.raises(InputError, match="got length 0 in frame 7"):
        seen_from(sequence(), sequence().hands[1].joints[7:8, 0], "x")


def test_rays_that_were_not_normalised_are_refused():
    given = sequence()
    hands = (replace(given.hands[0], camera_ray=torch.ones(FRAMES, 3)), given.hands[1])
    with pytest.raises(InputError, match="camera_ray of the right hand must be 61 directions"):
        check_sequence(replace(given, hands=hands))
