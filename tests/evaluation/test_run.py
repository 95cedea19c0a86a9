"""The loop: what is left to do, what goes wrong, and going on after a stop."""

from dataclasses import dataclass, replace

import pytest
import torch

from geneoh.errors import CheckpointError, ConfigError, InputError
from geneoh.evaluation.cases import Case
from geneoh.evaluation.methods import (
    BaselineRow,
    Cleaned,
    FilterRow,
    GeneohRow,
    InputRow,
    PredictionsRow,
)
from geneoh.evaluation.protocols import ProtocolOptions, find_cases
from geneoh.evaluation.records import RECORD, append_scores, digest, open_record
from geneoh.evaluation.run import page_of, run, tasks_of
from geneoh.evaluation.scores import Judge, Score
from geneoh.pipeline.denoise import Options

JUDGE = Judge(close_frames=2)
ROWS = (InputRow(), FilterRow("savgol", "keypoints"))
SETTINGS = {"code": "abc", "root": None}


@dataclass(frozen=True)
class Ready:
    """A case that is in memory."""

    case: Case
    damaged: bool = False

    @property
    def dataset(self) -> str:
        return self.case.dataset

    @property
    def clip(self) -> str:
        return self.case.clip

    @property
    def noise(self) -> str:
        return self.case.noise

    @property
    def seed(self) -> int:
        return self.case.seed

    def load(self) -> Case:
        if self.damaged:
            raise InputError("clip.npz: damaged; copy it again")
        return self.case


@dataclass(frozen=True)
class Failing:
    """A row that cannot clean anything."""

    name: str = "failing"

    def clean(self, case: Case) -> Cleaned:
        raise InputError(f"{case.clip}: no")


@pytest.fixture(scope="module")
def scores(noisy_case, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scores")
    open_record(folder, SETTINGS)
    return run(tasks_of([Ready(noisy_case)], ROWS, [], JUDGE), folder), folder


def test_a_run_scores_every_row_and_records_it(scores):
    made, folder = scores
    assert [score.row for score in made] == [row.name for row in ROWS]
    assert made[1].values["mpjpe_mm"] < made[0].values["mpjpe_mm"]
    assert open_record(folder, SETTINGS) == made


def test_what_has_a_score_is_not_done_again(scores, noisy_case):
    made, _ = scores
    case = Ready(noisy_case)
    assert tasks_of([case], ROWS, made, JUDGE) == []
    (left,) = tasks_of([case], ROWS, made[:1], JUDGE)
    assert left.rows == ROWS[1:]
    other = Ready(replace(noisy_case, seed=22))
    assert tasks_of([other], ROWS, made, JUDGE)[0].rows == ROWS


def test_predictions_are_always_scored_anew(scores, noisy_case, tmp_path):
    row = PredictionsRow(tmp_path)
    done = [Score("taco", "short", "gauss", 11, row.name)]
    (task,) = tasks_of([Ready(noisy_case)], (row,), done, JUDGE)
    assert task.rows == (row,)


def test_a_row_of_ours_is_done_again_where_its_page_is_missing(noisy_case, tmp_path):
    row = GeneohRow(Options())
    done = [Score("taco", "short", "gauss", 11, row.name)]
    case = Ready(noisy_case)
    assert tasks_of([case], (row,), done, JUDGE) == []
    assert tasks_of([case], (row,), done, JUDGE, tmp_path) != []
    page = page_of(tmp_path, done[0].key)
    assert page.name == "short_gauss_11_geneoh_default.html"
    page.touch()
    assert tasks_of([case], (row,), done, JUDGE, tmp_path) == []


def test_pages_are_left_by_our_rows(noisy_case, tmp_path):
    row = GeneohRow(Options(preset="fast"))
    open_record(tmp_path, SETTINGS)
    (task,) = tasks_of([Ready(noisy_case)], (row,), [], JUDGE, tmp_path / "pages")
    (score,) = run([task], tmp_path)
    assert page_of(tmp_path / "pages", score.key).read_text().startswith("<!doctype html>")


def test_a_row_that_fails_is_noted_and_the_others_go_on(noisy_case, tmp_path):
    open_record(tmp_path, SETTINGS)
    made = run(tasks_of([Ready(noisy_case)], (Failing(), InputRow()), [], JUDGE), tmp_path)
    assert [score.failed for score in made] == ["short: no", ""]
    assert made[0].values == {}
    assert made[1].values["mpjpe_mm"] > 0


def test_a_clip_that_cannot_be_read_is_noted_in_every_row(noisy_case, tmp_path):
    open_record(tmp_path, SETTINGS)
    made = run(tasks_of([Ready(noisy_case, damaged=True)], ROWS, [], JUDGE), tmp_path)
    assert [score.failed for score in made] == ["clip.npz: damaged; copy it again"] * 2


def test_weights_that_are_missing_stop_the_run(noisy_case, tmp_path):
    open_record(tmp_path, SETTINGS)
    rows = (InputRow(), BaselineRow("toch", tmp_path))
    with pytest.raises(CheckpointError, match=r"toch\.safetensors"):
        run(tasks_of([Ready(noisy_case)], rows, [], JUDGE), tmp_path)


def test_several_processes_give_the_scores_of_one(tmp_path):
    """Real cases, which each process draws for itself."""
    options = ProtocolOptions(frames=6)
    cases = find_cases("synthetic", limit=1, noises=["gauss", "drift"], seeds=[1], options=options)
    made = {}
    for jobs in (1, 2):
        folder = tmp_path / str(jobs)
        open_record(folder, SETTINGS)
        found = run(tasks_of(cases, ROWS, [], JUDGE), folder, jobs=jobs)
        made[jobs] = {score.key: replace(score, seconds=0.0) for score in found}
    assert len(made[1]) == 4
    assert made[1] == made[2]


def test_the_callers_threads_stay_as_they_were(noisy_case, tmp_path):
    before = torch.get_num_threads()
    open_record(tmp_path, SETTINGS)
    run(tasks_of([Ready(noisy_case, damaged=True)], ROWS, [], JUDGE), tmp_path)
    assert torch.get_num_threads() == before


def test_half_a_line_counts_for_nothing(tmp_path):
    scores = [Score("taco", "a", "gauss", seed, "input", {"mpjpe_mm": 1.0}) for seed in (1, 2)]
    open_record(tmp_path, SETTINGS)
    append_scores(tmp_path, scores)
    path = tmp_path / RECORD
    path.write_text(path.read_text()[:-30])
    assert open_record(tmp_path, SETTINGS) == scores[:1]
    append_scores(tmp_path, scores[1:])
    assert open_record(tmp_path, SETTINGS) == scores


def test_scores_of_other_settings_are_refused_until_thrown_away(tmp_path):
    open_record(tmp_path, SETTINGS)
    append_scores(tmp_path, [Score("taco", "a", "gauss", 1, "input")])
    with pytest.raises(ConfigError, match=r"other settings \(code\).*--fresh"):
        open_record(tmp_path, {**SETTINGS, "code": "xyz"})
    assert open_record(tmp_path, {**SETTINGS, "code": "xyz"}, fresh=True) == []


def test_a_place_that_cannot_be_written_to_is_told(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        open_record(tmp_path / "taken", SETTINGS)


def test_a_digest_tells_contents_and_not_order(tmp_path):
    for name, text in (("a", "1"), ("b", "2")):
        (tmp_path / name).write_text(text)
    paths = [tmp_path / "a", tmp_path / "b"]
    first = digest(paths)
    assert digest(reversed(paths)) == first
    (tmp_path / "b").write_text("3")
    assert digest(paths) != first
