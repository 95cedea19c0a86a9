"""What exists is not lost: outputs are checked before the work, by every command that writes."""

import json
import os

import numpy as np
import pytest
from bad_inputs import write_good

import geneoh as geneoh_api
from geneoh.errors import InputError
from geneoh.readers.npz.files import load

DENOISE = ("denoise", "hand.npz", "--obj", "object.obj", "--preset", "fast")
CORRUPT = ("corrupt", "hand.npz", "--noise", "gauss", "-o")
VIEW = ("view", "hand.npz", "before.npz", "--obj", "object.obj", "-o")
REALISM = ("realism", "hand.npz", "--obj", "object.obj", "-o")

REFUSED = {
    "denoise, input": ((*DENOISE, "-o", "hand.npz"), ("hand.npz", "is an input")),
    "denoise, input by link": ((*DENOISE, "-o", "link.npz"), ("link.npz", "is an input")),
    "denoise, input by hard link": ((*DENOISE, "-o", "hard.npz"), ("hard.npz", "is an input")),
    "denoise, input by detour": ((*DENOISE, "-o", "in/../hand.npz"), ("is an input",)),
    "denoise, mesh": ((*DENOISE, "-o", "object.obj"), ("object.obj", "expected .npz")),
    "denoise, ending": ((*DENOISE, "-o", "x.glb"), ("x.glb", "expected .npz", "got '.glb'")),
    "denoise, foreign": ((*DENOISE, "-o", "notes.npz"), ("notes.npz", "--overwrite")),
    "denoise, device": ((*DENOISE, "-o", "null.npz"), ("null.npz", "got a device")),
    "denoise, pipe": ((*DENOISE, "-o", "pipe.npz"), ("pipe.npz", "got a pipe")),
    "denoise, folder": ((*DENOISE, "-o", "none/x.npz"), ("none/x.npz", "cannot be written")),
    "denoise, default": ((*DENOISE, "--report", "r.html"), ("hand_clean.npz", "--overwrite")),
    "report, output": (
        (*DENOISE, "-o", "x.npz", "--report", "in/../x.npz"),
        ("x.npz", "expected .html"),
    ),
    "report, input": ((*DENOISE, "--report", "object.obj"), ("object.obj", "expected .html")),
    "report, foreign": ((*DENOISE, "-o", "x.npz", "--report", "my.html"), ("my.html", "--over")),
    "report, folder": (
        (*DENOISE, "-o", "x.npz", "--report", "none/r.html"),
        ("none/r.html", "cannot be written"),
    ),
    "poses": ((*DENOISE, "--body", "body.npz", "-o", "body.npz"), ("body.npz", "is an input")),
    "corrupt, input": ((*CORRUPT, "hand.npz"), ("hand.npz", "is an input")),
    "corrupt, ending": ((*CORRUPT, "x.json"), ("x.json", "expected .npz")),
    "corrupt, foreign": ((*CORRUPT, "notes.npz"), ("notes.npz", "--overwrite")),
    "view, input": ((*VIEW, "hand.npz"), ("hand.npz", "is an input")),
    "view, before": ((*VIEW, "before.npz"), ("before.npz", "is an input")),
    "view, foreign": ((*VIEW, "x.png", "-o", "my.html"), ("my.html", "--overwrite")),
    "view, twice": ((*VIEW, "x.html", "-o", "in/../x.html"), ("x.html", "two outputs")),
    "view, folder is there": ((*VIEW, "in.ply"), ("in", "expected a new folder")),
    "realism, ending": ((*REALISM, "x.npz"), ("x.npz", "expected .json")),
    "realism, foreign": ((*REALISM, "my.json"), ("my.json", "--overwrite")),
    "realism, folder": ((*REALISM, "none/x.json"), ("none/x.json", "cannot be written")),
    "eval, foreign": (
        ("eval", "--dataset", "synthetic", "--limit", 1, "-o", "in"),
        ("report.md", "not written by geneoh"),
    ),
    "synthesize, foreign": (("synthesize", "-o", "in"), ("sheet.png", "not written by geneoh")),
}


