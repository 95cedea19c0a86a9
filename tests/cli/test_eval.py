"""`geneoh eval` on a very small scale, and its refusals."""

import json

import pytest

from geneoh.errors import InputError
from geneoh.evaluation import runner

CLIPS = ("--dataset", "synthetic", "--limit", 1, "--noise", "gauss", "--set", "frames=6")
SMALL = (*CLIPS, "--close-frames", 2, "--jobs", 1)


@pytest.mark.slow
def test_a_table_is_printed_and_everything_is_written(geneoh, tmp_path):
    done = geneoh("eval", *SMALL, "--method", "input", "--method", "savgol", "-o", "out")
    assert "synthetic, gauss: 1 clip, 1 seed" in done.stdout
    assert "Savitzky-Golay on parameters" in done.stdout
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert files == {"scores.jsonl", "scores.csv", "evaluation.json", "report.md", "report.html"}
    whole = json.loads((tmp_path / "out" / "evaluation.json").read_text())
    assert whole["command"] == (
        "geneoh eval --dataset synthetic --noise gauss --limit 1 --method input --method savgol "
        "--close-frames 2 --set frames=6 --output out --jobs 1"
    )
    other = geneoh("eval", *SMALL, "--set", "frames=7", "-o", "out", code=2)
    assert "--fresh" in other.stderr


def test_inputs_are_written_for_others(geneoh, tmp_path):
    done = geneoh("eval", *CLIPS, "--inputs", "inputs")
    assert "wrote 1 clip to inputs" in done.stdout
    assert len(list((tmp_path / "inputs").glob("*_gauss_11.npz"))) == 1
    geneoh("eval", *CLIPS, "--inputs", "inputs")
    mesh = next((tmp_path / "inputs" / "objects").glob("*.obj"))
    mesh.write_text("another mesh")
    done = geneoh("eval", *CLIPS, "--inputs", "inputs", code=2)
    assert "holds another mesh already; choose another folder" in done.stderr
    assert mesh.read_text() == "another mesh"
    done = geneoh("eval", *CLIPS, "--inputs", mesh / "inputs", code=2)
    assert "inputs: cannot be written (Not a directory)" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("found", ["none", "damaged"])
def test_a_method_without_any_result_ends_with_one_sentence_and_exit_code_2(
    geneoh, tmp_path, found
):
    (tmp_path / "theirs").mkdir()
    if found == "damaged":
        geneoh("eval", *CLIPS, "--inputs", "theirs")
        (damaged,) = (tmp_path / "theirs").glob("*.npz")
        damaged.write_bytes(b"no npz")
    done = geneoh(
        "eval", *SMALL, "--method", "input", "--predictions", "theirs", "-o", "out", code=2
    )
    assert len(done.stderr.strip().splitlines()) == 1
    for word in ("theirs: expected results", "got none of 1", "again", "scores.csv"):
        assert word in done.stderr
    assert (tmp_path / "out" / "report.html").is_file()


def test_a_data_set_of_generators_alone_is_told_to_need_one(geneoh):
    for more in ((), ("--inputs", "inputs")):
        done = geneoh("eval", "--dataset", "h2o", *more, code=2)
        assert done.stdout == ""
        assert len(done.stderr.strip().splitlines()) == 1
        for word in ("--dataset h2o", "without --generator", "taco", "add --generator text2hoi"):
            assert word in done.stderr


@pytest.mark.parametrize("dataset", ["grab", "grab-beta", "hoi4d", "arctic"])
def test_a_data_set_that_is_not_there_is_one_sentence(geneoh, dataset, monkeypatch):
    for name in ("GRAB", "HOI4D", "ARCTIC"):
        monkeypatch.delenv(f"GENEOH_DATA_{name}", raising=False)
    done = geneoh("eval", "--dataset", dataset, code=2)
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    for word in ("--root", "GENEOH_DATA_", "get it at"):
        assert word in done.stderr


@pytest.mark.parametrize("option", ["--predictions", "--twins"])
def test_a_missing_folder_of_clips_is_told(geneoh, option):
    done = geneoh("eval", *SMALL, option, "nowhere", code=2)
    assert f"{option} nowhere: expected a folder" in done.stderr


def test_a_hand_model_that_is_missing_is_told_before_any_work(geneoh, monkeypatch):
    monkeypatch.delenv("GENEOH_MANO_DIR", raising=False)
    done = geneoh("eval", *SMALL, "--method", "input", "--hand", "mano", "-o", "out", code=2)
    assert "MANO_RIGHT.pkl: no folder is given" in done.stderr


def test_the_device_that_is_named_is_that_of_the_cleaner(geneoh, monkeypatch):
    asked = []

    def pretended(options, folder, **how):
        asked.append(options.cleaner.device)
        raise InputError("enough")

    monkeypatch.setattr(runner, "evaluate", pretended)
    geneoh("eval", *SMALL, "--device", "cpu:0", code=2)
    geneoh("eval", *SMALL, "--method", "one-call", "--device", "cpu:0", code=2)
    assert asked == ["cpu:0", "cpu:0"]
    done = geneoh("eval", *SMALL, "--device", "nothing", code=2)
    assert "--device nothing: expected a device of this machine" in done.stderr


def test_a_misspelt_choice_of_the_protocol_is_told(geneoh):
    done = geneoh("eval", "--dataset", "taco", "--set", "window=all", code=2)
    assert "did you mean 'windows'" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*CLIPS, "--inputs", "in", "--fresh"), "--fresh has no meaning with --inputs"),
        ((*CLIPS, "--method", "input", "--pages"), "--pages needs --method geneoh too"),
        ((*CLIPS, "--method", "input", "--device", "cuda"), "--device needs --method geneoh too"),
        ((*CLIPS, "--method", "input", "--weights", "."), "--weights needs a --method that has"),
        ((*CLIPS, "--refine", "geneoh"), "--refine needs --generator"),
        ((*CLIPS, "--root", "."), "--root has no meaning with --dataset synthetic"),
        ((*CLIPS, "--set", "windows=whole"), "--set windows: expected none with synthetic"),
        (("--dataset", "taco", "--set", "frames=30"), "with the example of taco"),
    ],
)
def test_an_option_that_would_be_ignored_is_refused(geneoh, monkeypatch, words, said):
    monkeypatch.delenv("GENEOH_DATA_TACO", raising=False)
    done = geneoh("eval", *words, code=2)
    assert said in done.stderr
