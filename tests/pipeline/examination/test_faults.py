"""Frames in which a tracker lost the hand without saying so."""

import math
from dataclasses import replace

import pytest
import torch

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.library import load_hand
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.examination.faults import without_faults
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.keypoints import PALM
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.resample import at_rate
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.shots import shots_of
from tools.noisy_objects.clips import shaken

FROM, UNTIL = 70, 77
"""Faulty frames of the recording, in which its hand moves."""


def with_hand(sequence: Sequence, **changed: torch.Tensor | None) -> Sequence:
    """The sequence with another hand."""
    return replace(sequence, hands=(replace(sequence.hands[0], **changed),))


def keys_of(sequence: Sequence, joints: torch.Tensor) -> Sequence:
    """The sequence with keypoints alone, which are `joints` in the faulty frames."""
    mixed = sequence.hands[0].joints.clone()
    mixed[FROM:UNTIL] = joints[FROM:UNTIL]
    return with_hand(sequence, joints=mixed, pose=None, wrist=None, betas=None)


def elsewhere(hand: HandTrack) -> torch.Tensor:
    return hand.joints + torch.tensor([0.2, -0.2, 0.1])


def turned_about_its_axis(hand: HandTrack) -> torch.Tensor:
    along = torch.nn.functional.normalize(hand.joints[:, 9] - hand.joints[:, 0], dim=-1)
    wrist = hand.joints[:, :1]
    return wrist + (hand.joints - wrist) @ axis_angle_to_matrix(math.pi * along).mT


def of_the_other_side(hand: HandTrack) -> torch.Tensor:
    """Reflected at the plane of the palm, where the hand stays."""
    across = torch.linalg.cross(
        hand.joints[:, 5] - hand.joints[:, 0], hand.joints[:, 17] - hand.joints[:, 0]
    )
    normal = torch.nn.functional.normalize(across, dim=-1)[:, None]
    apart = hand.joints - hand.joints[:, :1]
    return hand.joints - 2 * (apart * normal).sum(-1, keepdim=True) * normal


def missing(sequence: Sequence) -> list[int]:
    """Frames that count as missing."""
    return (~without_faults(sequence)[0].hands[0].valid).nonzero()[:, 0].tolist()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (elsewhere, "the left hand leaps farther than a hand can move in 7 frames"),
        (turned_about_its_axis, "the left hand turns faster than a hand can turn in 7 frames"),
        (of_the_other_side, "the left hand is bent backward"),
    ],
)
def test_hands_that_cannot_be_there_are_missing(noisy, wrong, words):
    given = keys_of(noisy, wrong(noisy.hands[0]))
    assert missing(given) == list(range(FROM, UNTIL))
    (said,) = without_faults(given)[1]
    assert said.startswith(words)
    assert said.endswith("7 frames: taken as missing")


@pytest.mark.parametrize("metres", [0.12, 0.2, 0.4])
def test_a_tracker_that_follows_another_hand_for_half_a_second_comes_back(clean, metres):
    sequence = keys_of(clean, clean.hands[0].joints)
    mixed = sequence.hands[0].joints.clone()
    mixed[50:68] += torch.tensor([0.6, -0.64, 0.48]) * metres
    assert missing(with_hand(sequence, joints=mixed)) == list(range(50, 68))


@pytest.mark.parametrize("frames", [5, 12, 16, 19])
@pytest.mark.parametrize("noise", ["gauss", "gauss_strong", "drift"])
def test_a_hand_that_is_turned_over_for_half_a_second_is_missing(clean, frames, noise):
    given = corrupt_sequence(clean, noise, generator=torch.Generator().manual_seed(3))
    mixed = given.hands[0].joints.clone()
    turned = slice(50, 50 + frames)
    mixed[turned] = turned_about_its_axis(given.hands[0])[turned]
    given = with_hand(given, joints=mixed, pose=None, wrist=None, betas=None)
    assert missing(given) == list(range(50, 50 + frames))


@pytest.mark.parametrize(("frames", "between"), [(6, 3), (10, 6), (12, 19)])
def test_of_a_hand_that_is_turned_over_twice_the_frames_between_are_kept(clean, frames, between):
    mixed = clean.hands[0].joints.clone()
    again = 50 + frames + between
    for turned in (slice(50, 50 + frames), slice(again, again + frames)):
        mixed[turned] = turned_about_its_axis(clean.hands[0])[turned]
    given = with_hand(clean, joints=mixed, pose=None, wrist=None, betas=None)
    assert missing(given) == [*range(50, 50 + frames), *range(again, again + frames)]


