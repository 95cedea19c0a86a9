"""Keypoints that a tracker never finds, such as fingertips."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

import geneoh
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.pipeline.inputs import checked_interaction, left_out
from geneoh.pipeline.results import Denoised
from geneoh.readers.checks.delay import hand_delay
from geneoh.sequence.resample import with_hands_earlier
from geneoh.sequence.sequence import HandTrack, Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"
UNSEEN = {
    "fingertips": sorted(TIP_KEYPOINTS),
    "thumb": [1, 2, 3, 4],
    "little finger": [17, 18, 19, 20],
    "middle joints": [2, 3, 6, 7, 10, 11, 14, 15, 18, 19],
}


@pytest.fixture(scope="module")
def short(clean) -> Sequence:
    return clean[60:90]


def without(sequence: Sequence, points: list[int], place: float) -> Sequence:
    """Keypoints alone, of which some have no confidence and are all at one place."""
    (hand,) = sequence.hands
    joints, confidence = hand.joints.clone(), torch.ones(sequence.frames, 21)
    joints[:, points], confidence[:, points] = place, 0.0
    bare = HandTrack(hand.side, hand.valid, joints=joints, confidence=confidence)
    return replace(sequence, hands=(bare,))


@pytest.mark.parametrize("place", [0.0, 0.5])
@pytest.mark.parametrize("points", UNSEEN.values(), ids=list(UNSEEN))
def test_keypoints_that_no_frame_has_are_estimated_from_the_others(short, points, place):
    result = geneoh.denoise(without(short, points, place), preset="fast")
    apart = (result.sequence.hands[0].joints - short.hands[0].joints).norm(dim=-1).mean(0)
    seen = [point for point in range(21) if point not in points]
    assert float(apart[seen].mean()) < 0.006
    assert float(apart[points].mean()) < 0.04
    note = f"{len(points)} keypoints that no frame has ({', '.join(map(str, points))})"
    assert any(said.startswith(note) for said in result.hands["left"].notes)


@pytest.mark.parametrize("points", UNSEEN.values(), ids=list(UNSEEN))
def test_a_pose_places_keypoints_that_no_frame_has(short, points):
    (bare,) = without(short, points, 0.0).hands
    hand = replace(short.hands[0], joints=bare.joints, confidence=bare.confidence)
    result = geneoh.denoise(replace(short, hands=(hand,)), preset="fast")
    apart = (result.sequence.hands[0].joints - short.hands[0].joints).norm(dim=-1).mean(0)
    assert float(apart.max()) < 0.012


@pytest.fixture(scope="module")
def unsure(short) -> tuple[Sequence, Denoised]:
    """Keypoints most of which have no confidence, and what is made of them."""
    drawn = torch.rand(short.frames, 21, generator=torch.Generator().manual_seed(0))
    confidence, hand = (drawn > 0.7).float(), short.hands[0]
    track = HandTrack(hand.side, hand.valid, joints=hand.joints, confidence=confidence)
    given = replace(short, hands=(track,))
    return given, geneoh.denoise(given, preset="fast")


@pytest.mark.parametrize("place", [0.0, 0.3, torch.nan])
def test_values_without_confidence_do_not_count(unsure, place):
    given, one = unsure
    (hand,) = given.hands
    joints = hand.joints.masked_fill(hand.confidence[..., None] == 0, place)
    spoilt = replace(given, hands=(replace(hand, joints=joints),))
    other = geneoh.denoise(spoilt, preset="fast")
    assert torch.equal(one.sequence.hands[0].joints, other.sequence.hands[0].joints)
    assert one.doubts == other.doubts


def test_frames_without_any_confidence_do_not_count_for_a_delay(clean):
    late = with_hands_earlier(clean, -4)
    (hand,), lost = late.hands, torch.arange(clean.frames) % 30 < 5
    spoilt = hand.joints + 0.3 * lost[:, None, None] * torch.randn(
        clean.frames, 1, 3, generator=torch.Generator().manual_seed(0)
    )
    confidence = torch.ones(clean.frames, 21) * ~lost[:, None]
    told = replace(hand, joints=spoilt, pose=None, wrist=None, confidence=confidence)
    found = checked_interaction(replace(late, hands=(told,)))
    assert hand_delay(found.hands[0], found.object, found.fps) == 4


def test_zeros_are_told_unless_they_have_no_confidence(short):
    hand, lost = short.hands[0], torch.arange(short.frames) < 6
    zeros = hand.joints.masked_fill(lost[:, None, None], 0.0)
    sure = torch.ones(short.frames, 21)
    for confidence, told in ((sure, True), (sure * ~lost[:, None], False)):
        given = HandTrack(hand.side, hand.valid, joints=zeros, confidence=confidence)
        words = list(left_out(replace(short, hands=(given,))))
        assert any(said.startswith("6 frames in which all keypoints") for said in words) == told


def test_a_hand_with_all_keypoints_or_a_pose_has_no_such_note(short):
    pose = replace(short.hands[0], confidence=torch.ones(short.frames, 21))
    pose.confidence[:, 4] = 0.0
    for sequence in (without(short, [], 0.0), replace(short, hands=(pose,))):
        result = geneoh.denoise(sequence, preset="fast")
        assert not any("no frame has" in said for said in result.hands["left"].notes)


def test_so_are_those_of_a_stream(short):
    sequence = without(short, UNSEEN["fingertips"], torch.nan)
    hand, motion = sequence.hands[0], sequence.object
    stream = geneoh.Stream(EXAMPLES / "taco_object.obj", 30, 0.1, side="left", samples=1)
    for frame in range(short.frames):
        stream.push(hand.joints[frame], (motion.rotation[frame], motion.translation[frame]))
    last = stream.flush()
    found = torch.cat([clean.hand.joints for clean in last])
    assert float((found - short.hands[0].joints[-len(last) :]).norm(dim=-1).mean()) < 0.02
