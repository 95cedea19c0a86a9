"""Which clips a batch has: files, folders, globs, manifests, sources."""

import json

import fake_cleaning
import pytest
from bad_inputs import good_arrays

from geneoh.batch.cleaning import BatchOptions, clean_clip
from geneoh.batch.clips import find_batch_clips
from geneoh.errors import ConfigError, InputError


@pytest.fixture
def found(tmp_path, monkeypatch):
    """Names and paths of the clips of some inputs."""
    monkeypatch.chdir(tmp_path)
    fake_cleaning.write_clips(tmp_path / "in", 2)
    fake_cleaning.write_clips(tmp_path / "in/more", 1)

    def names(*inputs, source=None, meshes=()):
        clips = find_batch_clips(
            [tmp_path / each for each in inputs], source, tmp_path / "out", meshes
        )
        return {clip.name: clip for clip in clips}

    return names


def manifest(folder, *lines):
    """A manifest in a folder."""
    (folder / "list.csv").write_text("\n".join(lines) + "\n")
    return "list.csv"


def test_a_folder_a_glob_and_files_name_the_same_clips_once(found, tmp_path):
    assert list(found("in")) == ["clip0", "clip1", "more/clip0"]
    assert list(found("in/*.npz")) == ["clip0", "clip1"]
    assert list(found("in/**/clip0.npz")) == ["in/clip0", "more/clip0"]
    assert list(found("in", "in/clip1.npz")) == ["clip0", "clip1", "more/clip0"]
    assert list(found("in/clip1.npz", "in/more/clip0.npz")) == ["clip1", "clip0"]


def test_results_are_no_inputs(found, tmp_path):
    fake_cleaning.write_clips(tmp_path / "out", 3)
    assert list(found(".")) == ["in/clip0", "in/clip1", "in/more/clip0"]


@pytest.mark.parametrize("way", ["in/../out", "link"])
def test_results_are_no_inputs_by_any_way_to_their_folder(found, tmp_path, way):
    fake_cleaning.write_clips(tmp_path / "out", 3)
    (tmp_path / "link").symlink_to(tmp_path / "out")
    clips = find_batch_clips([tmp_path], None, tmp_path / way)
    assert [clip.name for clip in clips] == ["in/clip0", "in/clip1", "in/more/clip0"]


@pytest.mark.parametrize("given", [("*/*.npz",), ("in/clip0.npz", "out/clip0.npz")])
def test_results_are_no_inputs_of_a_run_that_is_started_again(found, tmp_path, given):
    (tmp_path / "in/clip1.npz").unlink()
    first = list(found(*given[:1]))
    assert first == ["clip0"]
    fake_cleaning.write_clips(tmp_path / "out", 1)
    lines = ({"options": {}, "weights": {}}, {"clip": "clip0", "files": {"clip0.npz": "1 a"}})
    (tmp_path / "out/journal.jsonl").write_text("".join(f"{json.dumps(x)}\n" for x in lines))
    assert list(found(*given)) == first
    assert list(found("*")) == ["clip0", "more/clip0"]


def test_inputs_above_the_folder_for_results_are_found_from_within_it(found, tmp_path):
    (tmp_path / "out").mkdir()
    clips = find_batch_clips([tmp_path / "out/../in"], None, tmp_path / "out")
    assert [clip.name for clip in clips] == ["clip0", "clip1", "more/clip0"]


def test_a_folder_that_is_also_for_the_results_is_refused_as_such(found, tmp_path):
    with pytest.raises(InputError, match="outside of folders for results, got 3 within them"):
        find_batch_clips([tmp_path / "in"], None, tmp_path / "in")


def test_results_of_an_earlier_run_in_another_folder_are_no_inputs(found, tmp_path, caplog):
    """They were cleaned once more, beside what they were made of."""
    fake_cleaning.write_clips(tmp_path / "in/clean/more", 2)
    (tmp_path / "in/clean/journal.jsonl").write_text('{"options": {}, "weights": {}}\n')
    assert list(found("in")) == ["clip0", "clip1", "more/clip0"]
    assert "in: 2 results of earlier runs left out" in caplog.text
    assert list(found("in/clean")) == ["more/clip0", "more/clip1"]
    assert list(found("in/clean/more/*.npz")) == ["clip0", "clip1"]