def test_hand_and_object_of_a_video_that_is_cut_to_and_fro_are_no_fault(clean):
    shift = torch.zeros(clean.frames, 1, 3)
    shift[50:68] = torch.tensor([0.2, -0.2, 0.1])
    sequence = keys_of(clean, clean.hands[0].joints)
    cut = with_hand(sequence, joints=sequence.hands[0].joints + shift)
    moved = replace(cut.object, translation=cut.object.translation + shift)
    assert missing(replace(cut, object=moved)) == []


def test_a_palm_that_a_tracker_never_finds_has_no_fault(noisy):
    joints, trust = noisy.hands[0].joints.clone(), torch.ones(noisy.frames, 21)
    joints[:, PALM], trust[:, PALM] = 0.0, 0.0  # some write zeros where they found nothing
    given = with_hand(noisy, joints=joints, confidence=trust, pose=None, wrist=None, betas=None)
    assert without_faults(given)[1] == ()


def test_of_two_hands_in_turn_one_is_kept(noisy):
    joints, frames = noisy.hands[0].joints, torch.arange(noisy.frames)[:, None, None]
    for other in (frames % 2 == 1, (frames % 10 < 2) | (frames % 10 == 5)):
        mixed = torch.where(other, joints + torch.tensor([0.4, 0.0, 0.0]), joints)
        lost = missing(with_hand(noisy, joints=mixed, pose=None, wrist=None, betas=None))
        assert lost == other.flatten().nonzero()[:, 0].tolist()


def test_a_frozen_hand_is_missing_but_for_its_first_frame(noisy):
    hand = noisy.hands[0]
    frames = torch.arange(noisy.frames)
    frames[FROM:UNTIL] = FROM
    frozen = hand.map(lambda values: values[frames], "T")
    given = replace(noisy, hands=(frozen,))
    assert missing(given) == list(range(FROM + 1, UNTIL))
    assert "repeats the frame before" in without_faults(given)[1][0]


@pytest.mark.parametrize("keys", [False, True])
def test_frames_that_a_program_filled_on_lines_are_missing(noisy, keys):
    (hand,) = noisy.hands
    hand = replace(hand, pose=None, wrist=None, betas=None) if keys else hand
    valid = hand.valid.clone()
    valid[FROM:UNTIL] = False
    filled = replace(fill_gaps(replace(hand, valid=valid)), valid=hand.valid)
    given = replace(noisy, hands=(filled,))
    assert missing(given) == list(range(FROM, UNTIL))
    (said,) = without_faults(given)[1]
    assert "moves on straight lines at an exactly even speed in 7 frames" in said


@pytest.mark.parametrize("keys", [False, True])
def test_fingers_at_one_pose_become_those_around_them(noisy, clean, keys):
    hand = noisy.hands[0]
    pose = hand.pose.clone()
    pose[FROM:UNTIL, 1:] = 0.0
    model = load_hand("left").shaped(torch.zeros(10))
    joints = model.joints_from_rotations(axis_angle_to_matrix(pose), hand.joints[:, 0])
    given = with_hand(noisy, joints=joints, pose=None if keys else pose, wrist=None, betas=None)
    found, said = without_faults(given)
    assert missing(given) == []
    assert "has fingers that keep still" in said[0]
    mended, wrong = found.hands[0], slice(FROM, UNTIL)
    assert (mended.confidence < 1).any(-1).nonzero()[:, 0].tolist() == list(range(FROM, UNTIL))
    torch.testing.assert_close(mended.joints[:, list(PALM)], joints[:, list(PALM)])
    before, after = (
        (points[wrong] - clean.hands[0].joints[wrong]).norm(dim=-1).mean()
        for points in (joints, mended.joints)
    )
    assert after < 0.7 * before


def test_a_flipped_orientation_of_parameters_is_missing(noisy):
    pose = noisy.hands[0].pose.clone()
    turn = axis_angle_to_matrix(torch.tensor([math.pi, 0.0, 0.0]))
    over = axis_angle_to_matrix(pose[FROM:UNTIL, 0]) @ turn
    pose[FROM:UNTIL, 0] = matrix_to_axis_angle(over)
    assert missing(with_hand(noisy, pose=pose, joints=None)) == list(range(FROM, UNTIL))


@pytest.mark.parametrize("noise", ["gauss_strong", "beta", "bias", "drift", "burst", "drop"])
@pytest.mark.parametrize("fps", [10.0, 30.0, 120.0])
def test_noise_and_fast_motion_are_no_fault(clean, noise, fps):
    given = corrupt_sequence(at_rate(clean, fps), noise, generator=torch.Generator().manual_seed(1))
    found, said = without_faults(given)
    assert int((given.hands[0].valid & ~found.hands[0].valid).sum()) <= 1
    assert len(said) <= 1


