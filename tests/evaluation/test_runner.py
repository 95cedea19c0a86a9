"""The runner: what is left to do, what goes wrong, and going on after a stop."""

import importlib
import json
from dataclasses import asdict, replace
from functools import partial

import pytest
import torch
from short_clips import short_clip

import geneoh
from geneoh.denoisers.library import stage_weights
from geneoh.errors import CheckpointError, ConfigError, InputError
from geneoh.evaluation import report
from geneoh.evaluation.cases import Case, find_cases, write_inputs
from geneoh.evaluation.methods import (
    Method,
    filtered_hand,
    geneoh_method,
    methods_of,
    predicted_hand,
    unchanged,
)
from geneoh.evaluation.options import EvaluationOptions, ProtocolOptions
from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.runner import (
    evaluate,
    open_record,
    page_of,
    run,
    settings_of,
    work_left,
)
from geneoh.evaluation.scores import Score
from geneoh.files.fingerprints import PACKAGES
from geneoh.files.journal import SCORED, append_journal
from geneoh.pipeline.options import Options
from geneoh.readers.npz.files import load

INPUT = Method("input", unchanged)
METHODS = (INPUT, Method("savgol", partial(filtered_hand, kind="savgol", domain="keypoints")))
SETTINGS = {"weights": {"motion": "abc"}, "data": None}
VERSIONS = {"geneoh": "0.1.0"}
SMALL = EvaluationOptions(
    "synthetic",
    noises=("gauss",),
    limit=1,
    methods=("input", "savgol"),
    protocol=ProtocolOptions(frames=6),
    close_frames=2,
)


def damaged():
    raise InputError("clip.npz: damaged; copy it again")


def failing(case: Case):
    raise InputError(f"{case.clip.name}: no")


@pytest.fixture
def damaged_case(noisy_case):
    return replace(noisy_case, clip=Clip("damaged", damaged))


@pytest.fixture
def folder(tmp_path):
    """A folder whose record is begun."""
    open_record(tmp_path, SETTINGS, VERSIONS)
    return tmp_path