@pytest.fixture
def folder(tmp_path):
    """A clip with its mesh, and what its owner would not want to lose."""
    write_good(tmp_path)
    (tmp_path / "before.npz").write_bytes((tmp_path / "hand.npz").read_bytes())
    (tmp_path / "in").mkdir()
    (tmp_path / "link.npz").symlink_to("hand.npz")
    (tmp_path / "null.npz").symlink_to("/dev/null")
    os.link(tmp_path / "hand.npz", tmp_path / "hard.npz")
    os.mkfifo(tmp_path / "pipe.npz")
    for name in (
        *("notes.npz", "hand_clean.npz", "body.npz", "my.html", "my.json"),
        *("in/sheet.png", "in/report.md"),
    ):
        (tmp_path / name).write_text("precious")
    return tmp_path


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("case", REFUSED)
def test_an_output_that_would_lose_something_is_refused_before_the_work(
    geneoh, folder, case, monkeypatch
):
    arguments, words = REFUSED[case]
    monkeypatch.setattr("geneoh.files.npz.read_bytes", None)
    there = contents(folder)
    result = geneoh(*arguments, code=2)
    (last,) = result.stderr.strip().splitlines()
    assert last.startswith("Error: ")
    for word in words:
        assert word in last
    assert contents(folder) == there


def test_overwrite_replaces_what_others_wrote_but_no_input(geneoh, folder):
    geneoh(*CORRUPT, "notes.npz", "--overwrite")
    assert load(folder / "notes.npz").frames == 6
    before = contents(folder)
    for arguments in ((*CORRUPT, "hand.npz"), (*DENOISE, "-o", "hand.npz"), (*VIEW, "hand.npz")):
        refused = geneoh(*arguments, "--overwrite", code=2)
        assert "is an input" in refused.stderr, arguments
    assert contents(folder) == before


def test_our_own_files_are_replaced_without_being_asked(geneoh, folder):
    for command in ((*CORRUPT, "x.npz"), (*VIEW, "x.html", "-o", "x.png", "-o", "x.glb")):
        for _ in range(2):
            geneoh(*command)
    geneoh(*VIEW, "smplx.npz")
    geneoh(*VIEW, "smplx.npz")


def test_python_too_replaces_no_input_and_no_device(folder):
    clip = geneoh_api.load(folder / "hand.npz", obj=folder / "object.obj")
    there = contents(folder)
    with pytest.raises(InputError, match="got a device"):
        geneoh_api.save(clip, folder / "null.npz")
    with pytest.raises(InputError, match=r"expected \.npz"):
        geneoh_api.save(clip, "/dev/null")
    with pytest.raises(InputError, match="is an input"):
        geneoh_api.view(clip, folder / "link.npz", before=folder / "hand.npz")
    assert contents(folder) == there


def test_a_link_is_followed_and_stays(geneoh, folder):
    (folder / "other.npz").symlink_to("in/target.npz")
    geneoh(*CORRUPT, "other.npz")
    assert (folder / "other.npz").is_symlink()
    assert load(folder / "in/target.npz").frames == 6


def test_a_converted_clip_replaces_no_file_of_others(geneoh, folder):
    track = np.load(folder / "hand.npz")["joints"]
    value = {"format": "geneoh-landmarks", "version": 1, "order": "openpose", "fps": 30}
    hands = {"right": [{"points": points.tolist()} for points in track]}
    (folder / "clip.json").write_text(json.dumps({**value, "hands": hands}))
    (folder / "in/clip.npz").write_text("precious")
    command = ("convert", "landmarks", "clip.json", "-o", "in")
    refused = geneoh(*command, code=2)
    assert "clip: not read, in/clip.npz: is there already" in refused.output
    assert (folder / "in/clip.npz").read_text() == "precious"
    geneoh(*command, "--overwrite")
    assert load(folder / "in/clip.npz").frames == len(track)


def test_noisy_clips_are_not_written_over_those_that_are_read(geneoh, folder):
    small = ("eval", "--dataset", "synthetic", "--limit", 1)
    result = geneoh(*small, "--inputs", "in", "--twins", "in/../in", code=2)
    assert "is an input" in result.stderr
