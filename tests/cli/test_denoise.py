"""`geneoh denoise` as its users run it: good input, doubtful input, bad input."""

import json
from pathlib import Path

import bodies
import numpy as np
import pytest
import quick_presets
from bad_inputs import CANARY, REFUSED, TOLD, with_arrays, write_good
from pages import page_scene

from geneoh.readers.checks.convention import doubts
from geneoh.readers.npz.files import load

EXAMPLES = Path(__file__).parents[2] / "examples"
RUN = ("denoise", "hand.npz", "--obj", "object.obj", "--preset", "fast")


@pytest.fixture(scope="module")
def report(command, tmp_path_factory):
    """What the README's first command prints and writes."""
    from click.testing import CliRunner

    out = tmp_path_factory.mktemp("out") / "clean.npz"
    noisy, mesh = EXAMPLES / "taco_noisy.npz", EXAMPLES / "taco_object.obj"
    result = CliRunner().invoke(
        command, ["denoise", str(noisy), "--obj", str(mesh), "-o", str(out), "--preset", "fast"]
    )
    return result, out


def test_clean_sequence_is_written_in_our_layout(report):
    result, out = report
    assert result.exit_code == 0, result.output
    with np.load(out) as file:
        assert str(file["format"]) == "geneoh-sequence"
        assert file["left_pose"].shape == (146, 48)
        assert file["left_joints"].shape == (146, 21, 3)
        assert file["left_filled"].sum() == 0
        assert json.loads(str(file["options"]))["preset"] == "fast"
    again = load(out)
    assert again.hands[0].hand_model == "embedded"
    assert "taco_noisy.npz" in again.source


def test_a_good_recording_raises_no_doubt(report):
    result, _ = report
    assert "WARNING" not in result.output
    sequence = load(EXAMPLES / "taco_noisy.npz", obj=EXAMPLES / "taco_object.obj")
    assert list(doubts(sequence, "taco_noisy.npz")) == []


def test_report_says_what_was_read_done_and_changed(report):
    result, out = report
    for words in (
        "146 frames at 30 frames a second",
        "left hand: 4 windows, 1 sample; ",
        "motion",
        "fit",
        "penetration depth, mean",
        "acceleration of keypoints",
        "frames in contact",
        "keypoints moved by",
        f"wrote {out}",
    ):
        assert words in result.stdout


def test_result_stands_beside_the_input_by_default(geneoh, tmp_path):
    write_good(tmp_path)
    geneoh(*RUN)
    assert load(tmp_path / "hand_clean.npz").frames == 6


@pytest.mark.parametrize("moves", [True, False])
def test_a_hand_without_a_mesh_is_cleaned_alone_and_said_so(geneoh, tmp_path, moves):
    write_good(tmp_path)
    if not moves:
        with_arrays(object_rotation=None, object_translation=None)(tmp_path)
    result = geneoh("denoise", "hand.npz", "--preset", "fast")
    assert "no object" in result.stdout
    assert "by the prior of hand motion alone" in result.stdout
    assert "n/a" in result.stdout
    assert load(tmp_path / "hand_clean.npz").frames == 6


def test_the_result_of_a_hand_alone_has_no_object_and_is_viewed_and_cleaned_again(geneoh, tmp_path):
    with_arrays(object_rotation=None, object_translation=None)(tmp_path)
    geneoh("denoise", "hand.npz", "--preset", "fast")
    with np.load(tmp_path / "hand_clean.npz") as file:
        assert not {"object_rotation", "object_translation", "object_valid"} & {*file}
    for words in (
        ("view", "hand_clean.npz", "-o", "page.html"),
        ("corrupt", "hand_clean.npz", "--noise", "gauss"),
        ("denoise", "hand_clean.npz", "--preset", "fast"),
    ):
        geneoh(*words)


def test_a_body_that_is_left_out_is_told_where_its_hands_are_cleaned(geneoh, tmp_path):
    bodies.hands_file(tmp_path / "hands.npz", bodies.recording())
    result = geneoh("denoise", "hands.npz", "--preset", "fast")
    assert result.stdout.count("note: the body that the hands belong to is left out") == 1
    assert not load(tmp_path / "hands_clean.npz").left_out


def test_a_page_of_a_hand_alone_shows_no_contact(geneoh, tmp_path):
    with_arrays(object_rotation=None, object_translation=None)(tmp_path)
    geneoh("denoise", "hand.npz", "--report", "page.html")
    versions = page_scene(tmp_path / "page.html")["versions"]
    assert [list(version["curves"]) for version in versions] == [["acceleration"]] * 2


def test_poses_without_a_mesh_give_a_page_of_the_hand_alone(geneoh, tmp_path):
    with_arrays(object_translation=lambda given: given + 0.1)(tmp_path)
    result = geneoh("denoise", "hand.npz", "--report", "page.html")
    assert "--obj MESH" in result.output
    assert (tmp_path / "page.html").is_file()


