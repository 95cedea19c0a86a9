"""The motion of a camera, by an object that no hand moves."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from short_clips import example

from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.objects.still_frame import held_shares, speed_of, still_frame
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.seeds import seeded_generator
from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.placing import placed
from geneoh.sequence.resample import at_rate
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

FRAMES = 60


def kettle() -> Sequence:
    """A hand comes, lifts a kettle from frame 23 to 39 and goes."""
    return draw_clip("kettle", 0, FRAMES)


def drawer() -> Sequence:
    return draw_clip("drawer", 1, FRAMES)


def head(sequence: Sequence) -> Rigid:
    """World to a camera that turns and sways before the scene."""
    time = torch.arange(sequence.frames) / sequence.fps
    waves = torch.stack([torch.sin(a * time + a) for a in (2.1, 2.9, 3.7)], 1)
    turn = axis_angle_to_matrix(math.radians(15) * waves)
    middle = sequence.object.translation.mean((0, 1)) - torch.tensor([0.0, 0.0, 0.5])
    return Rigid(turn, 0.05 * waves.flip(1) - turn @ middle)


def seen_by_head(sequence: Sequence) -> Sequence:
    return placed(sequence, head(sequence))


def found(sequence: Sequence, relied: float = 1.0) -> Rigid | None:
    motion = sequence.object
    trust = torch.full(motion.translation.shape[:2], relied)
    return still_frame(sequence.hands, motion, sequence.fps, trust)


def shares(hands: tuple[HandTrack, ...], clip: Sequence) -> np.ndarray:
    tracks = [filled_keypoints(hand) for hand in hands]
    return held_shares(hands, tracks, clip.object, clip.fps)


def speed(sequence: Sequence) -> torch.Tensor:
    """Distance of the first part's origin from frame to frame, metres."""
    return sequence.object.translation[:, 0].diff(dim=0).norm(dim=-1)


def test_the_speed_of_points_is_their_mean():
    path = torch.arange(FRAMES)[:, None, None] * torch.tensor([[0.01, 0.0, 0.0], [0.0, 0.0, 0.03]])
    assert speed_of(path, 30.0)[20:40].tolist() == pytest.approx([0.6] * 20, rel=0.01)


@pytest.mark.parametrize("noise", ["clean", "gauss", "camera"])
@pytest.mark.parametrize("made", [kettle, drawer, example])
def test_a_camera_that_stands_still_is_left_as_it_is(made, noise):
    clip = made()
    if noise != "clean":
        clip = corrupt_sequence(clip, noise, generator=seeded_generator("still", noise))
    assert found(clip) is None


@pytest.mark.parametrize("seed", range(3))
def test_someone_who_walks_with_an_object_does_not_move_the_camera(seed):
    frames = [len(kettle().hands[0].valid) // 2] * FRAMES
    time = torch.arange(FRAMES) / kettle().fps
    way = torch.stack([2.0 * time, 0 * time, 0.03 * torch.sin(18 * time)], 1)
    walks = placed(kettle()[frames], Rigid(torch.eye(3).expand(FRAMES, 3, 3), way))
    generator = seeded_generator("walks", seed)
    assert found(corrupt_sequence(walks, "camera", generator=generator)) is None


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0, 120.0])
def test_an_object_that_no_hand_moves_rests_in_the_still_frame(fps):
    clip = at_rate(seen_by_head(kettle()), fps)
    pose = found(clip)
    assert pose is not None
    moves = speed(placed(clip, pose)) * fps
    assert float(speed(clip).median()) * fps > 0.2
    away = round(7 * fps / 30)
    assert float(moves[:away].max()) < 0.02
    assert float(moves[-away:].max()) < 0.02
    assert float(moves.max()) > 0.5  # the hand lifts it


def test_the_still_frame_is_that_of_the_first_frame_and_keeps_what_hand_and_object_do():
    clip = seen_by_head(kettle())
    pose = found(clip)
    torch.testing.assert_close(pose.rotation[0], torch.eye(3))
    torch.testing.assert_close(pose.translation[0], torch.zeros(3))
    still = placed(clip, pose)
    for one, other in ((still, clip), (placed(still, pose.inverse()), clip)):
        (hand, motion), (given, there) = ((s.hands[0], s.object) for s in (one, other))
        own = Rigid(motion.rotation[:, 0], motion.translation[:, 0]).inverse().apply(hand.joints)
        own_given = Rigid(there.rotation[:, 0], there.translation[:, 0]).inverse()
        torch.testing.assert_close(own, own_given.apply(given.joints), atol=1e-5, rtol=0)
    back = placed(still, pose.inverse())
    torch.testing.assert_close(back.hands[0].pose, clip.hands[0].pose, atol=1e-4, rtol=0)


