from collections import Counter
from dataclasses import replace

import bodies
import pytest
import torch

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import Skeleton
from geneoh.errors import InputError
from geneoh.generators.both2hands.recorded import recorded_gestures, windows_of
from geneoh.readers.bodies.data_sets import SourceBody

LONG = bodies.swaying(180)


def clips(source, path, **how):
    """All clips, of which those to learn from come first."""
    split = recorded_gestures(source, path, **how)
    return split.training, split.validation, split.notes


def test_windows_hold_the_motion_on_the_ground_from_the_origin_on(tmp_path):
    low = BodyMotion(LONG.root - torch.tensor([0.0, 0.95, 4.0]), LONG.rotations)
    bodies.both57m(tmp_path / "a.p", low, low)
    training, validation, (note,) = clips("both57m", tmp_path)
    assert training.length.tolist() == validation.length.tolist() == [150, 150]
    assert note.startswith("both57m: 4 clips; 2 clips, of 1 recording or person, held out")
    torch.testing.assert_close(training.root[:, 0, ::2], torch.zeros(2, 2), atol=1e-6, rtol=0)
    facing = training.motion.rotations[:, 0, 0, :, 2]
    assert facing[:, 0].abs().max() < 1e-5
    assert facing[:, 2].min() > 0.5
    lowest = pose(training.skeleton, training.motion).positions[..., 1].amin()
    assert lowest == pytest.approx(0.02, abs=1e-4)
    fingers = training.motion.rotations[:, :, 22:]
    torch.testing.assert_close(fingers[0], LONG.rotations[:150, 22:], atol=1e-4, rtol=0)
    torch.testing.assert_close(fingers[1], LONG.rotations[30:, 22:], atol=1e-4, rtol=0)


def test_no_gesture_of_a_recording_is_known_and_its_sentences_are_told(tmp_path):
    bodies.both57m(tmp_path / "a.p", LONG, LONG)
    training, *_ = clips("both57m", tmp_path)
    assert (training.gesture == -1).all()
    said = ["the right hand waves", "fingers spread", "all fingers are straight"]
    assert training.joined.tolist() == [said, said]


def test_a_short_recording_ends_before_its_window(tmp_path):
    bodies.both57m(tmp_path / "a.p", bodies.swaying(40), LONG)
    training, validation, _ = clips("both57m", tmp_path)
    short = training if len(training.length) == 1 else validation
    assert short.length.tolist() == [40]
    assert short.pose.shape == (1, 150, 52, 3)
    assert torch.equal(short.pose[:, 39:40].expand(1, 111, 52, 3), short.pose[:, 39:])


def test_the_words_on_hands_are_those_of_the_window_s_frames():
    body = replace(bodies.recording(180), has_fingers=True)
    said = {n: f"bent {n} times" for n in range(180) if n != 104}
    each = SourceBody(body, "a", said)
    first, second = windows_of(each, True, Counter())
    assert first.sentences == ("bent 0 times", "bent 74 times", "bent 149 times")
    assert second.sentences == ("bent 30 times", "bent 179 times")


def test_other_frame_rates_are_learned_at_thirty(tmp_path):
    (tmp_path / "s1").mkdir()
    bodies.amass(tmp_path / "s1" / "walk_poses.npz", LONG, 60.0)
    training, validation, (note,) = clips("amass", tmp_path, with_text=False)
    assert training.length.tolist() == validation.length.tolist() == [90 + 1]
    assert "validated on the training data: there is no other recording" in note
    assert training.joined.tolist() == [[""]]


def test_clips_of_one_recording_are_never_on_both_sides(tmp_path):
    names = [f"idea400__subset_0001__wave{n}_clip_{m}" for n in range(4) for m in (1, 2)]
    tree = bodies.motion_x_tree(tmp_path, **dict.fromkeys(names, bodies.swaying(31)))
    training, validation, _ = clips("motionx", tree)
    words = [{row[0].split("_clip")[0] for row in each.joined} for each in (training, validation)]
    assert words[0].isdisjoint(words[1])
    assert [len(each.length) for each in (training, validation)] == [6, 2]


def test_the_same_recordings_are_held_out_where_texts_are_missing(tmp_path):
    names = [f"idea400__subset_0001__wave{n}_clip_1" for n in range(24)]
    motions = {name: bodies.swaying(31, seed=n) for n, name in enumerate(names)}
    tree = bodies.motion_x_tree(tmp_path, **motions)
    every = recorded_gestures("motionx", tree, with_text=False)
    (held, *_), (learned, *_) = (each.joined[:, 0] for each in (every.validation, every.training))
    for said in (held, learned):  # "A person does SET/SUBSET/CLIP."
        clip = said.rstrip(".").split("/")[-1]
        for file in (tree / "texts").rglob(f"{clip}.*"):
            file.unlink()
    some = recorded_gestures("motionx", tree)
    for whole, part in ((every.training, some.training), (every.validation, some.validation)):
        assert len(part.length) == len(whole.length) - 1
        apart = (whole.pose[None] - part.pose[:, None]).abs().flatten(2).amax(-1)
        assert (apart.amin(1) == 0).all()


def flat(frames):
    """A body whose fingers never move."""
    return bodies.swaying(frames, joints=22)


@pytest.mark.parametrize(
    ("source", "motion", "told", "said"),
    [
        ("both57m", flat(40), True, "fingers and sentences on them, got none .1 whose fingers"),
        ("both57m", bodies.swaying(20), False, "1 of fewer than 30 frames"),
        ("amass", LONG, True, "got none .1 without sentences"),
    ],
)
def test_a_data_set_without_a_clip_to_learn_from_is_refused(tmp_path, source, motion, told, said):
    make = {"both57m": bodies.both57m, "amass": bodies.amass}[source]
    make(tmp_path / {"both57m": "a.p", "amass": "a_poses.npz"}[source], motion)
    with pytest.raises(InputError, match=said):
        recorded_gestures(source, tmp_path, with_text=told)


def test_a_file_that_cannot_be_read_is_told_and_left_out(tmp_path):
    bodies.both57m(tmp_path / "a.p", LONG, LONG)
    (tmp_path / "b.p").write_bytes(b"\x80\x04broken")
    *_, (_, problem) = clips("both57m", tmp_path)
    assert problem.startswith("not read, ")
    assert "b.p" in problem
    (tmp_path / "a.p").unlink()
    with pytest.raises(InputError, match=r"^\S+b\.p"):
        recorded_gestures("both57m", tmp_path)


def test_bones_are_those_of_the_recording():
    body = bodies.recording(40)
    taller = Skeleton(1.1 * body.skeleton.offsets)
    each = SourceBody(replace(body, skeleton=taller, has_fingers=True), "a")
    (window,) = windows_of(each, False, Counter())
    torch.testing.assert_close(window.clip.offsets[0], taller.offsets)