def test_samples_and_their_spread_are_saved(geneoh, tmp_path):
    write_good(tmp_path)
    geneoh(*RUN, "--samples", 3, "--select", "closest", "-o", "out.npz")
    with np.load(tmp_path / "out.npz") as file:
        assert file["right_samples"].shape == (3, 6, 21, 3)
        assert file["right_joint_spread"].shape == (6, 21)
        assert (file["right_joint_spread"] > 0).all()


def test_page_of_the_cleaning_shows_before_after_and_samples(geneoh, tmp_path):
    write_good(tmp_path)
    result = geneoh(*RUN, "--samples", 3, "--report", "page.html")
    assert "wrote page.html" in result.stdout
    told = page_scene(tmp_path / "page.html")
    assert [version["title"] for version in told["versions"]] == ["hand", "hand, cleaned"]
    assert told["frames"] == 6
    assert told["samples"]["right"]["shape"] == [6, 3, 21, 3]
    assert "spread" in told["versions"][1]["hands"][0]["ramps"]


def test_an_object_that_is_taken_as_exact_cannot_be_refined(geneoh, tmp_path):
    write_good(tmp_path)
    result = geneoh(*RUN, "--refine-object", "--trust-object", code=2)
    assert "(--refine-object) needs an object that is examined" in result.stderr


def test_same_seed_gives_the_same_file(geneoh, tmp_path):
    write_good(tmp_path)
    for name, seed in (("a.npz", 4), ("b.npz", 4), ("c.npz", 5)):
        geneoh(*RUN, "--seed", seed, "-o", name)
    a, b, c = ((tmp_path / f"{name}.npz").read_bytes() for name in "abc")
    assert a == b != c


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case.name)
def test_bad_input_ends_with_one_sentence_and_leaves_the_output_alone(geneoh, tmp_path, case):
    write_good(tmp_path)
    case.spoil(tmp_path)
    (tmp_path / "hand_clean.npz").write_bytes(b"an older result")
    command = RUN[:-2] if "--preset" in case.options else RUN
    result = geneoh(*command, "--overwrite", *case.options, code=2)
    last = result.stderr.strip().splitlines()[-1]
    assert last.startswith("Error: ")
    assert "Traceback" not in result.output
    for word in case.words:
        assert word in last
    assert (tmp_path / "hand_clean.npz").read_bytes() == b"an older result"
    assert not (tmp_path / CANARY).exists()
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("case", TOLD, ids=lambda case: case.name)
def test_doubtful_input_is_cleaned_and_told_of(geneoh, tmp_path, case, caplog):
    write_good(tmp_path)
    case.spoil(tmp_path)
    result = geneoh(*RUN, *case.options)
    said = result.output + caplog.text
    for word in case.words:
        assert word in said


def test_the_device_that_is_named_does_the_work(geneoh, device, tmp_path, monkeypatch):
    quick_presets.use(monkeypatch)
    write_good(tmp_path)
    geneoh(*RUN, "--device", device)
    with np.load(tmp_path / "hand_clean.npz") as file:
        assert json.loads(str(file["options"]))["device"] == str(device)


@pytest.mark.parametrize(
    ("place", "camera"), [("origin", (0, 0, 0)), ("-0.5,1,2e-1", (-0.5, 1, 0.2))]
)
def test_the_position_of_the_camera_is_kept_as_rays(geneoh, tmp_path, monkeypatch, place, camera):
    quick_presets.use(monkeypatch)
    write_good(tmp_path)
    geneoh(*RUN, "--camera", place)
    told = load(tmp_path / "hand.npz", obj=tmp_path / "object.obj", camera=camera).hands[0]
    ray = load(tmp_path / "hand_clean.npz").hands[0].camera_ray
    np.testing.assert_allclose(ray, told.camera_ray, atol=1e-6)


def test_a_delay_of_the_hand_is_mended(geneoh, tmp_path, monkeypatch):
    quick_presets.use(monkeypatch)
    write_good(tmp_path)
    result = geneoh(*RUN, "--hand-delay", "2")
    with np.load(tmp_path / "hand_clean.npz") as file:
        assert json.loads(str(file["options"]))["hand_delay"] == 2
        assert file["right_filled"][-2:].all()
    result = geneoh(*RUN, "--hand-delay", "1000", code=2)
    assert "leaves no frame" in result.stderr


@pytest.mark.parametrize("place", ["1,2", "here", "1,2,x"])
def test_a_camera_that_is_no_place_is_refused(geneoh, tmp_path, place):
    write_good(tmp_path)
    result = geneoh(*RUN, "--camera", place, code=2)
    assert f"expected three numbers X,Y,Z in metres, or origin, got '{place}'" in result.stderr


def test_a_folder_of_the_input_that_is_not_there_is_named_as_the_input(geneoh, tmp_path):
    result = geneoh("denoise", str(tmp_path / "typo" / "noisy.npz"), code=2)
    assert "noisy.npz: no such file or folder" in result.stderr
