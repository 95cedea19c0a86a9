"""`geneoh.view` as Python users call it."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlparse
from urllib.request import url2pathname

import fake_cleaning
import jaxtyping
import numpy as np
import pytest
import torch
import trees
from pages import page_scene
from PIL import Image

import geneoh
from geneoh.errors import ConfigError, InputError, MissingAssetError
from geneoh.files.npz import Arrays
from geneoh.pipeline.options import Options
from geneoh.pipeline.results import kept_arrays, kept_notes
from geneoh.readers.npz.files import save_sequence
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.viz import view as view_module
from geneoh.viz.canvas import LEAST_COLUMN
from geneoh.viz.page import page_html
from geneoh.viz.view import confidence_of, open_scene, view

pytestmark = pytest.mark.usefixtures("few_directions")


def titles(path: Path) -> list[str]:
    return [version["title"] for version in page_scene(path)["versions"]]


def test_a_page_shows_the_result_beside_what_it_was_made_from(sequences, tmp_path):
    before, after = sequences
    written = view(after, tmp_path / "page.html", before=before)
    assert written == tmp_path / "page.html"
    assert titles(written) == ["noisy", "clean"]


def test_doubts_about_the_objects_poses_are_a_curve_of_the_page(sequences, tmp_path):
    sure = np.ones((6, 2), dtype=np.float32)
    doubtful = sure.copy()
    doubtful[2, 1] = 0.25
    unseen = sure * [1, 0]
    for name, confidence in (("sure", sure), ("doubtful", doubtful), ("unseen", unseen)):
        extra = {"object_confidence": confidence}
        save_sequence(sequences[1], tmp_path / f"{name}.npz", extra=extra)
        scene = open_scene(sequences[1])
        scene = replace(
            scene, object_confidence=confidence_of(kept_arrays(tmp_path / f"{name}.npz"))
        )
        (tmp_path / f"{name}.html").write_text(page_html(scene), encoding="utf-8")
    (told,) = page_scene(tmp_path / "doubtful.html")["versions"]
    assert told["curves"]["confidence"] == [100, 100, 25, 100, 100, 100]
    for name in ("sure", "unseen"):  # a part that was never seen is not doubted in any frame
        assert "confidence" not in page_scene(tmp_path / f"{name}.html")["versions"][0]["curves"]


FILLED = torch.tensor([1, 0, 0, 0, 1, 1]).bool()


def test_a_page_has_the_notes_of_a_result_and_the_frames_that_were_filled_in(
    sequences, scene, tmp_path
):
    hand = replace(sequences[1].hands[0], joints=scene.versions[1].hands[0].joints)
    one = replace(sequences[1], hands=(hand,))
    result = replace(fake_cleaning.denoise(one, Options()), notes=("seen",), doubts=("odd", "seen"))
    hand = replace(result.hands["right"], filled=FILLED)
    page = view(replace(result, hands={"right": hand}), tmp_path / "a.html", before=one)
    assert page_scene(page)["filled"] == FILLED.int().tolist()
    assert re.findall("<li>(.*?)</li>", page.read_text("utf-8")) == [
        "odd",
        "seen",
        "right hand: a &lt;note&gt;",
        "right hand: 3 unobserved frames filled in, shaded behind the curves",
    ]
    save_sequence(one, tmp_path / "a.npz", extra=result.extra_arrays())
    assert kept_notes(kept_arrays(tmp_path / "a.npz")) == ("odd", "seen", "right hand: a <note>")


def test_a_page_has_what_was_assumed_when_the_input_was_read(tmp_path):
    fake_cleaning.write_clips(tmp_path, 1)
    with np.load(tmp_path / "clip0.npz") as file:
        arrays = {name: file[name] for name in file if name != "fps"}
    np.savez(tmp_path / "noisy.npz", **arrays)
    noisy = geneoh.load(tmp_path / "noisy.npz", obj=tmp_path / "clip0.obj")
    assumed = "30 frames a second assumed; --fps says otherwise"
    result = replace(fake_cleaning.denoise(noisy, Options()), doubts=("odd",))
    assert open_scene(result).notes == (assumed, "odd", "right hand: a <note>")
    save_sequence(result.sequence, tmp_path / "clean.npz", extra=result.extra_arrays())
    assert open_scene(tmp_path / "clean.npz").notes == open_scene(result).notes
    assert open_scene(tmp_path / "noisy.npz").notes == (assumed,)


@dataclass
class Made:
    """A result of a generator."""

    sequence: Sequence

    def extra_arrays(self) -> Arrays:
        return {"notes": np.array(["no such verb"])}


def test_a_page_has_the_notes_of_a_generator(sequences, tmp_path):
    page = view(Made(sequences[1]), tmp_path / "a.html")
    assert re.findall("<li>(.*?)</li>", page.read_text("utf-8")) == ["no such verb"]


def test_the_page_of_a_file_has_the_filled_frames_of_the_hands_that_it_shows(sequences, tmp_path):
    extra = {"right_filled": FILLED.numpy(), "left_filled": np.zeros(6, dtype=bool)}
    alone = replace(sequences[1], object=ObjectTrack.resting((), 6))
    save_sequence(alone, tmp_path / "two.npz", extra=extra)
    both, left = (open_scene(tmp_path / "two.npz", side=side) for side in (None, "left"))
    assert both.filled.tolist() == FILLED.tolist()
    assert len(both.notes) == 1
    assert not left.filled.any()
    assert left.notes == ()


@pytest.mark.parametrize("other", [np.array(["no"] * 6), np.zeros((6, 2), bool), np.zeros(5, bool)])
def test_what_is_no_mask_of_the_frames_is_not_taken_for_filled_ones(sequences, tmp_path, other):
    alone = replace(sequences[1], object=ObjectTrack.resting((), 6))
    save_sequence(alone, tmp_path / "two.npz", extra={"left_filled": other})
    assert open_scene(tmp_path / "two.npz").filled is None


@pytest.mark.parametrize("ending", [".html", ".png", ".glb"])
def test_hands_without_an_object_are_shown_alone(sequences, tmp_path, ending):
    before, after = (
        replace(each, object=ObjectTrack.resting((), each.frames)) for each in sequences
    )
    written = view(after, tmp_path / f"a{ending}", before=before if ending != ".glb" else None)
    if ending == ".html":
        shown = page_scene(written)
        assert shown["parts"] == []
        assert [list(version["curves"]) for version in shown["versions"]] == [["acceleration"]] * 2
        assert set(shown["versions"][0]["hands"][0]["ramps"]) == {"spread"}
    elif ending == ".png":
        with Image.open(written) as picture:
            assert len(picture.convert("RGB").getcolors(10**6)) > 50


def test_hands_at_an_object_whose_mesh_is_not_known_are_shown_alone(sequences, tmp_path):
    moving = replace(sequences[1].object, meshes=())
    shown = page_scene(view(replace(sequences[1], object=moving), tmp_path / "a.html"))
    assert shown["parts"] == []
    assert list(shown["versions"][0]["curves"]) == ["acceleration"]


def test_the_ending_names_the_format(sequences, tmp_path):
    written = view(sequences[1], str(tmp_path / "a.png"), frames=[0, 3], cell=64)
    with Image.open(written) as picture:
        assert picture.width == 2 * LEAST_COLUMN + 10


def test_without_a_path_a_page_is_opened_in_the_browser(sequences, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(view_module.webbrowser, "open", opened.append)
    monkeypatch.setattr(view_module.tempfile, "tempdir", str(tmp_path))
    written = view(sequences[1], title="my clip")
    assert written.parent == tmp_path
    assert [Path(url2pathname(urlparse(url).path)) for url in opened] == [written]
    assert page_scene(written)["frames"] == 6
    assert "<h1>my clip</h1>" in written.read_text("utf-8")


def test_a_sequence_without_hands_is_refused(sequences, tmp_path):
    with pytest.raises(InputError, match="one hand or one of each side, got none"):
        view(replace(sequences[1], hands=()), tmp_path / "strip.png")


def test_an_ending_of_no_format_is_refused_before_the_work(sequences, tmp_path):
    with pytest.raises(InputError, match=r"got '\.avi'"):
        view(sequences[1], tmp_path / "clip.avi")


def test_a_folder_without_mano_is_refused(sequences, tmp_path):
    with pytest.raises(MissingAssetError, match=r"MANO_RIGHT\.pkl: expected this file"):
        view(sequences[0], tmp_path / "page.html", mano_dir=tmp_path)


def test_a_hand_that_stands_in_for_manos_is_told(sequences, tmp_path, caplog):
    (right, left), words = sequences[1].hands, "its betas are MANO's, whose file is not there"
    shown = replace(sequences[1], hands=(replace(right, hand_model="mano"), left))
    right_file = trees.write_mano(tmp_path) / "MANO_RIGHT.pkl"
    (note,) = open_scene(shown).notes
    assert note.startswith(f"right hand: {words}")
    assert words in caplog.text
    assert open_scene(shown, mano_dir=tmp_path).notes == ()
    right_file.unlink()
    assert open_scene(shown, mano_dir=tmp_path).notes == (note,)
    assert open_scene(sequences[1]).notes == ()
    alone = replace(left, joints=None, betas=torch.ones(10), hand_model="mano")
    scene = open_scene(replace(sequences[1], hands=(alone,)))
    assert "our mean hand is shown in its pose, maybe centimetres off" in scene.notes[0]


@pytest.mark.parametrize("cell", [5, 4096])
def test_a_picture_of_an_impossible_size_is_refused(sequences, tmp_path, cell):
    with pytest.raises(ConfigError, match=f"'cell' must be 64 to 2048, got {cell}"):
        view(sequences[1], tmp_path / "a.png", cell=cell)


@pytest.mark.parametrize("choice", [{"up": "w"}, {"colouring": "red"}])
def test_a_choice_that_does_not_exist_is_refused(sequences, tmp_path, monkeypatch, choice):
    # users have no type checks, which would refuse it before we do
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    with pytest.raises(ConfigError, match=f"'{next(iter(choice))}' must be one of"):
        view(sequences[1], tmp_path / "a.png", **choice)


@pytest.mark.parametrize("name", ["a.npz", "a.html"])
def test_a_file_that_geneoh_did_not_write_stays(sequences, tmp_path, name):
    (tmp_path / name).write_bytes(b"mine")
    with pytest.raises(InputError, match="was not written by geneoh; delete it"):
        view(sequences[1], tmp_path / name)
    assert (tmp_path / name).read_bytes() == b"mine"


def test_a_mesh_beside_the_folder_of_meshes_stays(sequences, tmp_path):
    (tmp_path / "hand.obj").write_text("mine")
    assert view(sequences[1], tmp_path / "hand.obj").is_dir()
    assert (tmp_path / "hand.obj").read_text() == "mine"


def test_meshes_for_a_result_in_memory_would_be_ignored_and_are_refused(sequences, tmp_path):
    with pytest.raises(InputError, match="'obj' is for npz files, got a result in memory"):
        view(sequences[1], tmp_path / "a.png", obj=tmp_path / "other.obj")
    assert not (tmp_path / "a.png").exists()
