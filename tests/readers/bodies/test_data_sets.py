import bodies
import numpy as np
import pytest

from geneoh.errors import InputError
from geneoh.readers.bodies.data_sets import body_files, read_source_bodies

SWAYING = bodies.swaying()


def test_clips_of_both57m_are_recordings_of_their_own(tmp_path):
    bodies.both57m(tmp_path / "a.p", SWAYING, bodies.swaying(5))
    (file,) = body_files("both57m", tmp_path)
    first, second = read_source_bodies("both57m", file)
    assert first.body.sentences[0] == "the right hand waves"
    assert (second.body.frames, second.by_frame) == (5, {})
    assert first.group != second.group


def test_motion_x_has_a_label_of_all_and_words_on_the_hands_of_each_frame(tmp_path):
    bodies.motion_x_tree(tmp_path, idea400__subset_0001__wave_clip_1=SWAYING)
    (file,) = body_files("motionx", tmp_path)
    (body,) = read_source_bodies("motionx", file)
    assert body.body.sentences == ("A person does idea400/subset_0001/wave_clip_1.",)
    assert body.by_frame[7] == "the fingers are bent 7 times"
    assert len(body.by_frame) == 8
    below = body_files("motionx", tmp_path / "motion_data" / "smplx_322" / "idea400")
    assert [path.name for path in below] == ["wave_clip_1.npy"]


def test_clips_of_one_recording_of_motion_x_are_one_group(tmp_path):
    names = ("fitness__subset_0001__jab_clip_1", "fitness__subset_0002__jab_Clip1_clip_12")
    mirrored = ("humanml__000024", "humanml__M000024")
    tree = bodies.motion_x_tree(tmp_path, **dict.fromkeys((*names, *mirrored), SWAYING))
    files = body_files("motionx", tree)
    groups = [body.group for file in files for body in read_source_bodies("motionx", file)]
    assert groups == ["/fitness/jab", "/fitness/jab", "/humanml/000024", "/humanml/000024"]


def test_motion_x_without_texts_is_read_without_sentences(tmp_path):
    (tmp_path / "motion_data" / "smplx_322").mkdir(parents=True)
    bodies.motion_x(tmp_path / "motion_data" / "smplx_322" / "a.npy", SWAYING)
    (file,) = body_files("motionx", tmp_path)
    (body,) = read_source_bodies("motionx", file)
    assert (body.body.sentences, body.by_frame) == ((), {})


def test_recordings_of_a_person_of_amass_are_one_group(tmp_path):
    for person, name in (("s1", "walk_poses"), ("s1", "run_stageii"), ("s2", "walk_poses")):
        (tmp_path / person).mkdir(exist_ok=True)
        bodies.amass(tmp_path / person / f"{name}.npz", SWAYING)
    np.savez(tmp_path / "s1" / "shape.npz", betas=np.zeros(16))
    files = body_files("amass", tmp_path)
    groups = [body.group for file in files for body in read_source_bodies("amass", file)]
    assert groups == [str(tmp_path / person) for person in ("s1", "s1", "s2")]


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("both57m", r"expected \*.p or \*.pkl, as in the data set both57m"),
        ("motionx", "npy below motion_data/smplx_322, as in the data set motionx"),
        ("amass", r"expected \*_poses.npz or \*_stageii.npz"),
    ],
)
def test_a_folder_without_the_files_of_a_data_set_is_refused(tmp_path, source, said):
    np.save(tmp_path / "a.npy", np.zeros((4, 322)))
    with pytest.raises(InputError, match=said):
        body_files(source, tmp_path)


def test_damaged_words_on_hands_are_refused_by_their_file(tmp_path):
    bodies.motion_x_tree(tmp_path, idea400__wave=SWAYING)
    (file,) = body_files("motionx", tmp_path)
    words = tmp_path / "texts" / "hand_texts" / "idea400" / "wave.json"
    for text in ("{", "[1]", '{"0": 3}'):
        words.write_text(text)
        with pytest.raises(InputError, match=r"wave\.json"):
            list(read_source_bodies("motionx", file))
