"""The evaluation: scores every method on every case, in one or several processes, and resumes.

The record of an evaluation is one file: a line with the settings, then one score per line. A run is
identified by its settings, weights and data; a record of another run is not resumed. The versions
of packages are reported, but a new version does not discard scores.
"""

import re
import time
from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from geneoh.arguments import checked_call, given_options
from geneoh.baselines.networks import BASELINES, baseline_weights
from geneoh.choices import Dataset
from geneoh.config import as_dict, setting_differences
from geneoh.denoisers.library import all_weights
from geneoh.errors import ConfigError, InputError, MissingAssetError
from geneoh.evaluation.cases import Case, find_cases
from geneoh.evaluation.methods import Method, methods_of
from geneoh.evaluation.options import EvaluationOptions
from geneoh.evaluation.protocols.datasets import data_root
from geneoh.evaluation.report import Evaluation
from geneoh.evaluation.scores import MEASURES, CaseScorer, Score, ScoreKey
from geneoh.files.atomic import make_folder
from geneoh.files.fingerprints import file_digest, file_digests, package_versions
from geneoh.files.journal import SCORED, append_journal, begin_journal, only_run_in, read_journal
from geneoh.files.outputs import is_ours, keep_others
from geneoh.hand.library import load_hand
from geneoh.progress import OnProgress
from geneoh.viz.view import write_page
from geneoh.workers.pool import results_of

CASE_ERRORS = (InputError, MissingAssetError)
"""Errors of one clip, or of one method on it: they are recorded, and the evaluation continues.
Missing weights (`CheckpointError`) end it, because they concern all clips."""

IN_SCORES = ("preset", "without", "seed", "weights")
"""Options of the cleaner that are not in the settings of a run: method names hold the first two,
each score has its seed, and weights are identified by their contents."""

Work = tuple[Case, tuple[Method, ...]]  # a case and the methods still to be scored on it


@checked_call
def evaluate(
    options: EvaluationOptions | Dataset,
    folder: Path | str,
    *,
    jobs: int = 1,
    fresh: bool = False,
    pages: bool = False,
    command: str = "",
    on_progress: OnProgress | None = None,
) -> Evaluation:
    """Score every method on every case; scores that `folder` already holds are reused.

        made = geneoh.evaluate("synthetic", "runs/eval")
        options = geneoh.EvaluationOptions("taco", noises=("drift",), methods=("input", "geneoh"))
        made = geneoh.evaluate(options, "runs/eval/taco")

    Args:
        options: what is scored; the name of a data set means its defaults.
        folder: output folder of the record and, with `pages`, of pages in 3D.
        jobs: number of processes; 1 works in this one. A script with more needs
            `if __name__ == "__main__":` around its calls, because each process imports it.
        fresh: discard the record and the pages in `folder`.
        pages: whether each clip that geneoh cleans gets a page in 3D.
        command: the command line, for the report.
        on_progress: called with "eval", the number of new scores so far, and in total.

    Returns:
        the scores, with tables as `blocks`; `geneoh.evaluation.report.write_report` writes them.

    Raises:
        MissingAssetError: the data set or a folder of predictions is missing.
        ConfigError: an option has an unknown value, or `folder` holds scores of other settings.
        CheckpointError: weights are missing or damaged.
    """
    chosen = EvaluationOptions(options) if isinstance(options, str) else options
    options = given_options(chosen, EvaluationOptions, "geneoh.evaluate")
    folder = Path(folder)
    cases = find_cases(options)
    methods, notes = methods_of(options)
    settings = settings_of(options)
    # a missing hand model is reported here, before every clip would fail for it
    load_hand("right", source=options.cleaner.hand, mano_dir=options.cleaner.mano_dir)
    versions = package_versions()
    pages_folder = folder / "pages" if pages else None
    with only_run_in(folder):
        keep_others(folder / SCORED)
        if fresh:
            remove_pages(folder / "pages")
        done, earlier = open_record(folder, settings, versions, fresh=fresh)
        work = work_left(cases, methods, done, pages_folder)
        jobs = max(1, min(jobs, len(work)))
        made = run(work, folder, options, pages=pages_folder, jobs=jobs, on_progress=on_progress)
    by_key = {score.key: score for score in [*done, *made]}
    wanted = [(*case.key, method.name) for case in cases for method in methods]
    reused = len(wanted) - len(made)
    if reused and earlier != versions:
        words = ", ".join(f"{name} {version}" for name, version in earlier.items())
        notes = (*notes, f"the record was begun with {words}")
    return Evaluation(
        settings={**settings, "versions": versions},
        command=command,
        methods=tuple(method.name for method in methods),
        scores=tuple(by_key[key] for key in wanted),
        notes=notes,
        pages=tuple(
            (" · ".join(map(str, key[1:])), page.relative_to(folder).as_posix())
            for key in wanted
            if pages_folder is not None and (page := page_of(pages_folder, key)).is_file()
        ),
        reused=reused,
    )