def test_the_part_that_no_hand_moves_shows_the_motion_of_the_camera():
    motion, aside = kettle().object, torch.tensor([1.0, 0.0, 0.0])
    turns, places = motion.rotation[:1].expand_as(motion.rotation), motion.translation[:1] + aside
    both = ObjectTrack(
        motion.meshes * 2,
        torch.cat([motion.rotation, turns], dim=1),
        torch.cat([motion.translation, places.expand_as(motion.translation)], dim=1),
    )
    clip = seen_by_head(replace(kettle(), object=both))
    still = placed(clip, found(clip)).object.translation
    assert shares(clip.hands, clip).max(0).tolist() == [1.0, 0.0]
    assert float((still[:, 1] - still[:1, 1]).norm(dim=-1).max()) < 5e-4


def test_a_second_hand_that_moves_the_object_counts():
    clip = seen_by_head(kettle())
    far = replace(clip.hands[0].mirrored(), joints=clip.hands[0].joints + 1.0)
    for hands in ((far, clip.hands[0]), (clip.hands[0], far)):
        both = shares(hands, clip)
        assert (both == shares(clip.hands, clip)).all()


@pytest.mark.parametrize("start", [2, 18, 34])
def test_a_hand_that_is_lost_while_it_holds_shows_no_camera(start):
    clip = draw_clip("kettle", 0, 150)[47:99]  # carried all the time
    assert found(clip) is None
    observed = torch.ones(clip.frames, dtype=torch.bool)
    observed[start : start + 15] = False
    lost = replace(clip, hands=(replace(clip.hands[0], valid=observed),))
    assert found(lost) is None
    assert shares(lost.hands, clip).min() > 0.5


def test_errors_along_the_camera_ray_of_a_hand_that_carries_show_no_camera():
    clip = draw_clip("kettle", 0, 150)[47:99]  # carried all the time
    (hand,) = clip.hands
    ray = torch.nn.functional.normalize(torch.tensor([0.3, 0.2, 1.0]), dim=0)
    wave = 0.04 * torch.sin(6.0 * torch.arange(clip.frames) / clip.fps)
    errs = replace(hand, joints=hand.joints + wave[:, None, None] * ray)
    told = replace(errs, camera_ray=ray.expand(clip.frames, 3))
    assert found(replace(clip, hands=(errs,))) is not None
    assert found(replace(clip, hands=(told,))) is None


def test_a_camera_that_moves_is_found_with_its_ray_too():
    clip = seen_by_head(kettle())
    (hand,) = clip.hands
    ray = torch.nn.functional.normalize(hand.joints[:, 0], dim=-1)
    told = replace(clip, hands=(replace(hand, camera_ray=ray),))
    moves = speed(placed(told, found(told))) * clip.fps
    assert float(moves[:7].max()) < 0.02
    assert float(moves[-7:].max()) < 0.02
    assert float(moves.max()) > 0.5  # the hand lifts it


def test_an_object_whose_poses_are_unreliable_shows_no_motion_of_the_camera():
    clip = seen_by_head(kettle())
    assert found(clip, relied=0.5) is not None
    assert found(clip, relied=0.3) is None


def test_a_hand_that_waits_while_something_else_moves_the_object_shows_no_camera():
    clip = seen_by_head(kettle())
    (hand,) = clip.hands
    waits = replace(hand, joints=hand.joints[:1].expand(FRAMES, -1, -1) + 0.1)
    assert found(replace(clip, hands=(waits,))) is None
    assert found(replace(clip, hands=(hand,))) is not None


def test_camera_rays_turn_with_the_hand():
    ray = torch.nn.functional.normalize(kettle().hands[0].joints[:, 0], dim=-1)
    clip = replace(kettle(), hands=(replace(kettle().hands[0], camera_ray=ray),))
    pose = head(clip)
    turned = placed(clip, pose).hands[0].camera_ray
    torch.testing.assert_close(turned, (pose.rotation @ ray[..., None])[..., 0])


@pytest.mark.slow
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_moving_camera_makes_a_clean_hand_no_worse(mirrored):
    clip = kettle()
    if mirrored:
        hands, motion = (kettle().hands[0].mirrored(),), kettle().object.mirrored()
        clip = replace(kettle(), hands=hands, object=motion)
    seen = seen_by_head(clip)
    result = denoise(seen, Options(preset="fast"))
    assert any("the camera moves" in note for note in result.notes)
    (hand,) = result.hands.values()
    truth = seen.hands[0].joints
    apart = [float((x - truth).norm(dim=-1).mean()) for x in (hand.track.joints, hand.samples[0])]
    # 3.6 mm with the camera's motion taken for the object's
    assert max(apart) < 0.002
    assert result.sequence.object == seen.object


@pytest.mark.slow
def test_samples_of_another_rate_are_given_back_in_the_frame_of_the_camera():
    seen = at_rate(seen_by_head(kettle()), 60.0)
    result = denoise(seen, Options(preset="fast"))
    (hand,) = result.hands.values()
    truth = at_rate(seen, 30.0).hands[0].joints
    assert hand.samples.shape[1] == len(truth)
    assert float((hand.samples[0] - truth).norm(dim=-1).mean()) < 0.004
