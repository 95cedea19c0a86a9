"""The first frames of a stream get the checks of files: once, at their end, and change nothing."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.pipeline.observed import Observed
from geneoh.pipeline.streaming.first_look import FirstLook
from geneoh.pipeline.streaming.frame_reader import FrameReader
from geneoh.readers.joint_orders import ORDERS
from geneoh.sequence.resample import with_hands_earlier
from geneoh.sequence.sequence import HandTrack


@pytest.fixture
def seen(noisy):
    """What a look says of the recording's first frames, changed, and of which frame it says so."""

    def look(change=lambda joints, turn, place: (joints, turn, place), *, side="left", frames=90):
        reader = FrameReader(side, noisy.object.meshes, None, None)
        first, motion = FirstLook(noisy.object.meshes, 30.0), noisy.object
        for frame in range(frames):
            joints = noisy.hands[0].joints[frame]
            joints, *pose = change(joints, motion.rotation[frame], motion.translation[frame])
            given = reader.observed(joints, tuple(pose) or None, "")
            if said := first.push(given, f"frame {frame}"):
                return frame, said
        return frames, first.end("the end")

    return look


def test_a_sound_stream_is_told_nothing(seen):
    assert seen() == (90, ())
    assert seen(frames=20) == (20, ())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda j, r, t: (j, r.mT, t), "with the object's rotation transposed"),
        (lambda j, r, t: (j, r.mT, -(r.mT @ t[..., None])[..., 0]), "the object's poses inverted"),
        (lambda j, r, t: (j, r, t + 0.5), r"from the object.*; check the object's poses and the"),
        (lambda j, r, t: (j,), "no pose of the object in the first 60 frames: the left hand"),
    ],
)
def test_what_a_file_is_warned_of_a_stream_is_told_after_two_seconds(seen, change, words):
    frame, said = seen(change)
    assert frame == 59
    assert any(re.search(words, each) for each in said), said
    assert "--" not in "".join(said)


def test_the_other_side_is_told(seen):
    assert any(
        "handedness: thumb and fingers curl away" in words for words in seen(side="right")[1]
    )


@pytest.mark.parametrize("unsure", [0.0, 0.3], ids=["all", "some"])
def test_a_late_hand_is_told_without_an_option_that_no_stream_has(clean, unsure):
    mended = "than the object that it holds; give it the object's poses of its own time"
    late = with_hands_earlier(clean, -5)
    draws = torch.Generator().manual_seed(0)
    sure = torch.rand(late.frames, 21, generator=draws) >= unsure
    elsewhere = torch.where(sure[..., None], late.hands[0].joints, 0.3)
    hand = HandTrack("left", late.hands[0].valid, elsewhere, confidence=sure.float())
    late = replace(late, hands=(hand,))
    reader = FrameReader("left", clean.object.meshes, None, None)
    first, motion, said = FirstLook(clean.object.meshes, 30.0), late.object, ()
    for frame in range(clean.frames):
        pose = reader.object((motion.rotation[frame], motion.translation[frame]), "")
        said += first.push(Observed(late.hands[0][frame : frame + 1], pose), "")
    assert any(words.endswith(mended) for words in said), said


def test_an_order_of_the_keypoints_is_refused_after_ten_frames(seen):
    mano = torch.tensor(np.argsort(ORDERS["mano"].entries))
    words = "^frame 9: the keypoints of the left hand .* order mano has; give them in OpenPose"
    with pytest.raises(InputError, match=words):
        seen(lambda joints, turn, place: (joints[mano], turn, place))


def test_poses_in_millimetres_are_refused_at_the_end_of_the_look(seen):
    words = r"the left hand must come near the object, .* times 0\.001 .* in the unit of the hand$"
    for frames, where in ((90, "frame 59"), (5, "the end")):
        with pytest.raises(InputError, match=f"^{where}: {words}"):
            seen(lambda j, r, t: (j, r, 1000 * t), frames=frames)


def test_frames_before_the_hand_is_seen_do_not_count(seen):
    count = iter(range(90))

    def hidden(joints, turn, place):
        return (joints if next(count) >= 25 else joints * torch.nan, turn.mT, place)

    assert seen(hidden)[0] == 25 + 59


def test_poses_of_a_slower_sensor_are_told(clean):
    reader = FrameReader("left", clean.object.meshes, None, None)
    first, motion = FirstLook(clean.object.meshes, 30.0), clean.object
    for frame in range(40, 100):
        seen = frame // 2 * 2
        pose = reader.object((motion.rotation[seen], motion.translation[seen]), "")
        said = first.push(Observed(clean.hands[0][frame : frame + 1], pose), "")
    assert any("repeats the one before" in words for words in said), said
