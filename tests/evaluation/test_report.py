"""What an evaluation leaves behind."""

import csv
import json
from dataclasses import replace

import pytest

from geneoh.evaluation import plots, report
from geneoh.evaluation.report import Evaluation, write_report
from geneoh.evaluation.scores import COLUMNS, MEASURES, Score

METHODS = ("input", "best filter on keypoints, told the truth †", "geneoh default")
NUMBERS = {measure.key: 10.0 for measure in MEASURES}


def made(**changes) -> Evaluation:
    scores = [
        Score(
            *("taco", clip, noise, seed, method),
            values=NUMBERS | {"mpjpe_mm": 20.0 / (place + 1) + seed / 100},
            error_by_frame_mm=[20.0, None, 10.0],
            error_by_joint_mm=[float(joint) for joint in range(21)],
            seconds=0.5,
        )
        for noise in ("gauss", "beta")
        for clip in ("a", "b")
        for seed in (11, 22)
        for place, method in enumerate(METHODS)
    ]
    scores.append(Score("taco", "c", "gauss", 11, "input", failed="c.npz: damaged <again>"))
    settings = {"versions": {"geneoh": "0.1.0"}, "weights": {"motion": "abcd"}}
    given = {"settings": settings, "command": "geneoh eval --dataset taco", "methods": METHODS}
    return Evaluation(**(given | {"scores": tuple(scores)} | changes))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_report(made(notes=("said besides",), pages=(("clip <a>", "pages/a#1.html"),)), folder)
    return folder


def test_the_meshes_of_keypoints_may_be_of_manos_hand():
    (note,) = (words for words in made().remarks() if "fitted to them" in words)
    assert "the hand of --hand, by default ours" in note


def test_the_csv_has_a_line_for_each_score(folder):
    with (folder / "scores.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 25
    assert rows[0]["method"] == "input"
    assert float(rows[0]["mpjpe_mm"]) == pytest.approx(20.11)
    assert rows[-1]["failed"] == "c.npz: damaged <again>"
    assert rows[-1]["depth_mm"] == ""


def test_the_json_holds_what_is_needed_to_repeat(folder):
    whole = json.loads((folder / "evaluation.json").read_text())
    assert whole["command"] == "geneoh eval --dataset taco"
    assert whole["settings"]["weights"] == {"motion": "abcd"}
    assert {score["seed"] for score in whole["scores"]} == {11, 22}
    table = next(table for table in whole["tables"] if table["noise"] == "beta")
    cell = table["cells"]["geneoh default"]["mpjpe_mm"]
    assert cell["mean"] == pytest.approx(20 / 3 + 0.165)
    assert cell["deviation"] == pytest.approx(0.11 / 2**0.5)


def test_the_markdown_is_a_table_with_what_made_it(folder):
    text = (folder / "report.md").read_text()
    assert "`geneoh eval --dataset taco`" in text
    assert "| taco, gauss | input (1 failed) |" in text
    assert "motion weights abcd" in text
    assert "- said besides" in text
    assert "1.00 (1: the same order" in text


def test_lines_are_told_only_where_the_bars_have_them(tmp_path):
    once = tuple(score for score in made().scores if score.seed == 11)
    for scores, told in ((made().scores, True), (once, False)):
        write_report(made(scores=scores), tmp_path)
        for name in ("report.md", "report.html"):
            assert ("deviation over" in (tmp_path / name).read_text()) is told


def test_a_reason_that_methods_share_is_told_once():
    why = "c.npz: damaged; copy it again"
    lost = [Score("taco", "c", "gauss", 11, method, failed=why) for method in METHODS]
    own = [Score("taco", f"{n}", "gauss", 11, "input", failed=f"{n}: no") for n in range(9)]
    remarks = list(made(scores=(*made().scores[:-1], *lost, *own)).remarks())
    assert [remark for remark in remarks if why in remark] == [f"{', '.join(METHODS)}: {why}"]
    assert sum(remark.endswith(": no") for remark in remarks) == report.REASONS - 1


def test_every_column_is_explained_below_the_tables(folder):
    text = (folder / "report.md").read_text("utf-8")
    for measure in COLUMNS:
        assert f"- {measure.title}: {measure.meaning}; {measure.better} is better." in text
    assert "- MPJPE: mean distance of the keypoints to the truth; less is better." in text


def test_the_page_stands_alone_and_has_every_plot(folder):
    text = (folder / "report.html").read_text()
    assert text.count("<svg") == 2 + 2 * 3
    for word in ("src=", "url(http", "<script", "@import"):
        assert word not in text
    assert "c.npz: damaged &lt;again&gt;" in text
    assert '<a href="pages/a%231.html">clip &lt;a&gt;</a>' in text
    assert "above the line" in text


def test_few_recordings_get_no_intervals_and_many_do():
    few, many = made(), [score for number in range(8) for score in renamed(f"clip_{number}")]
    assert "over seeds of the mean over 3 recordings, too few for intervals" in words_of(few)
    assert "95%" not in words_of(few) + report.as_page(few)
    assert "95% intervals over 8 recordings" in words_of(made(scores=tuple(many)))


def renamed(clip: str) -> list[Score]:
    return [replace(score, clip=clip) for score in made().scores if score.clip == "a"]


def words_of(evaluation: Evaluation) -> str:
    return " ".join(evaluation.remarks())


def test_equal_scores_give_equal_files(folder, tmp_path):
    again = made(notes=("said besides",), pages=(("clip <a>", "pages/a#1.html"),))
    for path in write_report(again, tmp_path):
        assert path.read_bytes() == (folder / path.name).read_bytes()


def test_without_the_extra_the_page_says_how_to_get_plots(tmp_path, monkeypatch):
    monkeypatch.setattr(plots, "available", lambda: False)
    write_report(made(), str(tmp_path))
    text = (tmp_path / "report.html").read_text()
    assert "<svg" not in text
    assert "geneoh[plots]" in text


def test_real_noise_without_truth_is_reported_by_plausibility(tmp_path):
    scores = [Score("hoi4d", "a", "recorded", 11, "input", {"depth_mm": 2.0})]
    write_report(made(scores=tuple(scores)), tmp_path)
    text = (tmp_path / "report.html").read_text()
    assert "depth" in text
    assert "MPJPE" not in text
    assert text.count("<svg") == 1


def test_means_of_columns_leave_out_what_is_missing():
    means = plots.column_means([[1.0, None, 3.0], [3.0, None]])
    assert means[0] == 2.0
    assert means[1] != means[1]
    assert means[2] == 3.0
