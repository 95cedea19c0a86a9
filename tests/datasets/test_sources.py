"""Each source in its published layout gives back the sequence that it was made from."""

import numpy as np
import pytest
import torch
from trees import CASES, Case, Scene, opened, scene

from geneoh.datasets.base import Known, Recording
from geneoh.datasets.catalogue import SOURCES
from geneoh.datasets.convert import find_clips, read_clip, source_named
from geneoh.datasets.selftest import contradictions
from geneoh.sequence.tracks import HandTrack


def read(case: Case, root, mano_dir) -> list[Recording]:
    source = source_named(case.source)
    said = {
        name: root / value if name in ("objects", "body") else value for name, value in case.known
    }
    known = Known(mano_dir=mano_dir, **said)
    clips = find_clips(source, [root / case.start])
    return [recording for clip in clips for recording in read_clip(source, clip, known)]


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
    recordings = read(case, tmp_path, mano_dir)
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
    case.build(tmp_path, scene(case.left), True)
    recordings = read(case, tmp_path, mano_dir)
    said = [words for recording in recordings for words in contradictions(recording)]
    assert case.caught in " ".join(said)


def test_every_source_has_a_tree():
    assert {case.source for case in CASES} == set(SOURCES)
