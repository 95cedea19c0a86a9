"""An object whose poses shake or flip must not shake the hand."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

import geneoh
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack, Sequence
from tools.noisy_objects.clips import clip_of, with_gap, with_noisy_hand

FAST = geneoh.Options(preset="fast")


def with_turned_object(sequence: Sequence, turn: np.ndarray, shift: np.ndarray) -> Sequence:
    """The sequence whose object is turned in its own frame, radians, and shifted, metres."""
    motion = sequence.object
    turned = motion.rotation[:, 0].double() @ torch.from_numpy(
        Rotation.from_rotvec(turn).as_matrix()
    )
    shifted = motion.translation + torch.from_numpy(shift).float()[:, None]
    return replace(
        sequence, object=replace(motion, rotation=turned.float()[:, None], translation=shifted)
    )


@pytest.fixture(scope="module")
def shaking(clean) -> Sequence:
    """The recording with an object that shakes by 4 degrees and 8 mm per axis, and flips."""
    generator = np.random.default_rng(0)
    turn = np.radians(4) * generator.standard_normal((clean.frames, 3))
    turn[60:66] = [0.0, 2.8, 0.0]
    return with_turned_object(clean, turn, 0.008 * generator.standard_normal((clean.frames, 3)))


@pytest.fixture(scope="module")
def cleaned(shaking):
    return geneoh.denoise(shaking, FAST)


def error_and_acceleration(result: geneoh.Denoised, truth: Sequence) -> tuple[float, float]:
    """Mean keypoint error in mm, and mean acceleration in mm per frame squared."""
    joints = result.sequence.hands[0].joints
    bends = joints[2:] - 2 * joints[1:-1] + joints[:-2]
    off = joints - truth.hands[0].joints
    return tuple(1000 * float(values.norm(dim=-1).mean()) for values in (off, bends))


def test_a_hand_with_a_ray_relies_more_on_a_noisy_object(cleaned, shaking):
    (hand,) = shaking.hands
    ray = torch.nn.functional.normalize(hand.joints.mean(1), dim=-1)
    seen = geneoh.denoise(replace(shaking, hands=(replace(hand, camera_ray=ray),)), FAST)
    by_ray, without = (float(x.hands[hand.side].evidence.median()) for x in (seen, cleaned))
    assert by_ray > 1.5 * without


def test_the_hand_does_not_inherit_the_noise_of_the_object(cleaned, shaking, clean):
    error, acceleration = error_and_acceleration(cleaned, clean)
    trusting = geneoh.denoise(shaking, replace(FAST, without=("object",)))
    worse, rougher = error_and_acceleration(trusting, clean)
    assert error < 5 < worse
    assert acceleration < 8.3 < rougher


def test_measures_against_other_poses_than_those_of_the_file_are_told(cleaned, clean, shaking):
    def told(result):
        return any("measures are against the cleaned poses" in note for note in result.notes)

    assert told(cleaned)
    assert cleaned.sequence.object.rotation.equal(shaking.object.rotation)
    assert not told(geneoh.denoise(clean[:40], FAST))
    assert not told(geneoh.denoise(shaking[:40], replace(FAST, refine_object=True)))


def test_the_noise_of_the_object_is_told(cleaned, shaking):
    found = cleaned.examined
    assert found.is_noisy.all()
    assert np.degrees(float(found.rotation_noise.max())) == pytest.approx(4, rel=0.25)
    assert found.left_out[60:66].all()
    assert "shakes by" in cleaned.notes[0]
    trusting = geneoh.denoise(shaking[:20], replace(FAST, trust_object=True))
    assert trusting.examined is None
    assert not any("shakes" in note for note in trusting.notes)


def test_the_time_of_a_stage_that_runs_twice_is_the_sum(shaking, monkeypatch):
    ticks, heard = itertools.count(), []
    clock = SimpleNamespace(monotonic=lambda: next(ticks))
    monkeypatch.setattr("geneoh.progress.time", clock)
    result = geneoh.denoise(
        shaking[:20], FAST, on_progress=lambda stage, done, total: heard.append((stage, done))
    )
    (hand,) = result.hands.values()
    assert heard.count(("motion", 1)) == 2
    assert hand.seconds["motion"] == sum(stage == "motion" for stage, _ in heard)


def test_the_object_of_the_input_is_kept_unless_a_cleaned_one_is_asked_for(cleaned, shaking):
    assert cleaned.sequence.object is shaking.object
    solved = geneoh.denoise(shaking[:40], replace(FAST, refine_object=True))
    asked = [any("with --refine-object" in note for note in r.notes) for r in (cleaned, solved)]
    assert asked == [True, False]
    refined, given = solved.sequence.object, shaking[:40].object
    steps = [track.translation.diff(n=2, dim=0).norm(dim=-1).mean() for track in (refined, given)]
    assert steps[0] < 0.3 * steps[1]


def test_frames_without_a_pose_are_filled_and_told(clean):
    lost = torch.zeros(clean.frames, 1, dtype=torch.bool)
    lost[50:58] = lost[80:84] = True
    track = fill_object(clean.object, ~lost)
    result = geneoh.denoise(replace(clean, object=track), FAST)
    assert result.notes[0].startswith("12 frames without a pose of the object")
    assert result.examined.confidence[50:58].max() == 0
    assert error_and_acceleration(result, clean)[0] < 4
    exact = ~lost[:, 0]
    assert torch.equal(result.sequence.object.rotation[exact], clean.object.rotation[exact])


def test_an_object_that_is_lost_while_it_is_moved_hardly_matters_marked_or_not():
    clip, name = clip_of("ycb_035_power_drill.ply"), "on straight lines"
    noisy = with_noisy_hand(clip, "gauss", 0)
    lost, lined = with_gap(noisy, "lost 10"), with_gap(noisy, "on a line 10")
    whole, one, other = (geneoh.denoise(each, FAST) for each in (noisy, lost, lined))
    assert error_and_acceleration(one, clip)[0] < 1.4 * error_and_acceleration(whole, clip)[0]
    assert other.sequence.hands[0].joints.equal(one.sequence.hands[0].joints)
    assert [any(name in note for note in each.notes) for each in (one, other)] == [False, True]
    written = one.sequence.object.translation - clip.object.translation
    given = lost.object.translation - clip.object.translation
    assert written.norm(dim=-1).max() < 0.3 * given.norm(dim=-1).max()


def test_filled_poses_are_read_as_they_were_written_and_are_not_observed(clean, tmp_path):
    clip = clean[60:120]
    seen = torch.ones(60, 1, dtype=torch.bool)
    seen[30:42] = False
    unseen = replace(clip, object=fill_object(clip.object, seen))
    result = geneoh.denoise(unseen, FAST)
    geneoh.save(result, tmp_path / "filled.npz")
    read = geneoh.load(tmp_path / "filled.npz").object
    assert not read.translation.equal(unseen.object.translation)
    assert read.translation.equal(result.sequence.object.translation)
    assert read.rotation.equal(result.sequence.object.rotation)
    assert read.valid.equal(seen)


def test_refined_poses_of_frames_without_one_are_read_as_they_were_written(clean, tmp_path):
    short = clean[60:120]
    lost = torch.zeros(60, 1, dtype=torch.bool)
    lost[30:42] = True
    unseen = replace(short, object=fill_object(short.object, ~lost))
    result = geneoh.denoise(unseen, replace(FAST, refine_object=True))
    assert not torch.equal(result.sequence.object.translation, unseen.object.translation)
    geneoh.save(result, tmp_path / "refined.npz")
    read = geneoh.load(tmp_path / "refined.npz")
    for name in ("rotation", "translation"):
        assert torch.equal(*(getattr(s.object, name) for s in (read, result.sequence)))


def test_exact_poses_are_told_to_be_left_as_they_are(clean):
    result = geneoh.denoise(clean[60:100], replace(FAST, refine_object=True))
    assert torch.equal(result.sequence.object.translation, clean.object.translation[60:100])
    assert any("left as they are (--refine-object)" in note for note in result.notes)


def test_an_object_that_is_never_seen_is_as_none(clean):
    short = clean[20:50]
    unseen = fill_object(short.object, torch.zeros(30, 1, dtype=torch.bool))
    options = replace(FAST, refine_object=True, hand_delay=2)
    result = geneoh.denoise(replace(short, object=unseen), options)
    assert result.sequence.object is unseen
    alone = geneoh.denoise(replace(short, object=ObjectTrack.resting((), 30)), FAST)
    assert torch.equal(result.sequence.hands[0].joints, alone.sequence.hands[0].joints)
    assert "no pose" in result.notes[0]
    assert [note.partition(" had no effect")[0] for note in result.notes[1:3]] == [
        "--refine-object",
        "--hand-delay",
    ]


def test_a_hand_that_stays_away_from_its_object_is_cleaned_as_alone(clean):
    short = clean[20:50]
    hand = short.hands[0]
    shift = torch.tensor([0.0, 0.0, 0.4])
    away = replace(hand, joints=hand.joints + shift, wrist=hand.wrist + shift)
    result = geneoh.denoise(replace(short, hands=(away,)), FAST)
    assert result.hands["left"].evidence.max() == 0
    assert "prior of hand motion" in result.hands["left"].notes[-1]
    assert (result.sequence.hands[0].joints - away.joints).norm(dim=-1).mean() < 0.002


def test_a_useless_track_of_the_object_does_no_harm(clean):
    generator = np.random.default_rng(1)
    turn = generator.standard_normal((clean.frames, 3)) * 1.5
    wild = with_turned_object(clean, turn, 0.05 * generator.standard_normal((clean.frames, 3)))
    error, acceleration = error_and_acceleration(geneoh.denoise(wild, FAST), clean)
    assert error < 3
    assert acceleration < 9


def test_confidence_is_kept_in_the_file(cleaned, tmp_path):
    geneoh.save(cleaned, tmp_path / "clean.npz")
    with np.load(tmp_path / "clean.npz") as arrays:
        assert arrays["object_confidence"].shape == (cleaned.sequence.frames, 1)
        assert arrays["object_confidence"][60:66].max() == 0


def test_an_exact_object_changes_nothing(clean):
    short = clean[20:60]
    seen = geneoh.denoise(short, FAST)
    trusted = geneoh.denoise(short, replace(FAST, trust_object=True))
    assert torch.equal(seen.sequence.hands[0].joints, trusted.sequence.hands[0].joints)


def test_a_trusted_object_says_nothing_in_frames_without_its_pose(clean):
    seen = (torch.arange(60) >= 30)[:, None]
    late = replace(clean[:60], object=replace(clean[:60].object, valid=seen))
    (hand,) = geneoh.denoise(late, replace(FAST, trust_object=True)).hands.values()
    assert float(hand.evidence[:15].max()) < 0.05
    assert float((hand.contact[:15] - 0.5).abs().max()) < 0.05
    assert float(hand.evidence[45:].min()) > 0.95


def test_a_note_counts_the_frames_of_the_track_and_not_those_of_the_networks(clean):
    motion = clean.object
    away = replace(motion, translation=motion.translation + torch.tensor([0.4, 0.0, 0.0]))
    quick = replace(clean, object=away, fps=90.0)[:30]
    (note,) = geneoh.denoise(quick, FAST).hands["left"].notes
    assert note.startswith("in 30 frames the object is")