def settings_of(options: EvaluationOptions) -> dict[str, Any]:
    """The settings on which scores depend besides case and method; they identify a run.

    Noises, seeds, clips and methods are part of each score, and may change when a run is resumed.
    """
    cleaner = options.cleaner
    baselines = [baseline_weights(name, cleaner.weights) for name in BASELINES]
    root, stored = data_root(options.dataset, options.root), options.noisy_inputs
    return {
        "weights": file_digests([*all_weights(cleaner.weights), *baselines]),
        "data": None if root is None else str(root.resolve()),
        "noisy_inputs": None if stored is None else file_digest(stored.rglob("*.npz")),
        "protocol": as_dict(options.protocol),
        "close_frames": options.closely_measured,
        "measures": [measure.key for measure in MEASURES],
        "cleaner": {
            name: value for name, value in as_dict(cleaner).items() if name not in IN_SCORES
        },
    }


def open_record(
    folder: Path, settings: dict[str, Any], versions: dict[str, Any], *, fresh: bool = False
) -> tuple[list[Score], dict[str, Any]]:
    """The scores in the record of a folder, and the package versions it was begun with.

    A new record is begun if there is none, if every case in it failed, or if `fresh`. An incomplete
    last line is dropped.
    """
    path = folder / SCORED
    records = [] if fresh else read_journal(path)
    found = [read_score(record) for record in records[1:]]
    head = {"settings": settings, "versions": versions}
    failed = all(score and score.failed for score in found)  # all of them are tried again anyway
    if records and not (failed and head.keys() <= records[0].keys()):
        head = read_head(records[0], path, settings)
    else:
        found = []
    scores = list({score.key: score for score in found if score}.values())  # the last of each key
    begin_journal(path, [head, *map(asdict, scores)])
    return scores, head["versions"]


def read_head(head: dict[str, Any], path: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """The first line of a record; `ConfigError` if its settings differ from `settings`."""
    held, versions = head.get("settings"), head.get("versions")
    if held == settings and isinstance(versions, dict):
        return {"settings": held, "versions": versions}
    differs = setting_differences(held, settings) if isinstance(held, dict) else ""
    differs = differs or "its first line is of another version of geneoh"
    raise ConfigError(
        f"{path}: holds scores of other settings ({differs}); "
        "name another folder with -o, or pass --fresh to throw them away"
    )


def read_score(found: dict[str, Any]) -> Score | None:
    """The score in a line of a record; None if it holds none."""
    try:
        return Score(**{field.name: found[field.name] for field in fields(Score)})
    except (KeyError, TypeError):
        return None


def work_left(
    cases: Iterable[Case],
    methods: tuple[Method, ...],
    done: Iterable[Score],
    pages: Path | None = None,
) -> list[Work]:
    """The cases with the methods that still lack a score, or a page.

    Failed ones are tried again, because their cause may have been fixed.
    """
    there = {score.key for score in done if not score.failed}

    def is_left(case: Case, method: Method) -> bool:
        key = (*case.key, method.name)
        lacks_page = pages is not None and method.has_pages and not page_of(pages, key).is_file()
        return key not in there or method.may_change or lacks_page

    left = [(case, tuple(each for each in methods if is_left(case, each))) for case in cases]
    return [(case, chosen) for case, chosen in left if chosen]


def page_of(pages: Path, key: ScoreKey) -> Path:
    """The path of the page in 3D of one result of geneoh."""
    name = re.sub(r"[^A-Za-z0-9.-]+", "_", "_".join(map(str, key[1:])))
    return pages / f"{name}.html"


def remove_pages(folder: Path) -> None:
    """Remove the pages of earlier runs; files that geneoh did not write stay."""
    for page in folder.glob("*.html"):
        if is_ours(page):
            page.unlink()


def run(
    work: list[Work],
    folder: Path,
    options: EvaluationOptions,
    *,
    pages: Path | None = None,
    jobs: int = 1,
    on_progress: OnProgress | None = None,
) -> list[Score]:
    """Score all cases in `work`; the scores of a case are added to the record at once."""
    total = sum(len(methods) for _, methods in work)
    scores: list[Score] = []
    score = partial(score_case, options=options, pages=pages)
    for made in results_of(work, score, jobs=jobs, lost=_lost):
        append_journal(folder / SCORED, map(asdict, made))
        scores += made
        if on_progress is not None:
            on_progress("eval", len(scores), total)
    return scores


def _lost(work: Work, why: str) -> list[Score]:
    """The failed scores of a case whose workers died."""
    case, methods = work
    return [Score(*case.key, method.name, failed=why) for method in methods]


def score_case(work: Work, options: EvaluationOptions, pages: Path | None) -> list[Score]:
    """Score the methods on one case; if it cannot be read, the scores hold the reason."""
    case, methods = work
    case = replace(case)  # a copy, so that its cached clip is freed with it
    try:
        scorer = CaseScorer(case, options)
    except CASE_ERRORS as error:
        return [Score(*case.key, method.name, failed=str(error)) for method in methods]
    return [score_method(scorer, method, pages) for method in methods]


def score_method(scorer: CaseScorer, method: Method, pages: Path | None) -> Score:
    """Score one method on one case, and write its page."""
    case, began = scorer.case, time.process_time()
    try:
        cleaned = method.clean(case)
        seconds = time.process_time() - began
        score = scorer.score(method.name, cleaned, seconds)
        if pages is not None and cleaned.result is not None:
            make_folder(pages)
            page, mano_dir = page_of(pages, score.key), scorer.options.cleaner.mano_dir
            write_page(case.noisy, cleaned.result, page, title=case.clip.name, mano_dir=mano_dir)
        return score
    except CASE_ERRORS as error:
        return Score(*case.key, method.name, failed=str(error))
