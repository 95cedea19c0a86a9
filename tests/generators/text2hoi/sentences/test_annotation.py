from pathlib import Path

import numpy as np
import pytest

from geneoh.errors import InputError
from geneoh.generators.text2hoi.sentences.annotation import (
    H2O_LABELS,
    Label,
    grab_noun,
    has_labels,
    labels_of,
)
from geneoh.generators.text2hoi.sentences.captions import captions
from geneoh.readers.base import SourceClip


def h2o(tmp_path, labels, camera="cam4"):
    folder = tmp_path / "subject3/k1/2" / camera
    (folder / "action_label").mkdir(parents=True)
    for frame, number in labels.items():
        (folder / "action_label" / f"{frame:06d}.txt").write_text(f"{number}\n")
    return SourceClip("clip", folder)


def test_h2o_has_36_labels_of_11_verbs_and_8_objects():
    assert len(H2O_LABELS) == 36
    assert len({verb for verb, _ in H2O_LABELS}) == 11
    assert len({noun for _, noun in H2O_LABELS}) == 8
    # numbers as the data set counts them, from 1
    expected = {1: "grab book", 16: "place cappuccino", 23: "pour milk", 28: "put in espresso"}
    for number, words in (expected | {36: "squeeze lotion"}).items():
        assert " ".join(H2O_LABELS[number - 1]) == words


def test_h2o_stretches_have_one_label_and_more_than_20_frames(tmp_path):
    numbers = [0] * 5 + [5] * 21 + [13] * 20 + [23] * 30 + [0] * 4
    clip = h2o(tmp_path, dict(enumerate(numbers)))
    assert labels_of("h2o", clip) == [
        Label("grab", "milk", "milk", slice(5, 26), subject="subject3"),
        Label("pour", "milk", "milk", slice(46, 76), subject="subject3"),
    ]


def test_h2o_stretches_end_where_frames_are_missing(tmp_path):
    frames = [*range(10, 40), *range(50, 75)]
    clip = h2o(tmp_path, {frame: 33 for frame in frames})
    assert [label.frames for label in labels_of("h2o", clip)] == [slice(10, 40), slice(50, 75)]


def test_only_the_camera_with_labels_counts(tmp_path):
    assert has_labels("h2o", h2o(tmp_path, {0: 1}))
    (tmp_path / "subject3/k1/2/cam0").mkdir()
    assert not has_labels("h2o", SourceClip("clip", tmp_path / "subject3/k1/2/cam0"))


@pytest.mark.parametrize("number", ["37", "-1", "1.5", "x"])
def test_h2o_labels_that_do_not_exist_are_refused(tmp_path, number):
    with pytest.raises(InputError, match=r"000000\.txt"):
        labels_of("h2o", h2o(tmp_path, {0: number}))


def grab(tmp_path, intent, name="cubesmall", touched=slice(8, 100)):
    contact = np.zeros((120, 4), np.int8)
    contact[touched, 2] = 40
    fields = {"obj_name": name, "motion_intent": intent, "contact": {"object": contact}}
    path = tmp_path / "grab/s7" / f"{name}_{intent}_1.npz"
    path.parent.mkdir(parents=True)
    np.savez(path, **{key: np.array(value, dtype=object) for key, value in fields.items()})
    return SourceClip("clip", path)


def test_grab_is_from_the_first_to_the_last_touch(tmp_path):
    expected = Label("lift", "cube", "cubesmall", slice(8, 100), subject="s7")
    assert labels_of("grab", grab(tmp_path, "lift")) == [expected]


@pytest.mark.parametrize(
    ("intent", "plain", "passive"),
    [
        ("offhand", "Hand over a cube", "A cube is handed over"),  # without "is" in their tables
        ("switchON", "Switch on a cube", "A cube is switched on"),
        ("takepicture", "Photograph a cube", "A cube is photographed"),
        ("drink", "Drink a cube", "A cube is drunk"),
    ],
)
def test_intents_of_grab_in_words(tmp_path, intent, plain, passive):
    (label,) = labels_of("grab", grab(tmp_path, intent))
    said = captions(label.verb, label.noun, "both hands")
    assert said[0] == f"{plain} with both hands."
    assert said[3] == f"{passive} by both hands."


def test_objects_of_grab_in_words():
    names = ("cubelarge", "cubemiddle", "torusmedium", "wineglass", "fryingpan", "apple")
    assert [grab_noun(name) for name in names] == [
        *("cube", "cube", "torus", "wine glass", "frying pan", "apple")
    ]


def test_a_grab_sequence_without_touch_has_no_label(tmp_path):
    assert labels_of("grab", grab(tmp_path, "lift", touched=slice(0))) == []


def test_grab_without_contact_is_refused(tmp_path):
    clip = grab(tmp_path, "lift")
    packed = {"obj_name": "cup", "motion_intent": "lift", "contact": {"body": np.zeros(3)}}
    np.savez(clip.path, **{key: np.array(value, dtype=object) for key, value in packed.items()})
    with pytest.raises(InputError, match="'contact': 'object' must be whole numbers"):
        labels_of("grab", clip)


def arctic(tmp_path, text, name="capsulemachine_use_02", folder="description"):
    path = tmp_path / "raw_seqs/s05" / f"{name}.mano.npy"
    path.parent.mkdir(parents=True, exist_ok=True)
    described = tmp_path / folder / "s05" / name / "description.txt"
    described.parent.mkdir(parents=True)
    described.write_text(text)
    return SourceClip("clip", Path(path))


def test_arctic_lines_count_frames_from_1_and_name_the_hands(tmp_path):
    text = "1-40 grasp left capsulemachine\n\n41-60 openning, both capsulemachine\n"
    assert labels_of("arctic", arctic(tmp_path, text)) == [
        Label("grasp", "capsule machine", "capsulemachine", slice(0, 40), "left hand", "s05"),
        Label("open", "capsule machine", "capsulemachine", slice(40, 60), "both hands", "s05"),
    ]


def test_arctic_leaves_out_short_stretches_and_what_the_paper_leaves_out(tmp_path):
    text = "5-23 lift right capsulemachine\n30-80 push right capsulemachine\n90-109 lift right x"
    (label,) = labels_of("arctic", arctic(tmp_path, text))
    assert (label.verb, label.frames) == ("lift", slice(89, 109))


@pytest.mark.parametrize("line", ["40-1 lift left box", "0-40 lift left box", "1-40 lift box", "x"])
def test_damaged_lines_are_refused(tmp_path, line):
    with pytest.raises(InputError, match=r"description\.txt, line 2: expected 'start-end verb"):
        labels_of("arctic", arctic(tmp_path, f"1-40 lift left box\n{line}\n"))


def test_descriptions_may_lie_beside_the_sequences(tmp_path):
    clip = arctic(tmp_path, "1-40 lift left box", folder="raw_seqs")
    assert len(labels_of("arctic", clip)) == 1


def test_missing_descriptions_say_where_they_belong(tmp_path):
    clip = SourceClip("clip", tmp_path / "raw_seqs/s05/box_grab_01.mano.npy")
    with pytest.raises(InputError, match=r"description/s05/box_grab_01/description\.txt, found no"):
        labels_of("arctic", clip)
