"""A video that was cut: no frame is mixed with those of another shot."""

from dataclasses import replace
from math import isnan, nan

import pytest
import torch

from geneoh.bundle import concatenated
from geneoh.metrics.report import InteractionReport, over_shots
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.examination.shots import common_shots, cuts_in, shot_of, told_of
from geneoh.pipeline.results import Denoised
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.shots import paths_of, shots_of

CUT, FRAMES = 45, 90


@pytest.fixture(scope="module")
def video(noisy) -> Sequence:
    """Two shots of the recording, with another place of the camera, at 60 frames a second."""
    (hand,) = noisy.hands
    assert hand.joints is not None
    away = torch.tensor([0.6, 0.2, 0.0])
    first, second = noisy[:CUT], noisy[90 : 90 + FRAMES - CUT]
    joints = torch.cat([first.hands[0].joints, second.hands[0].joints + away])
    moved = replace(second.object, translation=second.object.translation + away)
    keys = HandTrack(hand.side, torch.ones(FRAMES, dtype=torch.bool), joints)
    return Sequence((keys,), concatenated([first.object, moved]), 60.0, "video.npz")


@pytest.fixture(scope="module")
def result(video):
    return denoise(video, preset="fast")


def test_no_frame_is_mixed_across_a_cut(video, result):
    (hand,) = result.sequence.hands
    off = (hand.joints - video.hands[0].joints).norm(dim=-1).mean(-1)
    assert off[CUT - 5 : CUT + 5].max() < 0.06  # 0.3 where the whole video is one track
    assert any(f"before frame {CUT}" in words for words in result.doubts)
    assert result.hands["left"].after.acceleration_mm < 20


@pytest.mark.parametrize(
    ("part", "cut"), [(slice(0, CUT + 1), CUT), (slice(CUT - 3, FRAMES), 3)], ids=["end", "start"]
)
def test_a_leap_of_hand_and_object_beside_an_end_is_a_cut(video, part, cut):
    clip = video[part]
    assert cuts_in(clip) == [cut]
    resting = clip.object[torch.zeros(clip.frames, dtype=torch.long)]
    assert cuts_in(replace(clip, object=resting)) == []


def test_all_shots_are_in_the_result(video, result):
    hand = result.hands["left"]
    shots = [denoise(video[:CUT], preset="fast"), denoise(video[CUT:], preset="fast")]
    each = [shot.hands["left"] for shot in shots]
    assert result.sequence.frames == len(hand.filled) == len(hand.evidence) == FRAMES
    assert len(hand.contact) == len(result.examined.confidence) == FRAMES
    assert hand.samples.shape[1] == sum(shot.samples.shape[1] for shot in each)
    assert hand.windows == sum(shot.windows for shot in each)
    assert hand.after.frames == sum(shot.after.frames for shot in each)
    # each shot has a shape of its own where it is cleaned alone
    alone = torch.cat([shot.sequence.hands[0].joints for shot in shots])
    assert (alone - result.sequence.hands[0].joints).norm(dim=-1).mean() < 0.003


def test_walls_that_a_hand_goes_through_are_told_of_all_shots_at_once(result):
    (words,) = (note for note in result.hands["left"].notes if "through a thin wall" in note)
    share = result.hands["left"].after.through_fraction
    assert words.startswith("the hand goes")
    assert f"in {100 * share:.1f}% of" in words


@pytest.mark.parametrize("slow", [slice(2, CUT - 2), slice(CUT + 2, FRAMES - 2)])
def test_a_shot_alone_may_have_poses_of_a_slower_sensor(video, slow):
    (hand,), motion = video.hands, video.object
    nearest = torch.arange(FRAMES)
    nearest[slow] -= nearest[slow] % 2
    # as fast as for a recording at 30 frames a second
    sliding = torch.arange(FRAMES)[:, None] * torch.tensor([0.01, 0.0, 0.0])
    carried = replace(motion, translation=motion.translation + sliding[:, None])[nearest]
    moved = replace(hand, joints=hand.joints + sliding[:, None])
    given = replace(video, hands=(moved,), object=carried, fps=30.0)
    result = denoise(given, preset="fast", refine_object=True)
    (words,) = (note for note in result.notes if "repeats the one before" in note)
    assert words.startswith(f"frames {0 if slow.start < CUT else CUT} to")
    found = result.sequence.object, result.examined.aligned
    assert [track.valid.shape for track in found] == [(FRAMES, 1)] * 2
    assert bool(found[0].valid.all())


def test_an_object_that_is_lost_at_a_cut_stays_with_the_hand_of_its_shot(video):
    slow = replace(video, fps=30.0)
    places = video.object.translation.clone()
    places[CUT - 6 : CUT + 6] = nan
    lost = replace(slow, object=replace(video.object, translation=places))
    result = denoise(lost, preset="fast")
    for frames in ("frames 0 to 44", "frames 45 to 89"):  # not once, as if it were 6 in all
        assert any(note.startswith(f"{frames}: 6 frames without") for note in result.notes)
    found, known = result.sequence, denoise(slow, preset="fast").sequence
    places, given = found.object.translation, video.object.translation
    for lost, seen in ((slice(CUT - 6, CUT), CUT - 7), (slice(CUT, CUT + 6), CUT + 6)):
        at_rest = (given[lost] - given[seen]).norm(dim=-1).max()
        assert (places[lost] - given[lost]).norm(dim=-1).max() < 0.7 * at_rest
    apart = (found.hands[0].joints - known.hands[0].joints).norm(dim=-1).mean(-1)
    assert apart.max() < 0.02  # 0.05 by poses between the two places


