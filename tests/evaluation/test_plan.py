"""From what a user asks to cases, rows and settings, and all the way to a report's scores."""

from dataclasses import replace
from pathlib import Path

import pytest

from geneoh.baselines.library import SHIPPED as BASELINES_SHIPPED
from geneoh.baselines.library import baseline_weights
from geneoh.denoisers.library import weights_of
from geneoh.errors import ConfigError, MissingAssetError
from geneoh.evaluation.external_results import StoredTwin, write_inputs
from geneoh.evaluation.methods import GeneohRow
from geneoh.evaluation.plan import (
    Choices,
    cases_of,
    cores,
    evaluate,
    rows_of,
    settings_of,
)
from geneoh.evaluation.protocols import ProtocolOptions
from geneoh.pipeline.denoise import Options

SMALL = Choices(
    "synthetic",
    noises=("gauss",),
    limit=1,
    rows=("input", "savgol"),
    protocol=ProtocolOptions(frames=6),
    close_frames=2,
)


def names(choices):
    return [row.name for row in rows_of(choices)[0]]


def test_every_row_of_the_paper_and_of_a_sceptic_can_be_asked_for():
    choices = replace(SMALL, rows=("input", "gaussian", "best-filter", "optimisation", "geneoh"))
    choices = replace(choices, presets=("default", "fast"), ablations=("motion", "fit"))
    assert names(choices) == [
        "input",
        "Gaussian on keypoints",
        "Gaussian on parameters",
        "best filter on keypoints, told the truth †",
        "best filter on parameters, told the truth †",
        "optimisation only",
        "geneoh default",
        "geneoh fast",
        "geneoh default, w/o motion",
        "geneoh default, w/o fit",
    ]


def test_baselines_without_weights_stay_out_and_are_told(monkeypatch, tmp_path):
    monkeypatch.setattr("geneoh.baselines.library.SHIPPED", tmp_path)
    rows, notes = rows_of(replace(SMALL, rows=()))
    assert [row.name for row in rows][-1] == "geneoh default"
    assert len(rows) == 7
    assert [note.split(":")[0] for note in notes] == ["no row toch", "no row regression"]
    assert "geneoh train --stage toch" in notes[0]
    assert len(rows_of(replace(SMALL, rows=("toch",)))[0]) == 1  # asked for by name, it must fail


def test_baselines_come_from_the_users_folder_where_they_are_there(tmp_path):
    assert baseline_weights("toch", tmp_path) == BASELINES_SHIPPED / "toch.safetensors"
    (tmp_path / "toch.safetensors").touch()
    assert baseline_weights("toch", tmp_path) == tmp_path / "toch.safetensors"
    assert weights_of("motion", tmp_path) == tmp_path / "motion.safetensors"


def test_options_reach_every_row_of_ours():
    options = Options(samples=7, selection="closest")
    rows, _ = rows_of(replace(SMALL, rows=("geneoh",), ablations=("spatial",), options=options))
    assert all(isinstance(row, GeneohRow) and row.options.samples == 7 for row in rows)
    assert rows[1].options.without == ("spatial",)


def test_a_folder_of_predictions_must_be_there_and_have_a_name_of_its_own(tmp_path):
    with pytest.raises(MissingAssetError, match="nowhere: expected a folder"):
        rows_of(replace(SMALL, predictions=(Path("nowhere"),)))
    with pytest.raises(ConfigError, match="more than once"):
        rows_of(replace(SMALL, predictions=(tmp_path, tmp_path)))


def test_settings_change_with_all_that_changes_scores(tmp_path):
    first = settings_of(SMALL)
    assert settings_of(replace(SMALL, limit=5, rows=())) == first
    for other in (
        replace(SMALL, close_frames=3),
        replace(SMALL, protocol=ProtocolOptions(frames=7)),
        replace(SMALL, options=Options(samples=2)),
        replace(SMALL, options=Options(weights=tmp_path)),
    ):
        assert settings_of(other) != first


def test_seeds_are_the_papers_but_for_many_clips():
    assert {case.seed for case in cases_of(replace(SMALL, dataset="taco"))} == {11, 22, 77}
    assert {case.seed for case in cases_of(SMALL)} == {11}
    assert {case.seed for case in cases_of(replace(SMALL, seeds=(1, 2)))} == {1, 2}


def test_inputs_written_for_others_score_as_the_input_and_can_be_read_back(tmp_path):
    """What is left untouched must have the input's row exactly, and a truth no error at all."""
    count = write_inputs(cases_of(SMALL), tmp_path / "same")
    clean = replace(SMALL, noises=("clean",))
    assert (count, write_inputs(cases_of(clean), tmp_path / "truth")) == (1, 1)
    (name,) = (path.name for path in (tmp_path / "same").glob("*.npz"))
    (tmp_path / "truth" / name.replace("gauss", "clean")).rename(tmp_path / "truth" / name)
    given = (tmp_path / "same", tmp_path / "truth")
    assert len(list((tmp_path / "same" / "objects").glob("*.obj"))) == 1
    asked = replace(SMALL, rows=("input",), predictions=given)
    made = evaluate(asked, tmp_path / "out", command="geneoh eval")
    plain, same, truth = made.scores
    assert same.values == plain.values
    assert truth.values["mpjpe_mm"] == pytest.approx(0, abs=1e-3)
    assert plain.values["mpjpe_mm"] > 5
    twin = StoredTwin(cases_of(SMALL)[0], tmp_path / "truth").load()
    assert (twin.noisy.hands[0].joints - twin.clean.hands[0].joints).abs().max() < 1e-6


def test_a_twin_that_is_not_there_is_told(tmp_path):
    with pytest.raises(MissingAssetError, match=r"expected .*_gauss_11\.npz or gauss_11\.npz"):
        StoredTwin(cases_of(SMALL)[0], tmp_path).load()


def test_an_evaluation_goes_on_and_says_so(tmp_path):
    heard = []
    first = evaluate(SMALL, tmp_path, on_progress=lambda *now: heard.append(now))
    assert heard == [(3, 3)]
    assert [score.row for score in first.scores] == list(first.rows)
    again = evaluate(replace(SMALL, rows=("input",)), tmp_path)
    assert again.scores == first.scores[:1]
    assert "1 of 1 scores were there already" in again.notes


def test_there_is_a_core_to_work_on():
    assert cores() >= 1