def test_the_recording_is_left_as_it_is(clean):
    assert without_faults(clean) == (clean, ())


def test_a_hand_that_rests_and_goes_on_is_no_fault(clean):
    """It slows down, stands still for a second, and goes on."""
    time = torch.cat([torch.linspace(0, 1, 30).square().flip(0).neg(), torch.zeros(30)])
    joints = clean.hands[0].joints[:1] + 0.3 * time[:, None, None]
    hand = HandTrack("left", torch.ones(60, dtype=torch.bool), joints=joints)
    motion = clean.object[:60]
    given = Sequence((hand,), motion, 30.0)
    assert missing(given) == []


def test_what_is_so_in_most_frames_is_no_fault(noisy):
    keys = turned_about_its_axis(noisy.hands[0])
    keys[FROM:UNTIL] = noisy.hands[0].joints[FROM:UNTIL]
    given = with_hand(noisy, joints=keys, pose=None, wrist=None, betas=None)
    assert missing(given) == list(range(FROM, UNTIL))


def test_what_fills_gaps_repeats_no_frame(noisy):
    valid = torch.arange(noisy.frames) >= 10
    valid[60:66] = False
    assert missing(with_hand(noisy, valid=valid)) == [*range(10), *range(60, 66)]


def test_keypoints_without_confidence_make_no_fault(noisy):
    joints, sure = noisy.hands[0].joints.clone(), torch.ones(noisy.frames, 21)
    joints[::5, PALM] += 0.5
    sure[::5, PALM] = 0.0
    keys = {"joints": joints, "pose": None, "wrist": None, "betas": None}
    assert missing(with_hand(noisy, confidence=sure, **keys)) == []
    assert missing(with_hand(noisy, **keys)) != []


@pytest.mark.parametrize("fps", [24.0, 60.0])
def test_frames_beside_a_cut_of_the_video_are_no_fault(clean, fps):
    given = at_rate(clean, fps)
    joints, cut = given.hands[0].joints.clone(), given.frames // 2
    joints[cut:] += torch.tensor([0.4, -0.3, 0.2])
    alone = replace(given, object=ObjectTrack.resting((), given.frames))
    alone = with_hand(alone, joints=joints, pose=None, wrist=None, betas=None)
    assert missing(alone) == []
    assert shots_of(alone.hands[0], fps) == [slice(0, cut), slice(cut, given.frames)]
    seen = torch.arange(given.frames)
    lost = with_hand(alone, joints=joints, valid=seen != cut - 1)
    assert shots_of(lost.hands[0], fps) == [slice(0, cut), slice(cut, given.frames)]
    joints[cut + 6 :] -= torch.tensor([0.4, -0.3, 0.2])  # a hand that was lost, and no shot
    assert missing(with_hand(alone, joints=joints)) == list(range(cut, cut + 6))
    assert len(shots_of(with_hand(alone, joints=joints).hands[0], fps)) == 1


@pytest.mark.parametrize("noise", ["gauss_strong", "burst", "drop", "camera"])
def test_noise_is_no_cut(clean, noise):
    given = corrupt_sequence(
        at_rate(clean, 60.0), noise, generator=torch.Generator().manual_seed(1)
    )
    assert len(shots_of(given.hands[0], 60.0)) == 1


def test_few_frames_tell_no_fault(noisy):
    assert missing(with_hand(noisy[:4], joints=noisy.hands[0].joints[[0, 40, 80, 120]])) == []


@pytest.mark.parametrize("wrong", [elsewhere, turned_about_its_axis, of_the_other_side])
def test_faulty_frames_do_not_reach_the_result(noisy, clean, wrong, caplog):
    given = keys_of(noisy, wrong(noisy.hands[0]))
    result = denoise(given, preset="fast")
    off = (result.sequence.hands[0].joints - clean.hands[0].joints)[FROM:UNTIL].norm(dim=-1).mean()
    assert off < 0.02
    assert result.hands["left"].filled.nonzero()[:, 0].tolist() == list(range(FROM, UNTIL))
    assert any("taken as missing" in words for words in result.doubts)
    assert "taken as missing" in caplog.text


def test_a_hand_that_shakes_its_object_is_no_fault(clean):
    given = shaken(clean, 6.0, 60.0)[:66]  # in most of its frames nothing shakes
    alone = replace(given, object=ObjectTrack.resting((), given.frames))
    assert missing(alone)  # nothing but the object tells it from a leap
    assert missing(given) == []


def test_faults_are_found_beside_an_object_that_shakes(clean):
    given = shaken(clean, 5.0, 45.0)
    wrong = elsewhere(given.hands[0])
    assert missing(keys_of(given, wrong)) == list(range(FROM, UNTIL))