def test_a_part_that_is_not_in_a_shot_keeps_its_poses(video):
    motion = video.object
    two = ObjectTrack(
        motion.meshes * 2,
        *(x.repeat_interleave(2, 1) for x in (motion.rotation, motion.translation)),
    )
    two.translation[CUT:, 1] = nan
    filled = replace(video, object=fill_object(two))
    part = shot_of(filled, slice(CUT, FRAMES)).object
    assert part.translation.equal(filled.object.translation[CUT:])
    assert part.seen_parts == [0]


def test_a_shot_whose_hand_has_another_size_is_told_as_one_of_a_video(video):
    (hand,), later = video.hands, torch.arange(FRAMES) >= CUT
    larger = hand.joints[:, :1] + 1.2 * (hand.joints - hand.joints[:, :1])
    joints = torch.where(later[:, None, None], larger, hand.joints)
    found = denoise(replace(video, hands=(replace(hand, joints=joints),)), preset="fast")
    (words,) = (note for note in found.hands["left"].notes if "those of a hand" in note)
    assert words.startswith(f"frames {CUT} to {FRAMES - 1}: the given joints are those of a hand")
    assert "in a video with cuts, than that of all shots" in words  # no betas were given


def test_the_form_of_the_paper_keeps_one_shape_and_tells_of_cuts(video, monkeypatch):
    def as_given(sequence, options, _, **others):
        return Denoised(sequence, {}, (), options)

    monkeypatch.setattr("geneoh.pipeline.denoise.clean_interaction", as_given)
    result = denoise(video, preset="paper")
    assert result.sequence == video
    assert any("clean each shot by itself" in words for words in result.doubts)


def test_a_hand_is_in_every_shot_and_other_cuts_are_told(video):
    shots = [slice(0, CUT), slice(CUT, FRAMES)]
    assert common_shots(video) == shots
    (hand,) = video.hands
    late = torch.arange(FRAMES) >= CUT
    other = replace(video, hands=(hand, replace(hand.mirrored(), valid=late)))
    lost = replace(video, object=replace(video.object, valid=late[:, None]))
    for given in (other, lost):
        assert common_shots(given) == [slice(0, FRAMES)]
        (words,) = told_of(given, common_shots(given))
        assert f"before frame {CUT}, as at a cut of the video: frames beside it may be" in words
    # lost behind the cut it comes back as if it were cut later
    found = (torch.arange(FRAMES) < CUT) | (torch.arange(FRAMES) >= CUT + 2)
    other = replace(video, hands=(hand, replace(hand.mirrored(), valid=found)))
    assert common_shots(other) == shots
    (words,) = told_of(other, shots)
    assert words.endswith("each shot is cleaned by itself")


def test_reports_of_shots_are_means_over_their_frames():
    one = InteractionReport(30, 1.0, 4.0, 0.5, 2.0, 3.0, nan, 0.0)
    other = InteractionReport(10, 5.0, nan, 0.0, nan, 7.0, nan, 1.0)
    whole = over_shots([one, other])
    assert (whole.frames, whole.penetration_mean_mm, whole.penetration_max_mm) == (40, 2.0, 4.0)
    assert (whole.contact_fraction, whole.fingers_in_contact) == (0.375, 2.0)
    assert (whole.acceleration_mm, whole.through_fraction) == (4.0, 0.25)
    assert isnan(whole.consistency_mm2)


def beside(video: Sequence, path: torch.Tensor) -> Sequence:
    """The video without its object, and with a right hand that has one pose and a path (T, 3)."""
    (left,) = video.hands
    joints = left.mirrored().joints[:1] + path[:, None]
    right = HandTrack("right", left.valid, joints=joints)
    return replace(video, hands=(left, right), object=ObjectTrack.resting((), FRAMES))


def test_a_leap_is_no_cut_where_the_other_hand_or_the_object_goes_on(video):
    straight = torch.linspace(0, 0.5, FRAMES)[:, None] * torch.tensor([1.0, 0.0, 0.0])
    assert cuts_in(beside(video, straight)) == []
    assert cuts_in(beside(video, 0.0 * straight)) == [CUT]  # it rests
    shaken = 0.004 * torch.randn(FRAMES, 3, generator=torch.Generator().manual_seed(0))
    assert cuts_in(beside(video, shaken)) == [CUT]
    assert cuts_in(beside(video, straight + shaken)) == []
    leaps = straight + 0.1 * (torch.arange(FRAMES)[:, None] >= CUT)
    assert cuts_in(beside(video, leaps)) == [CUT]
    upright = torch.eye(3).expand(FRAMES, 3, 3)
    carried = ObjectTrack(video.object.meshes, upright, straight)
    assert cuts_in(replace(video, object=carried)) == []
    seen = (torch.arange(FRAMES) < CUT - 2)[:, None]
    assert cuts_in(replace(video, object=replace(carried, valid=seen))) == [CUT]


def test_where_the_hand_is_lost_a_cut_is_where_its_object_leaps(video):
    (hand,), motion = video.hands, video.object
    for lost in (slice(CUT, CUT + 2), slice(CUT - 1, CUT + 1)):
        seen = torch.ones(FRAMES, dtype=torch.bool)
        seen[lost] = False
        given = replace(video, hands=(replace(hand, valid=seen),))
        assert cuts_in(given) == [CUT]
        both = replace(motion, valid=seen[:, None])
        assert cuts_in(replace(given, object=both)) == [lost.stop]


def test_a_hand_that_leaps_while_its_object_goes_on_is_no_shot_of_the_fault_detection(video):
    path = torch.linspace(0, 0.5, FRAMES)[:, None] * torch.tensor([1.0, 0.0, 0.0])
    given = beside(video, path)
    (left, right), motion = given.hands, given.object
    assert len(shots_of(left, given.fps)) == 2
    assert len(shots_of(left, given.fps, paths_of((right,), motion))) == 1
