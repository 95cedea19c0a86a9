"""Each source in its published layout gives back the sequence that it was made from."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from trees import CASES, Case, Scene, cameras, case_of, opened, scene, written

import geneoh
from geneoh.errors import InputError
from geneoh.readers.base import ReaderOptions
from geneoh.readers.checks.convention import contradictions
from geneoh.readers.convert import convert
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.recordings import source_named
from geneoh.readers.registry import SOURCES
from geneoh.sequence.sequence import HandTrack

MOVING_CAMERAS = ("hawor", "dynhamr", "video_to_data")
"""Sources whose world is not the camera's."""


def names(case: Case) -> str:
    return case.build.__name__


def close(actual: torch.Tensor, expected: np.ndarray, tolerance: float = 1e-5) -> None:
    wanted = torch.from_numpy(np.array(expected)).float()
    torch.testing.assert_close(actual, wanted, atol=tolerance, rtol=0)


def assert_hand(case: Case, hand: HandTrack, s: Scene) -> None:
    assert bool(hand.valid.all())
    if case.posed:
        close(hand.pose, s.pose[hand.side])
        close(hand.wrist, s.wrist[hand.side])
    if case.joints:
        there = [k for k in range(21) if k not in case.unknown]
        close(hand.joints[:, there], s.joints[hand.side][:, there])
        assert not case.unknown or bool((hand.confidence[:, case.unknown] == 0).all())
    if hand.betas is not None:
        close(hand.betas, s.betas[hand.side], 1e-3 if case.fitted else 1e-5)
        mended = hand.side == "right" or case.left == "mirrored"
        assert hand.hand_model == ("mano" if mended else "mano-as-shipped")


@pytest.mark.parametrize("case", CASES, ids=names)
def test_a_tree_in_the_published_layout_gives_the_sequence_back(case, tmp_path, mano_dir):
    s = scene(case.left)
    case.build(tmp_path, s, False)
    s = case.expected(s)
    recordings = case.read(tmp_path, mano_dir)
    sides = [hand.side for recording in recordings for hand in recording.sequence.hands]
    assert sorted(sides) == sorted(case.only)
    for recording in recordings:
        sequence = recording.sequence
        assert sequence.fps == pytest.approx(case.fps)
        for hand in sequence.hands:
            assert_hand(case, hand, s)
        if not case.object:
            continue
        close(sequence.object.rotation[:, 0], s.rotation)
        close(sequence.object.translation[:, 0], s.shift)
        assert sequence.object.rotation.shape[1] == len(sequence.object.meshes) == case.parts
        close(sequence.object.meshes[0].verts.sort(0).values, np.sort(s.verts, axis=0))
        if case.source.startswith("arctic"):
            close(sequence.object.rotation[:, 1], opened(s)[:, :3, :3])
        assert len(recording.mesh_names) == case.parts
    assert [words for recording in recordings for words in contradictions(recording)] == []


@pytest.mark.parametrize("case", CASES, ids=names)
def test_a_twin_in_the_wrong_convention_is_told_apart(case, tmp_path, mano_dir):
    root = tmp_path / "in"
    root.mkdir()
    case.write(root, wrong=True)
    source, known = source_named(case.source), ReaderOptions(mano_dir, **case.options(root))
    outcomes = list(convert(source, case.clips(root), tmp_path / "out", known, check=True))
    assert [outcome.problem for outcome in outcomes if outcome.problem] == []
    said = [words for outcome in outcomes for words in outcome.contradictions]
    assert case.caught in " ".join(said)
    assert not list((tmp_path / "out").rglob("*.npz"))


@pytest.mark.parametrize("source", ["dynhamr", "egoallo", "video_to_data"])
def test_a_source_without_its_name_is_told(source, tmp_path):
    case = case_of(source)
    case.write(tmp_path)
    (clip,) = case.clips(tmp_path)
    with pytest.raises(InputError, match=f"got no --from; pass --from {source}"):
        geneoh.load(clip.path)


def test_every_source_has_a_tree():
    assert {case.source for case in CASES} == set(SOURCES)


def test_every_source_is_in_the_table_for_users():
    page = Path(__file__).parents[2] / "docs/datasets.md"
    rows = [line.split("|")[1] for line in page.read_text().splitlines() if line.startswith("| `")]
    assert {name.strip(" `") for row in rows for name in row.split(",")} >= set(SOURCES)


@pytest.mark.parametrize("source", SOURCES.values(), ids=lambda source: source.name)
def test_every_source_has_a_reader(source):
    assert isinstance(source.reader(), DatasetReader)


@pytest.mark.parametrize("case", CASES, ids=names)
def test_estimators_that_know_their_camera_say_where_it_is(case, tmp_path, mano_dir):
    case.write(tmp_path)
    rays = [
        (hand.camera_ray, hand.wrist)
        for recording in case.read(tmp_path, mano_dir)
        for hand in recording.sequence.hands
    ]
    if case.source not in ("hamer", "arcticnet", *MOVING_CAMERAS):
        assert [ray for ray, _ in rays] == [None] * len(rays)
        return
    place = torch.tensor(cameras()[:, :3, 3], dtype=torch.float32)
    if case.source not in MOVING_CAMERAS:
        place = torch.zeros(1, 3)
    for ray, wrist in rays:
        torch.testing.assert_close(ray, torch.nn.functional.normalize(wrist - place, dim=-1))


def test_the_caller_and_a_file_of_landmarks_say_where_the_camera_is(tmp_path):
    written("landmarks", tmp_path)
    told = geneoh.read("landmarks", tmp_path / "hands.json", camera=(0.0, 0.0, -1.0))
    value = json.loads((tmp_path / "hands.json").read_text())
    (tmp_path / "hands.json").write_text(json.dumps({**value, "camera": [0, 0, -1]}))
    own = geneoh.read("landmarks", tmp_path / "hands.json")
    for hand, same in zip(told.hands, own.hands, strict=True):
        away = hand.joints[:, 0] - torch.tensor([0.0, 0.0, -1.0])
        torch.testing.assert_close(hand.camera_ray, torch.nn.functional.normalize(away, dim=-1))
        assert same.camera_ray.equal(hand.camera_ray)


@pytest.mark.parametrize(("files", "asked"), [("ho3d", "h2o3d"), ("h2o3d", "ho3d")])
def test_one_hand_and_two_of_one_group_are_told_apart(files, asked, tmp_path):
    written(files, tmp_path)
    with pytest.raises(InputError, match="choose ho3d for files of one hand, and h2o3d for those"):
        geneoh.read(asked, tmp_path / "train")