def test_the_mesh_of_a_clip_is_the_one_asked_for_else_the_one_beside_it(found, tmp_path):
    mesh = tmp_path / "in" / "clip1.obj"
    assert found("in")["clip1"].meshes == (mesh,)
    assert found("in", meshes=(tmp_path / "all.ply",))["clip0"].meshes == (tmp_path / "all.ply",)
    mesh.unlink()
    assert found("in")["clip1"].meshes == ()


def test_inputs_that_hold_no_clip_are_refused(found, tmp_path):
    (tmp_path / "empty").mkdir()
    for given, words in (
        ("nothing.npz", "no such file"),
        ("no*.npz", "no file or folder has such a name"),
        ("empty", "found none; name the source"),
    ):
        with pytest.raises(InputError, match=words):
            found(given)


def test_a_manifest_says_of_each_clip_what_differs(found, tmp_path):
    rows = (
        "input, name, meshes, source, options",
        "in/clip0.npz,,,,",
        "in/clip0.npz, again, in/clip1.obj; in/clip0.obj,, seed=3; preset=fast; side=left",
        'in/more/clip0.npz,third,,,"camera=[0, 0, 1]"',
    )
    first, again, third = found(manifest(tmp_path, *rows)).values()
    assert (first.name, first.meshes) == ("clip0", (tmp_path / "in/clip0.obj",))
    assert again.meshes == (tmp_path / "in/clip1.obj", tmp_path / "in/clip0.obj")
    assert (again.settings, again.reading) == ({"seed": 3, "preset": "fast"}, {"side": "left"})
    assert (third.name, third.reading) == ("third", {"camera": [0, 0, 1]})
    assert all(json.loads(json.dumps(c.described())) == c.described() for c in (first, again))


def test_names_in_a_manifest_are_kept(found, tmp_path):
    """One of two for the same work was lost in silence, and one that is a file's was changed."""
    rows = ("input,name", "in/clip0.npz,one", "in/clip0.npz,two", "in/clip0.npz,clip1.npz")
    clips = found(manifest(tmp_path, *rows, "in/clip1.npz,", "in/clip0.npz,"), "in/more/clip0.npz")
    assert list(clips) == ["one", "two", "clip1", "in/clip1", "clip0"]
    assert clips["clip0"].path.parent.name == "more"


def test_a_file_is_one_clip_however_its_path_is_written(found, tmp_path):
    rows = ("input", "in/clip0.npz", "in/more/../clip0.npz", str(tmp_path / "in/clip0.npz"))
    assert list(found(manifest(tmp_path, *rows), "in/../in")) == ["clip0", "clip1", "more/clip0"]


@pytest.mark.parametrize(
    ("said", "camera"), [("ORIGIN", (0, 0, 0)), ("-0.5,1,2e-1", (-0.5, 1, 0.2))]
)
def test_a_manifest_names_a_camera_as_the_command_line_does(found, tmp_path, said, camera):
    (clip,) = found(manifest(tmp_path, "input,options", f'in/clip0.npz,"camera={said}"')).values()
    assert clip.reading == {"camera": camera}


@pytest.mark.parametrize(
    "heading", ["name,input", '"name","input"', '\ufeff"name", input', "Name,INPUT,,"]
)
def test_the_columns_of_a_manifest_may_be_quoted_and_in_any_order(found, tmp_path, heading):
    assert list(found(manifest(tmp_path, heading, "first,in/clip0.npz"))) == ["first"]


@pytest.mark.parametrize("separator", [";", "\t", ","])
def test_a_manifest_may_be_as_excel_saves_it(found, tmp_path, separator):
    rows = ("input,options", 'in/clip0.npz,"seed=3; side=left"', ",")
    (clip,) = found(manifest(tmp_path, *(row.replace(",", separator) for row in rows))).values()
    assert (clip.settings, clip.reading) == ({"seed": 3}, {"side": "left"})


