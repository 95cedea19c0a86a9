"""Scores of twins against the recording."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

import geneoh
from geneoh.errors import InputError
from geneoh.evaluation.compare import Twin, compare, drawn_twins, stored_twins, table
from geneoh.sequence.files import save_sequence

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def clean():
    return geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")


def test_recording_against_itself_has_no_error_and_its_own_plausibility(clean):
    scores = compare(clean, [Twin("clean", 0, clean)], [])
    by_row = {score.row: score for score in scores}
    assert by_row["input"].mpjpe_mm == 0
    assert 1.5 < by_row["input"].penetration_mm < 4
    assert 7 < by_row["input"].acceleration_mm < 9
    assert by_row["best filter on keypoints"].acceleration_mm < by_row["input"].acceleration_mm


def test_drawn_twins_are_the_same_for_the_same_seed(clean):
    a, b = (list(drawn_twins(clean, ["gauss"], 2)) for _ in range(2))
    assert torch.equal(a[1].sequence.hands[0].joints, b[1].sequence.hands[0].joints)
    assert not torch.equal(a[0].sequence.hands[0].joints, a[1].sequence.hands[0].joints)


def test_stored_twins_must_have_the_recordings_frames(clean, tmp_path):
    save_sequence(clean, tmp_path / "gauss_0.npz")
    assert next(stored_twins(clean, tmp_path, ["gauss"], 1)).sequence.frames == clean.frames
    hand = clean.hands[0]
    short = replace(
        clean,
        hands=(replace(hand, valid=hand.valid[:9], joints=hand.joints[:9], pose=None, wrist=None),),
        object=replace(
            clean.object,
            rotation=clean.object.rotation[:9],
            translation=clean.object.translation[:9],
        ),
    )
    save_sequence(short, tmp_path / "gauss_0.npz")
    with pytest.raises(InputError, match="146"):
        next(stored_twins(clean, tmp_path, ["gauss"], 1))


def test_table_has_a_line_per_noise_and_row(clean):
    scores = compare(clean, [Twin("clean", 0, clean)], [])
    lines = table(scores)
    assert len(lines) == 1 + 3
    assert "MPJPE" in lines[0]
