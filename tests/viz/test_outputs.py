import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from geneoh.errors import InputError, MissingAssetError
from geneoh.files.outputs import is_ours
from geneoh.readers.npz.files import load
from geneoh.sequence.sequence import ObjectTrack
from geneoh.viz import video
from geneoh.viz.canvas import TITLE_HEIGHT, scale_width
from geneoh.viz.look import Look
from geneoh.viz.outputs import write
from geneoh.viz.scene import make_scene
from geneoh.viz.video import ffmpeg_path, film_frames

pytestmark = pytest.mark.usefixtures("few_directions")


@pytest.fixture(scope="module")
def one_hand(scene):
    versions = tuple(replace(version, hands=version.hands[:1]) for version in scene.versions)
    return replace(scene, versions=versions)


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_meshes_of_each_frame_are_those_that_were_seen(scene, tmp_path, kind):
    write(scene, tmp_path / f"clip.{kind}")
    folder = tmp_path / "clip"
    # the left hand is not there in the first frame
    assert len(list(folder.iterdir())) == 6 + 5 + 2 * 6
    hand = scene.versions[1].hands[0]
    mesh = trimesh.load_mesh(folder / f"right_0004.{kind}", process=False)
    np.testing.assert_allclose(mesh.vertices, hand.verts[4].numpy(), atol=1e-4)
    part = trimesh.load_mesh(folder / f"object2_0004.{kind}", process=False)
    np.testing.assert_allclose(part.vertices, scene.object_verts(1, 4).numpy(), atol=1e-4)


def test_a_folder_that_is_there_is_refused_and_kept(scene, tmp_path):
    (tmp_path / "clip").mkdir()
    with pytest.raises(InputError, match="expected a new folder"):
        write(scene, tmp_path / "clip.ply")
    assert list((tmp_path / "clip").iterdir()) == []


def test_smplx_parameters_read_back_as_the_same_hand(one_hand, tmp_path):
    write(one_hand, tmp_path / "clip.npz")
    read = load(tmp_path / "clip.npz").hands[0]
    hand = one_hand.versions[1].hands[0]
    np.testing.assert_allclose(read.pose, hand.pose, atol=1e-5)
    np.testing.assert_allclose(read.joints, hand.joints, atol=1e-6)
    np.testing.assert_allclose(read.wrist, hand.wrist, atol=1e-6)


def test_smplx_parameters_of_a_hand_alone_hold_no_object_and_are_ours(one_hand, tmp_path):
    alone = replace(one_hand, object=ObjectTrack.resting((), one_hand.frames))
    write(alone, tmp_path / "clip.npz")
    assert is_ours(tmp_path / "clip.npz")
    assert not load(tmp_path / "clip.npz").object.is_known


def test_two_hands_do_not_fit_the_smplx_names(scene, tmp_path):
    with pytest.raises(InputError, match="one hand, got 2; pass --side, or in Python replace"):
        write(scene, tmp_path / "clip.npz")


@pytest.mark.parametrize("name", ["clip.glb", "clip.npz", "clip.obj"])
def test_formats_without_colours_measure_no_distance(one_hand, tmp_path, name):
    """Distances take most of the time of a long clip."""

    def refuse(verts):
        raise AssertionError("the distance was measured")

    def unmeasured(version):
        return replace(version, hands=(replace(version.hands[0], distance_of=refuse),))

    hidden = replace(one_hand, versions=tuple(map(unmeasured, one_hand.versions)))
    with pytest.raises(AssertionError, match="was measured"):
        _ = hidden.versions[0].measures
    assert write(hidden, tmp_path / name).exists()


def test_a_film_has_all_frames_and_even_sides(scene):
    frames = list(film_frames(scene, cell=65))
    assert len(frames) == scene.frames
    assert all(side % 2 == 0 for side in frames[0].shape[:2])


def test_long_titles_of_a_film_keep_to_their_columns_and_show_their_end(scene):
    def titles(ending):
        first, second = (replace(v, title=f"{60 * 'x'}{ending}") for v in scene.versions)
        film = film_frames(replace(scene, versions=(first, second)), cell=240)
        return next(film)[:TITLE_HEIGHT]

    for part in np.split(titles("_clean"), 2, axis=1):
        assert (part[:, -8:] == part[0, 0]).all()
    assert (titles("_clean") != titles("_noisy")).any()


@pytest.mark.parametrize("colouring", ["penetration", "contact", "spread"])
def test_the_scale_of_a_film_of_one_version_is_whole(scene, colouring):
    alone = replace(scene, versions=scene.versions[:1])
    shown = next(film_frames(alone, Look(colouring=colouring), cell=64))
    assert shown.shape[1] % 2 == 0
    assert shown.shape[1] >= scale_width(colouring)


@pytest.mark.parametrize("name", ["film.mp4", "film.gif", "cup:1.mp4"])
def test_films_are_written_without_a_display(one_hand, tmp_path, monkeypatch, name):
    try:
        ffmpeg_path()
    except MissingAssetError as error:
        pytest.skip(str(error))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)  # ffmpeg takes what is before a colon for a protocol
    done = []
    write(one_hand, Path(name), on_step=lambda now, total: done.append((now, total)))
    assert (tmp_path / name).stat().st_size > 1000
    assert done[-1][0] == done[-1][1]
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert is_ours(tmp_path / name)
    read = [ffmpeg_path(), "-v", "error", "-i", str(tmp_path / name), "-f", "null", "-"]
    assert subprocess.run(read, capture_output=True, check=True).stderr == b""


def delays_of(gif: bytes) -> list[int]:
    """Delays of all pictures of a GIF in hundredths of a second."""
    mark = b"\x21\xf9\x04"  # a graphic control: flags, delay, transparent colour, end
    found = [place for place in range(len(gif)) if gif[place : place + 3] == mark]
    return [int.from_bytes(gif[p + 4 : p + 6], "little") for p in found if gif[p + 7] == 0]


@pytest.mark.parametrize(("frames", "fps"), [(5, 30.0), (6, 30.0), (6, 24.0), (5, 40.0), (6, 90.0)])
def test_a_gif_is_as_long_as_its_clip(sequences, tmp_path, frames, fps):
    try:
        ffmpeg_path()
    except MissingAssetError as error:
        pytest.skip(str(error))
    clip = replace(sequences[1][:frames], fps=fps)
    write(make_scene({"clip": clip}), tmp_path / "clip.gif")
    delays = delays_of((tmp_path / "clip.gif").read_bytes())
    assert sum(delays) == pytest.approx(100 * frames / fps, abs=1)


@pytest.mark.parametrize("name", ["a.html", "a.png", "a.glb", "a.npz"])
def test_what_was_written_is_known_as_ours(one_hand, tmp_path, name):
    write(one_hand, tmp_path / name)
    assert is_ours(tmp_path / name)


def test_an_unknown_ending_is_refused(scene, tmp_path):
    with pytest.raises(InputError, match=r"got '\.avi'"):
        write(scene, tmp_path / "clip.avi")


def test_a_place_that_cannot_be_written_to_is_named(scene, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write(scene, tmp_path / "none" / "clip.glb")


def test_a_film_without_ffmpeg_says_what_to_install(one_hand, tmp_path, monkeypatch):
    monkeypatch.setattr(video.shutil, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingAssetError, match="films need ffmpeg"):
        write(one_hand, tmp_path / "film.mp4")
    assert list(tmp_path.iterdir()) == []
