import pytest

from geneoh.errors import InputError
from geneoh.viz.serve import Clip, find_clips, measured, sorted_by


def test_the_clip_that_sinks_deepest_comes_first(scene):
    clips = [Clip(take.title, lambda: scene, measured(take)) for take in reversed(scene.takes)]
    assert [clip.name for clip in sorted_by(clips, "penetration_mm")] == ["noisy", "clean"]
    assert [clip.name for clip in sorted_by(clips, "penetration_mm", largest_first=False)] == [
        "clean",
        "noisy",
    ]


def test_a_clip_without_a_number_comes_last_either_way(scene):
    clips = [
        Clip(name, lambda: scene, {"deepest_mm": value})
        for name, value in (("none", float("nan")), ("some", 1.0))
    ]
    for first in (True, False):
        assert sorted_by(clips, "deepest_mm", largest_first=first)[-1].name == "none"


def test_the_input_and_the_mesh_are_found_beside_a_result(scene, tmp_path):
    for name in ("a.npz", "a_clean.npz", "a.obj"):
        (tmp_path / name).touch()
    asked = []

    def opened(*paths):
        asked.append(paths)
        return scene

    (clip,) = find_clips([tmp_path / "a_clean.npz"], (), opened)
    assert clip.name == "a_clean"
    expected = (tmp_path / "a_clean.npz", tmp_path / "a.npz", (tmp_path / "a.obj",))
    assert asked == [expected]


def test_a_result_without_a_mesh_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"expected a mesh b\.obj beside it"):
        find_clips([tmp_path / "b_clean.npz"], (), lambda *_: None)
