"""`geneoh view` as its users run it: pages, pictures, films and files, live looking, bad input."""

import time
from dataclasses import replace
from pathlib import Path

import bodies
import numpy as np
import pytest
import trimesh
from bad_inputs import write_good
from pages import page_scene
from PIL import Image

from geneoh import load, save
from geneoh.choices import STRIP_CELL
from geneoh.errors import MissingAssetError
from geneoh.readers.joint_orders import ORDERS
from geneoh.viz.canvas import LEAST_COLUMN, STRIP_GAP
from geneoh.viz.video import ffmpeg_path

EXAMPLES = Path(__file__).parents[2] / "examples"
VIEW = ("view", "clean.npz", "--obj", "object.obj")


@pytest.fixture
def folder(tmp_path):
    """A noisy clip and what could be its result: the same, two centimetres higher."""
    write_good(tmp_path)
    with np.load(tmp_path / "hand.npz") as file:
        arrays = dict(file)
    arrays["joints"] = arrays["joints"] + np.float32([0, 0, 0.02])
    np.savez(tmp_path / "clean.npz", **arrays)
    return tmp_path


@pytest.fixture
def film_maker():
    """A skip that says so where there is no ffmpeg."""
    try:
        ffmpeg_path()
    except MissingAssetError as error:
        pytest.skip(str(error))


def width(path: Path) -> int:
    with Image.open(path) as picture:
        return picture.width


def test_page_stands_beside_the_result_by_default(geneoh, folder):
    result = geneoh(*VIEW)
    assert result.stdout == "wrote clean.html\n"
    assert [version["title"] for version in page_scene(folder / "clean.html")["versions"]] == [
        "clean"
    ]


def test_the_unit_and_the_order_of_keypoints_are_of_the_input(geneoh, folder):
    save(load(folder / "clean.npz", obj=folder / "object.obj"), folder / "result.npz")
    joints = load(folder / "hand.npz").hands[0].joints.numpy()
    np.save(folder / "raw.npy", 1000 * joints[:, np.argsort(ORDERS["mano"].entries)])
    given = ("view", "result.npz", "raw.npy", "--side", "right")
    assert "--keypoint-unit mm" in geneoh(*given, "--joint-order", "mano", code=2).stderr
    geneoh(*given, "--joint-order", "mano", "--keypoint-unit", "mm")
    before, after = page_scene(folder / "result.html")["versions"]
    assert (before["title"], after["title"]) == ("raw", "result")


def test_a_mesh_of_another_unit_is_told(geneoh, folder):
    assert "twice, drop --unit" in geneoh(*VIEW, "--unit", "mm").stdout
    (folder / "clean.html").unlink()
    assert "too small" not in geneoh(*VIEW).stdout


def test_meshes_that_the_result_names_are_found_without_obj(geneoh, folder):
    save(load(folder / "clean.npz", obj=folder / "object.obj"), folder / "result.npz")
    geneoh("view", "result.npz", "hand.npz")
    (part,) = page_scene(folder / "result.html")["parts"]
    assert part["faces"]["shape"][0] > 0


def test_a_mesh_that_is_not_there_any_more_is_named_with_the_remedy(geneoh, folder):
    save(load(folder / "clean.npz", obj=folder / "object.obj"), folder / "result.npz")
    (folder / "object.obj").unlink()
    result = geneoh("view", "result.npz", code=2)
    last = result.stderr.strip().splitlines()[-1]
    assert last.startswith("Error: result.npz")
    assert "object.obj is not there any more" in last
    assert last.endswith("pass --obj MESH")


def test_before_stands_before_after(geneoh, folder):
    geneoh("view", "clean.npz", "hand.npz", "--obj", "object.obj", "-o", "both.html")
    page = page_scene(folder / "both.html")
    assert [version["title"] for version in page["versions"]] == ["hand", "clean"]
    assert page["frames"] == 6
    assert page["fps"] == 30


def test_keypoints_alone_are_shown_as_a_result_is(geneoh, folder):
    np.save(folder / "hand.npy", np.load(folder / "hand.npz")["joints"])
    geneoh("view", "hand.npy", "--side", "right")
    assert page_scene(folder / "hand.html")["frames"] == 6


def test_a_folder_without_mano_is_refused_where_the_command_names_it(geneoh, folder, monkeypatch):
    refused = geneoh(*VIEW, "--mano", "nodir", code=2)
    assert "nodir/MANO_RIGHT.pkl: expected this file and found none" in refused.stderr
    monkeypatch.setenv("GENEOH_MANO_DIR", "nodir")  # which is for all commands
    geneoh(*VIEW)


def test_up_turns_the_page(geneoh, folder):
    geneoh(*VIEW, "--up", "-y")
    assert page_scene(folder / "clean.html")["camera"]["up"] == [0, -1, 0]


def test_several_files_are_written_by_their_endings(geneoh, folder):
    outputs = ("strip.png", "clip.glb", "smplx.npz", "meshes.ply")
    result = geneoh(*VIEW, *(word for name in outputs for word in ("-o", name)))
    written = ("strip.png", "clip.glb", "smplx.npz", "meshes")
    assert result.stdout.splitlines() == [f"wrote {name}" for name in written]
    assert trimesh.load_scene(folder / "clip.glb").geometry.keys() == {"right hand", "object"}
    assert load(folder / "smplx.npz").frames == 6
    assert len(list((folder / "meshes").iterdir())) == 12


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("-o", "body.bvh"), "a BVH holds a body"),
        (("-o", "smplx.npz"), "one hand, got 2; pass --side"),
        (("-o", "strip.png", "--colour", "spread"), "needs the expected error of keypoints"),
        (("-o", "strip.png", "--frame", 6), "frames must be from 0 to 5, got 6"),
    ],
)
def test_a_format_that_cannot_be_written_leaves_no_other_file(geneoh, folder, asked, words):
    hand = load(folder / "clean.npz", obj=folder / "object.obj")
    two = replace(hand, hands=(hand.hands[0], hand.hands[0].mirrored()))
    save(two, folder / "two.npz")
    result = geneoh("view", "two.npz", "-o", "page.html", *asked, code=2)
    assert words in result.stderr
    assert not (folder / "page.html").exists()


