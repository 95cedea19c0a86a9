"""Frames in which the track of one hand follows the other hand."""

from dataclasses import replace

import pytest
import torch

from geneoh.geometry.rotations import axes_along
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.examination.following import without_following
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

FROM, UNTIL = 60, 78
"""Frames in which the tracker finds the right hand twice."""


def following(pair: Sequence, start: int, stop: int) -> Sequence:
    """The pair with a left hand that is where the right one is in some frames."""
    left, right = pair.hands
    joints = left.joints.clone()
    joints[start:stop] = right.joints[start:stop]
    return replace(pair, hands=(replace(left, joints=joints), right))


def missing(sequence: Sequence) -> list[int]:
    """Frames of the left hand that count as missing; the right hand is whole."""
    left, right = without_following(sequence)[0].hands
    assert bool(right.valid.all())
    return (~left.valid).nonzero()[:, 0].tolist()


@pytest.mark.parametrize(("start", "stop"), [(50, 51), (FROM, UNTIL), (0, 20), (100, 146)])
def test_a_hand_that_leaps_to_the_other_one_is_missing(pair, start, stop):
    given = following(pair, start, stop)
    assert missing(given) == list(range(start, stop))
    (said,) = without_following(given)[1]
    count = "1 frame" if stop == start + 1 else f"{stop - start} frames"
    assert said.startswith(f"the left hand follows the other hand in {count}, as where a tracker")
    assert said.endswith("taken as missing")


def test_it_is_found_under_noise_of_both_hands(pair):
    left, right = corrupt_sequence(pair, "beta", generator=torch.Generator().manual_seed(2)).hands
    noise = left.joints - pair.hands[0].joints
    given = following(pair, FROM, UNTIL)
    joints = given.hands[0].joints + noise
    noisy = replace(given, hands=(replace(given.hands[0], joints=joints), right))
    assert missing(noisy) == list(range(FROM, UNTIL))


def test_the_order_of_the_hands_does_not_matter(pair):
    given = following(pair, FROM, UNTIL)
    right, left = without_following(replace(given, hands=given.hands[::-1]))[0].hands
    assert bool(right.valid.all())
    assert (~left.valid).nonzero()[:, 0].tolist() == list(range(FROM, UNTIL))


def test_a_hand_that_is_lost_beside_the_leap_is_missing(pair):
    given = following(pair, FROM, UNTIL)
    left, right = given.hands
    lost = replace(left, valid=torch.arange(146) != FROM - 1)
    assert missing(replace(given, hands=(lost, right))) == list(range(FROM - 1, UNTIL))


def test_one_hand_under_two_names_is_left_as_it_is(pair):
    given = following(pair, 20, 146)
    assert without_following(given) == (given, ())


@pytest.mark.parametrize("noise", [None, "gauss_strong", "burst", "camera", "drop"])
def test_two_hands_that_keep_apart_stay_as_they_are(pair, noise):
    given = pair
    if noise is not None:
        given = corrupt_sequence(pair, noise, generator=torch.Generator().manual_seed(0))
    assert without_following(given) == (given, ())


def test_palms_that_slap_from_one_frame_to_the_next_stay_as_they_are(clean):
    """A right hand that mirrors the left one, and is 28 mm from it while they touch."""
    left = clean.hands[0].joints[:1].expand(60, 21, 3)
    normal = axes_along(left[:, 9] - left[:, 0], left[:, 5] - left[:, 17])[:, None, :, 2]
    heights = ((left - left[:, :1]) * normal).sum(-1, keepdim=True)
    inward = torch.sign(heights.mean())
    apart = torch.where(torch.arange(60) % 20 < 10, 0.028, 0.2)[:, None, None]
    right = left + (inward * apart - 2 * heights) * normal
    valid = torch.ones(60, dtype=torch.bool)
    hands = (HandTrack("left", valid, joints=left), HandTrack("right", valid, joints=right))
    given = Sequence(hands, ObjectTrack.resting((), 60), 30.0)
    assert without_following(given) == (given, ())


def test_a_result_does_not_follow_the_other_hand(pair):
    alone = replace(pair, object=ObjectTrack.resting((), pair.frames))
    result = denoise(following(alone, FROM, UNTIL), preset="fast")
    assert not any("cut" in words for words in result.doubts)
    left, true = result.sequence.hands[0].joints, pair.hands[0].joints
    assert (left - true)[FROM:UNTIL].norm(dim=-1).mean() < 0.05  # the other hand is 0.25 away
    assert result.hands["left"].filled.nonzero()[:, 0].tolist() == list(range(FROM, UNTIL))