@pytest.fixture(scope="module")
def scores(noisy_case, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scores")
    open_record(folder, SETTINGS, VERSIONS)
    return run(work_left([noisy_case], METHODS, []), folder, SMALL), folder


def test_a_run_scores_every_method_and_records_it(scores):
    made, folder = scores
    assert [score.method for score in made] == [method.name for method in METHODS]
    assert made[1].values["mpjpe_mm"] < made[0].values["mpjpe_mm"]
    assert open_record(folder, SETTINGS, VERSIONS) == (made, VERSIONS)


def test_what_has_a_score_is_not_done_again(scores, noisy_case):
    made, _ = scores
    assert work_left([noisy_case], METHODS, made) == []
    ((_, left),) = work_left([noisy_case], METHODS, made[:1])
    assert left == METHODS[1:]
    other = replace(noisy_case, seed=22)
    assert work_left([other], METHODS, made)[0][1] == METHODS


def test_what_failed_is_tried_again_and_its_last_score_counts(noisy_case, folder):
    failed = Score("taco", "short", "gauss", 11, "input", failed="MANO is missing")
    assert work_left([noisy_case], (INPUT,), [failed]) == [(noisy_case, (INPUT,))]
    mended = replace(failed, failed="", values={"mpjpe_mm": 1.0})
    append_journal(folder / SCORED, map(asdict, [failed, mended]))
    assert open_record(folder, SETTINGS, VERSIONS)[0] == [mended]


def test_a_fresh_start_leaves_no_page_of_other_settings(tmp_path):
    page, note = (tmp_path / "pages" / name for name in ("clip_gauss_11_geneoh.html", "own.html"))
    page.parent.mkdir()
    page.write_text('<!doctype html><meta name="generator" content="geneoh">')
    note.write_text("what a user wrote")
    evaluate(replace(SMALL, methods=("input",)), tmp_path, fresh=True)
    assert not page.exists()
    assert note.exists()


@pytest.mark.parametrize("fresh", [False, True])
def test_a_record_of_others_is_kept(tmp_path, fresh):
    (tmp_path / SCORED).write_text("what a user wrote")
    with pytest.raises(InputError, match=r"scores.jsonl: is there already and was not written by"):
        evaluate(replace(SMALL, methods=("input",)), tmp_path, fresh=fresh)
    assert (tmp_path / SCORED).read_text() == "what a user wrote"


def test_a_case_holds_no_data_after_it_was_scored(damaged_case, noisy_case, folder):
    case = replace(noisy_case)
    run(work_left([case], (INPUT,), []), folder, SMALL)
    assert "recording" not in vars(case)
    assert "noisy" not in vars(case)


def test_predictions_are_always_scored_anew(noisy_case, tmp_path):
    method = methods_of(replace(SMALL, predictions=(tmp_path,)))[0][-1]
    done = [Score("taco", "short", "gauss", 11, method.name)]
    assert work_left([noisy_case], (method,), done) == [(noisy_case, (method,))]


def test_a_result_of_geneoh_is_made_again_where_its_page_is_missing(noisy_case, tmp_path):
    methods = (geneoh_method(Options()),)
    done = [Score("taco", "short", "gauss", 11, methods[0].name)]
    assert work_left([noisy_case], methods, done) == []
    assert work_left([noisy_case], methods, done, tmp_path) != []
    page = page_of(tmp_path, done[0].key)
    assert page.name == "short_gauss_11_geneoh_default.html"
    page.touch()
    assert work_left([noisy_case], methods, done, tmp_path) == []


def test_geneoh_leaves_pages(noisy_case, folder):
    methods = (geneoh_method(Options(preset="fast")),)
    (score,) = run(work_left([noisy_case], methods, []), folder, SMALL, pages=folder / "pages")
    assert page_of(folder / "pages", score.key).read_text().startswith("<!doctype html>")


def test_a_method_that_fails_is_noted_and_the_others_go_on(noisy_case, folder):
    made = run(work_left([noisy_case], (Method("failing", failing), INPUT), []), folder, SMALL)
    assert [score.failed for score in made] == ["short: no", ""]
    assert made[0].values == {}
    assert made[1].values["mpjpe_mm"] > 0


def test_a_clip_that_cannot_be_read_is_noted_for_every_method(damaged_case, folder):
    made = run(work_left([damaged_case], METHODS, []), folder, SMALL)
    assert [score.failed for score in made] == ["clip.npz: damaged; copy it again"] * 2


def test_weights_that_are_missing_stop_the_run(noisy_case, folder):
    methods = (INPUT, Method("toch", partial(predicted_hand, baseline="toch", weights=folder)))
    with pytest.raises(CheckpointError, match=r"toch\.safetensors"):
        run(work_left([noisy_case], methods, []), folder, SMALL)


@pytest.mark.slow
def test_a_worker_process_gives_the_scores_of_this_one(scores, folder):
    case = Case("taco", Clip("short", short_clip), "gauss", 11)
    made = run(work_left([case], METHODS, []), folder, SMALL, jobs=2)
    here, there = ([replace(score, seconds=0.0) for score in each] for each in (scores[0], made))
    assert here == there


def test_the_callers_threads_stay_as_they_were(damaged_case, folder):
    before = torch.get_num_threads()
    run(work_left([damaged_case], METHODS, []), folder, SMALL)
    assert torch.get_num_threads() == before


def test_half_a_line_counts_for_nothing(folder):
    scores = [Score("taco", "a", "gauss", seed, "input", {"mpjpe_mm": 1.0}) for seed in (1, 2)]
    append_journal(folder / SCORED, map(asdict, scores))
    path = folder / SCORED
    path.write_text(path.read_text()[:-30])
    assert open_record(folder, SETTINGS, VERSIONS)[0] == scores[:1]
    append_journal(folder / SCORED, map(asdict, scores[1:]))
    assert open_record(folder, SETTINGS, VERSIONS)[0] == scores


def test_scores_of_other_settings_are_refused_until_thrown_away(folder):
    append_journal(folder / SCORED, map(asdict, [Score("taco", "a", "gauss", 1, "input")]))
    other = {**SETTINGS, "data": "/elsewhere"}
    with pytest.raises(
        ConfigError, match=r"other settings \(data none where /elsewhere is asked for\).*--fresh"
    ):
        open_record(folder, other, VERSIONS)
    assert open_record(folder, other, VERSIONS, fresh=True)[0] == []


def test_a_record_without_any_score_keeps_no_settings(folder):
    failed = Score("taco", "a", "gauss", 1, "input", failed="no such file")
    append_journal(folder / SCORED, [asdict(failed)])
    other = {**SETTINGS, "data": "/elsewhere"}
    assert open_record(folder, other, VERSIONS) == ([], VERSIONS)
    append_journal(folder / SCORED, [{"a score": "of another version"}])
    with pytest.raises(ConfigError, match=r"other settings \(data /elsewhere where none"):
        open_record(folder, SETTINGS, VERSIONS)


def test_a_record_that_another_version_wrote_is_refused(folder):
    (folder / SCORED).write_text(json.dumps({"settings": SETTINGS}) + "\n")
    with pytest.raises(ConfigError, match="another version of geneoh"):
        open_record(folder, SETTINGS, VERSIONS)


def test_a_place_that_cannot_be_written_to_is_told(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        open_record(tmp_path / "taken", SETTINGS, VERSIONS)


@pytest.mark.parametrize("given", [{"preset": "fast"}, {"seed": 3}])
def test_a_preset_or_a_seed_of_the_cleaner_that_is_not_scored_is_refused(given):
    ((name, value),) = given.items()
    with pytest.raises(ConfigError, match=rf"got {value!r}; give it as {name}s=\({value!r},\)"):
        replace(SMALL, cleaner=Options(**given))


def test_settings_change_with_all_that_changes_scores(tmp_path, monkeypatch):
    first = settings_of(SMALL)
    assert settings_of(replace(SMALL, limit=5, methods=())) == first
    scored = {"presets": ("fast",), "seeds": (3,), "cleaner": Options(preset="fast", seed=3)}
    assert settings_of(replace(SMALL, **scored)) == first
    weights = stage_weights("motion", None)
    (tmp_path / weights.name).write_bytes(weights.read_bytes() + b" ")
    for other in (
        replace(SMALL, close_frames=3),
        replace(SMALL, protocol=ProtocolOptions(frames=7)),
        replace(SMALL, cleaner=Options(samples=2)),
        replace(SMALL, cleaner=Options(trust_object=True)),
        replace(SMALL, cleaner=Options(refine_object=True)),
        replace(SMALL, cleaner=Options(mano_dir=tmp_path)),
        replace(SMALL, cleaner=Options(device="cuda")),
        replace(SMALL, cleaner=Options(weights=tmp_path)),
        replace(SMALL, noisy_inputs=tmp_path),
        replace(SMALL, dataset="grab", noises=(), root=tmp_path),
    ):
        assert settings_of(other) != first
    monkeypatch.setenv("GENEOH_MANO_DIR", str(tmp_path))
    assert settings_of(replace(SMALL, protocol=ProtocolOptions(frames=6))) != first


def test_an_evaluation_goes_on_and_says_so(tmp_path):
    heard = []
    first = evaluate(SMALL, tmp_path, on_progress=lambda *now: heard.append(now))
    assert heard == [("eval", 3, 3)]
    assert [score.method for score in first.scores] == list(first.methods)
    again = evaluate(replace(SMALL, methods=("input",)), tmp_path)
    assert again.scores == first.scores[:1]
    assert (first.reused, again.reused) == (0, 1)
    for name in ("scores_as_csv", "report_as_json", "as_page"):
        written = getattr(report, name)
        assert written(replace(first, reused=3)) == written(first)  # as if it had never stopped


def test_an_edited_docstring_does_not_end_an_evaluation(tmp_path, monkeypatch):
    """A run is identified by settings, weights and data, not by the text of our source."""
    source = tmp_path / "package" / "module.py"
    source.parent.mkdir()
    monkeypatch.setattr(geneoh, "__file__", str(source.with_name("__init__.py")))
    options = replace(SMALL, methods=("input",))
    source.write_text('"""Before."""')
    first = evaluate(options, tmp_path / "out")
    source.write_text('"""After."""')
    assert evaluate(options, tmp_path / "out").scores == first.scores


def test_another_version_of_a_package_is_told_and_does_not_end_an_evaluation(tmp_path, monkeypatch):
    options = replace(SMALL, methods=("input",))
    first = evaluate(options, tmp_path)
    version = importlib.metadata.version
    begun_with = f"torch {version('torch')}"
    monkeypatch.setattr(
        importlib.metadata, "version", lambda name: "99" if name == "torch" else version(name)
    )
    again = evaluate(options, tmp_path)
    assert again.scores == first.scores
    assert again.settings["versions"].keys() == set(PACKAGES)
    assert again.settings["versions"]["torch"] == "99"
    assert any(
        note.startswith("the record was begun") and begun_with in note for note in again.notes
    )


def test_inputs_written_for_others_score_as_the_input_and_can_be_read_back(tmp_path):
    """What is left untouched must have the input's scores exactly, and a truth no error at all."""
    count = write_inputs(find_cases(SMALL), tmp_path / "same")
    clean = replace(SMALL, noises=("clean",))
    assert (count, write_inputs(find_cases(clean), tmp_path / "truth")) == (1, 1)
    (name,) = (path.name for path in (tmp_path / "same").glob("*.npz"))
    (tmp_path / "truth" / name.replace("gauss", "clean")).rename(tmp_path / "truth" / name)
    given = (tmp_path / "same", tmp_path / "truth")
    (written,) = (tmp_path / "same" / "objects").glob("*.obj")
    (found,) = load(tmp_path / "same" / name).object.meshes
    assert found.source == written
    asked = replace(SMALL, methods=("input",), predictions=given)
    made = evaluate(asked, tmp_path / "out", command="geneoh eval")
    plain, same, truth = made.scores
    assert same.values == plain.values
    assert truth.values["mpjpe_mm"] == pytest.approx(0, abs=1e-3)
    assert plain.values["mpjpe_mm"] > 5
    (case,) = find_cases(replace(SMALL, noisy_inputs=tmp_path / "truth"))
    assert (case.noisy.hands[0].joints - case.clean.hands[0].joints).abs().max() < 1e-6


def test_the_name_of_a_data_set_alone_means_its_defaults(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(
        "geneoh.evaluation.runner.find_cases", lambda options: asked.append(options) or []
    )
    evaluate("synthetic", str(tmp_path))
    assert asked == [EvaluationOptions("synthetic")]