@pytest.mark.parametrize("name", ["body.bvh", "body.npz"])
def test_a_body_is_not_written_for_one_of_its_hands(geneoh, folder, name):
    bodies.hands_file(folder / "hands.npz", bodies.recording())
    result = geneoh("view", "hands.npz", "--side", "left", "-o", name, code=2)
    assert "got the left one; leave --side out" in result.stderr
    geneoh("view", "hands.npz", "-o", name)


def test_filmstrip_shows_the_frames_that_were_asked_for(geneoh, folder):
    geneoh(*VIEW, "-o", "strip.png", "--frame", 1, "--frame", 4, "--cell", 64)
    assert width(folder / "strip.png") == 2 * LEAST_COLUMN + STRIP_GAP


def first_frames(source: Path, target: Path, count: int) -> None:
    """The beginning of a recording of 146 frames."""
    with np.load(source) as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(target, **{n: a[:count] if a.shape[:1] == (146,) else a for n, a in arrays.items()})


def test_film_and_filmstrip_come_at_the_pace_of_146_frames_a_minute_without_a_display(
    geneoh, tmp_path, monkeypatch, film_maker
):
    monkeypatch.delenv("DISPLAY", raising=False)
    for name in ("taco_noisy.npz", "taco_clean.npz"):
        first_frames(EXAMPLES / name, tmp_path / name, 15)
    start = time.process_time()
    geneoh(
        *("view", "taco_clean.npz", "taco_noisy.npz", "--obj", EXAMPLES / "taco_object.obj"),
        *("-o", "a.mp4", "-o", "a.png"),
    )
    # the work of all cores together: on two idle ones it takes about half as long
    assert (time.process_time() - start) / 15 < 60 / 146
    assert (tmp_path / "a.mp4").stat().st_size > 5_000
    assert width(tmp_path / "a.png") == 5 * STRIP_CELL + 4 * STRIP_GAP


def test_results_are_looked_at_live(geneoh, folder, monkeypatch):
    pytest.importorskip("viser", reason="the extra `view` is not installed")
    from geneoh.viz.serve import Gallery

    shown = []

    def run(gallery):
        shown.append(gallery.shown.name)
        gallery.stop()
        raise KeyboardInterrupt

    monkeypatch.setattr(Gallery, "run", run)
    (folder / "clean.npz").rename(folder / "hand_clean.npz")
    (folder / "object.obj").rename(folder / "hand.obj")
    (folder / "bad.npz").write_bytes(b"no results")
    result = geneoh("view", "--serve", "hand_clean.npz", "bad.npz", "hand.npz", "--port", 0)
    assert "2 results at http://127.0.0.1:" in result.stdout
    assert "left out: bad: bad.npz" in result.stderr.replace(f"{folder}/", "")
    assert shown == ["hand_clean"]  # neither touches the box: the first that was named
    result = geneoh("view", "--serve", "hand_clean.npz", "--port", 0)
    assert "1 result at http://127.0.0.1:" in result.stdout


REFUSED = {
    "no such file": (("view", "none.npz", "--obj", "object.obj"), ("none.npz", "no such file")),
    "three files": ((*VIEW, "hand.npz", "hand.npz"), ("got 3 files",)),
    "another length": ((*VIEW, "short.npz"), ("same frames", "3 against 6")),
    "another ending": ((*VIEW, "-o", "good.png", "-o", "clip.avi"), ("clip.avi", "got '.avi'")),
    "no such frame": ((*VIEW, "-o", "a.png", "--frame", "9"), ("from 0 to 5, got 9",)),
    "no such folder": ((*VIEW, "-o", "none/a.html"), ("none/a.html", "cannot be written")),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_ends_with_one_sentence_and_leaves_nothing(geneoh, folder, case):
    arguments, words = REFUSED[case]
    with np.load(folder / "hand.npz") as file:
        whole = dict(file)
    short = {name: array[:3] if array.ndim > 1 else array for name, array in whole.items()}
    np.savez(folder / "short.npz", **short)
    there = sorted(folder.iterdir())
    result = geneoh(*arguments, code=2)
    (last,) = result.stderr.strip().splitlines()
    assert last.startswith("Error: ")
    for word in words:
        assert word in last
    assert sorted(folder.iterdir()) == there


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--port", 80), "--port needs --serve"),
        (("--serve", "-o", "a.png"), "--output has no meaning with --serve"),
        (("--frame", 1), "--frame needs a filmstrip"),
        (("-o", "a.mp4", "--cell", 64), "--cell needs a filmstrip"),
        (("-o", "a.glb", "--colour", "contact"), "--colour needs a picture or a film"),
        (
            ("-o", "a.obj", "-o", "a.npz", "--up", "y"),
            "--up needs a page, a picture, a film or NAME",
        ),
    ],
)
def test_an_option_that_would_be_ignored_is_refused(geneoh, folder, words, said):
    done = geneoh(*VIEW, *words, code=2)
    assert said in done.stderr