def test_a_manifest_that_cannot_be_meant_is_refused(found, tmp_path):
    for rows, words in (
        (("inputs,meshes", "in/clip0.npz,"), "'inputs' is no column.*did you mean 'input'"),
        (("name,meshes", "one,in/clip0.obj"), "needs the column 'input', got name, meshes; add it"),
        (("input,mesh", "in/clip0.npz,"), "'mesh' is no column.*did you mean 'meshes'"),
        (
            ("input,options", "in/clip0.npz,presett=fast"),
            "line 2: 'presett' is no option.*'preset'",
        ),
        (("input,options", "in/clip0.npz,seed"), "line 2: expected NAME=VALUE.* got 'seed'"),
        (("input,name", "in/clip0.npz,x/"), "line 2: 'name' must be the name of a file, got 'x/'"),
        (("input,input", "in/clip0.npz,in/clip1.npz"), "each column once"),
        (("name,options", "in/clip0.npz,"), "needs the column 'input', got name, options; add it"),
        (("file,mesh", "in/clip0.npz,"), "'file' is no column of a manifest; there are input"),
        (("in/clip0.npz",), "'in/clip0.npz' is no column of a manifest"),
        ((), "needs the column 'input', got none; add it"),
        (("input,name",), "lists no clip"),
        (("input,name", "in/clip0.npz"), r"line 2: expected 2 values .* got 1"),
        (("input,source", "in/clip0.npz,grob"), "source grob: expected one of"),
        (("input,name", "in/clip0.npz,../../x"), "expected a name within"),
        (("input,name", "in/clip0.npz,x", "in/clip1.npz,./x"), r"'\./x': is the file of 'x' too"),
        (("input,name", "in,one"), "'name' is for one clip, got 3"),
        (("input,options", "in/clip0.npz,seed=1", "in/clip0.npz,seed=2"), "both called clip0;"),
        (("input,options", "in/clip0.npz,camera=here"), "line 2: camera: expected three numbers"),
        (("input,options", "in/clip0.npz,focal=1200"), "line 2: the option 'focal' needs a source"),
        (
            ("input,name", "in/clip0.npz,one", "in/clip1.npz,one"),
            "line 3: 'name' must be another one in each line, got 'one' in line 2 too",
        ),
    ):
        with pytest.raises((InputError, ConfigError), match=words):
            found(manifest(tmp_path, *rows))


@pytest.mark.parametrize("heading", ["frame,LeftIndexTipPosX", "joint,x,y,z", "0.1,0.2,0.3"])
def test_a_table_of_points_is_no_manifest(found, tmp_path, heading):
    assert list(found(manifest(tmp_path, heading, "1,2"))) == ["list"]


def test_a_file_of_a_manifest_that_is_missing_fails_as_a_clip(found, tmp_path):
    rows = ("input", "in/clip0.npz", "in/gone.npz")
    there, gone = found(manifest(tmp_path, *rows)).values()
    assert there.problem == ""
    outcome = clean_clip(gone, BatchOptions(tmp_path / "out"))
    assert outcome.clip == "gone"
    assert outcome.failed == f"{tmp_path / 'in/gone.npz'}: no such file or folder; check the path"


def test_the_clips_of_a_source_are_found_and_read(found, tmp_path, monkeypatch):
    (tmp_path / "hands").mkdir()
    frames = [{"points": points} for points in good_arrays()["joints"].tolist()]
    value = {"format": "geneoh-landmarks", "version": 1, "order": "openpose", "fps": 30}
    for name in ("a", "b"):
        text = json.dumps({**value, "hands": {"right": frames}})
        (tmp_path / "hands" / f"{name}.json").write_text(text)
    rows = ("input,source", "hands,landmarks")
    for clips in (found("hands", source="landmarks"), found(manifest(tmp_path, *rows))):
        assert list(clips) == ["a", "b"]
        assert {clip.source for clip in clips.values()} == {"landmarks"}
    monkeypatch.setattr("geneoh.batch.cleaning.denoise", fake_cleaning.denoise)
    outcome = clean_clip(clips["b"], BatchOptions(tmp_path / "out"))
    assert outcome.failed == ""
    assert list(outcome.files) == ["b.npz"]
    assert (tmp_path / "out" / "b.npz").is_file()
