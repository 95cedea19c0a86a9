import socket
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import bodies
import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.viz.scene import make_scene
from geneoh.viz.serve import (
    SORT_MEASURES,
    VERSION_SPACING,
    Gallery,
    GalleryItem,
    gallery_items,
    in_words,
    sorted_by,
)
from geneoh.viz.view import open_scene

pytestmark = pytest.mark.usefixtures("few_directions")


def test_the_clip_that_sinks_deepest_comes_first(scene):
    clips = [
        GalleryItem(version.title, lambda: scene, version.measures.means())
        for version in reversed(scene.versions)
    ]
    assert [clip.name for clip in sorted_by(clips, "penetration_mean_mm")] == ["noisy", "clean"]


def test_a_clip_without_a_number_comes_last(scene):
    clips = [
        GalleryItem(name, lambda: scene, {"penetration_max_mm": value})
        for name, value in (("none", float("nan")), ("some", 1.0))
    ]
    assert [clip.name for clip in sorted_by(clips, "penetration_max_mm")] == ["some", "none"]


def test_of_hands_alone_nothing_is_known_of_depth_and_contact(scene):
    hands = Sequence(
        tuple(HandTrack(hand.side, hand.valid, hand.joints) for hand in scene.versions[0].hands),
        ObjectTrack.resting((), scene.frames),
        scene.fps,
    )
    measures = make_scene({"alone": hands}).versions[0].measures.means()
    assert in_words(measures["penetration_mean_mm"], 1) == "not known"
    assert in_words(measures["fingers_in_contact"], 1) == "not known"
    assert in_words(measures["acceleration_mm"], 1) == "0.0"  # they stand still


def test_the_input_and_the_mesh_are_found_beside_a_result(scene, tmp_path):
    for name in ("a.npz", "a_clean.npz", "a.obj"):
        (tmp_path / name).touch()
    asked = []

    def opened(*paths, obj):
        asked.append((*paths, obj))
        return scene

    (clip,), _ = gallery_items([tmp_path / "a_clean.npz"], (), opened)
    assert clip.name == "a_clean"
    expected = (tmp_path / "a_clean.npz", tmp_path / "a.npz", (tmp_path / "a.obj",))
    assert asked == [expected]


def test_results_of_one_name_are_told_apart(scene, tmp_path):
    """Equal lines of the list would both show the first."""
    paths = [tmp_path / folder / "clip_clean.npz" for folder in ("first", "second", "first")]
    items, _ = gallery_items(paths, (), lambda *_, **__: scene)
    assert [item.name for item in items] == ["first/clip_clean", "second/clip_clean"]


def test_results_that_cannot_be_opened_are_left_out_and_told(scene, tmp_path):
    def opened(path, *_, obj):
        if path.stem.startswith("bad"):
            raise InputError(f"{path.name} is damaged")
        return scene

    paths = [tmp_path / f"{name}.npz" for name in ("bad_1", "good", "bad_2")]
    items, left_out = gallery_items(paths, (), opened)
    assert [item.name for item in items] == ["good"]
    assert left_out == ["bad_1: bad_1.npz is damaged", "bad_2: bad_2.npz is damaged"]
    with pytest.raises(InputError, match=r"^bad_2.npz is damaged$"):
        gallery_items(paths[2:], (), opened)


def test_without_a_mesh_beside_it_a_result_is_opened_with_the_meshes_that_it_names(scene, tmp_path):
    asked = []

    def opened(*_, obj):
        asked.append(obj)
        return scene

    gallery_items([tmp_path / "b_clean.npz"], (), opened)
    assert asked == [()]


def test_the_gallery_shows_sorts_and_steps(scene):
    pytest.importorskip("viser", reason="the extra `view` is not installed")
    opened = []

    def open_one():
        opened.append(1)
        return scene

    clips = [
        GalleryItem(
            name,
            open_one,
            dict.fromkeys(SORT_MEASURES, value) | {"penetration_max_mm": -value},
        )
        for name, value in (("a", 1.0), ("b", 2.0))
    ]
    with warnings.catch_warnings():
        # what viser's own dependencies deprecate is not ours to mend
        warnings.simplefilter("ignore")
        gallery = Gallery(clips, up=None, port=free_port())
        try:
            assert gallery.shown.name == "b"
            gallery._step(1)
            assert gallery.shown.name == "a"
            gallery._sort.value = "penetration_max_mm"
            assert gallery.shown.name == "a"
            assert len(opened) == 3
        finally:
            gallery.stop()


def test_results_can_be_changed_while_one_is_played(scene):
    """viser's threads remove the shapes that the caller's thread moves."""
    pytest.importorskip("viser", reason="the extra `view` is not installed")
    clips = [GalleryItem(name, lambda: scene, dict.fromkeys(SORT_MEASURES, 1.0)) for name in "ab"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gallery = Gallery(clips, up=None, port=free_port())
        try:
            with ThreadPoolExecutor(1) as other:
                changes = other.submit(lambda: [gallery._step(1) for _ in range(8)])
                while not changes.done():
                    gallery._pose()
            changes.result()
        finally:
            gallery.stop()


def test_a_browser_looks_at_the_hands_wherever_they_are(track):
    """A browser looks at the world's origin by itself, from five metres."""
    pytest.importorskip("viser", reason="the extra `view` is not installed")
    away = replace(track, wrist=track.wrist + torch.tensor([90.0, 0.0, 0.0]))
    hands = Sequence((away,), ObjectTrack.resting((), track.frames), 30.0)
    scene = make_scene({"before": hands, "after": hands})
    client = SimpleNamespace(camera=SimpleNamespace(fov=1.3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        item = GalleryItem("far", lambda: scene, dict.fromkeys(SORT_MEASURES, 1.0))
        gallery = Gallery([item], up=None, port=free_port())
        gallery._look(client)
        gallery.stop()
    aside = client.camera.look_at - scene.versions[0].hands[0].joints[0].mean(0).numpy()
    assert np.linalg.norm(aside) == pytest.approx(VERSION_SPACING / 2, abs=0.01)
    assert 0.3 < np.linalg.norm(client.camera.position - client.camera.look_at) < 1


def test_a_body_stands_upright(tmp_path):
    pytest.importorskip("viser", reason="the extra `view` is not installed")
    file = bodies.hands_file(tmp_path / "hands.npz", bodies.recording(up="y"))
    items, _ = gallery_items([file], (), open_scene)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gallery = Gallery(items, up=None, port=free_port())
        gallery.stop()
    assert gallery._camera.axes[1, 1] > 0.9


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]
