"""The runner: every method on every case, here or in several processes, resumed after a stop.

The record of an evaluation is one file: a line with the settings, then one score a line. A run is
identified by its settings, its weights and its data; a record of another run is not continued. The
versions of packages are reported, but a new version does not throw scores away.
"""

import json
import os
import re
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, fields, replace
from functools import partial
from hashlib import sha256
from importlib import metadata
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import torch

from geneoh.baselines.library import BASELINES, baseline_weights
from geneoh.choices import Dataset
from geneoh.config import as_dict
from geneoh.denoisers.library import CLEANING_STAGES, PAPER_STAGES, weights_of
from geneoh.errors import ConfigError, InputError, MissingAssetError
from geneoh.evaluation.cases import Case, find_cases
from geneoh.evaluation.methods import Method, methods_of
from geneoh.evaluation.options import EvaluationOptions
from geneoh.evaluation.protocols.datasets import data_root
from geneoh.evaluation.report import RECORD, Evaluation
from geneoh.evaluation.scores import CaseScorer, Score, ScoreKey, ScoringConfig
from geneoh.files.atomic import unwritable, write_whole
from geneoh.progress import OnProgress
from geneoh.viz.view import write_report

PACKAGES = ("geneoh", "torch", "numpy", "scipy", "libigl", "trimesh")  # reported by version
CASE_ERRORS = (InputError, MissingAssetError)
"""Errors of one clip, or of one method on it: they are recorded, and the others go on. Without its
weights (`CheckpointError`) a method cannot be scored on any clip."""

Work = tuple[Case, tuple[Method, ...]]  # with the methods still to be scored on it
Scoring = Callable[[Work], list[Score]]


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
    """Score every method on every case, going on from the scores that `folder` already holds.

        made = geneoh.evaluate("synthetic", "runs/eval")
        options = geneoh.EvaluationOptions("taco", noises=("drift",), methods=("input", "geneoh"))
        made = geneoh.evaluate(options, "runs/eval/taco")

    Args:
        options: what is scored; the name of a data set alone means its defaults.
        folder: of the record and, with `pages`, of pages in 3D.
        jobs: number of processes; 1 works in this one.
        fresh: throw the record in `folder` away.
        pages: whether each clip that geneoh cleans gets a page in 3D.
        command: the command that asked for this, for the report.
        on_progress: called with "eval", the scores made by this call, and those it will make.

    Returns:
        the scores, with tables as `blocks`; `geneoh.evaluation.report.write_report` writes them.

    Raises:
        MissingAssetError: the data set or a folder of predictions is not there.
        ConfigError: a choice does not exist, or `folder` holds scores of other settings.
        CheckpointError: weights are missing or damaged.
    """
    if isinstance(options, str):
        options = EvaluationOptions(options)
    folder = Path(folder)
    cases = find_cases(options)
    methods, notes = methods_of(options)
    settings = settings_of(options)
    versions = {name: metadata.version(name) for name in PACKAGES}
    done, earlier = open_record(folder, settings, versions, fresh=fresh)
    cleaner = options.cleaner
    config = ScoringConfig(cleaner.hand, cleaner.mano_dir, settings["close_frames"])
    pages_folder = folder / "pages" if pages else None
    work = work_left(cases, methods, done, pages_folder)
    jobs = max(1, min(jobs, len(work)))
    made = run(work, folder, config, pages=pages_folder, jobs=jobs, on_progress=on_progress)
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
    """What scores depend on besides their case and their method: it identifies a run.

    Noises, seeds, clips and methods are part of each score and may differ from run to run.
    """
    cleaner = options.cleaner
    files = [weights_of(name, cleaner.weights) for name in (*CLEANING_STAGES, *PAPER_STAGES)]
    files += [baseline_weights(name, cleaner.weights) for name in BASELINES]
    root, stored = data_root(options.dataset, options.root), options.noisy_inputs
    return {
        "weights": {path.stem: digest([path]) for path in files if path.is_file()},
        "data": None if root is None else str(root.resolve()),
        "noisy_inputs": None if stored is None else digest(stored.rglob("*.npz")),
        "protocol": as_dict(options.protocol),
        "close_frames": options.close_frames or options.defaults.close_frames,
        "cleaner": {
            name: getattr(cleaner, name) for name in ("samples", "selection", "steps", "hand")
        },
    }


def digest(paths: Iterable[Path]) -> str:
    """SHA-256 of files' names and contents in the order of their names, first sixteen digits."""
    found = sha256()
    for path in sorted(paths):
        found.update(path.name.encode())
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def open_record(
    folder: Path, settings: dict[str, Any], versions: dict[str, str], *, fresh: bool = False
) -> tuple[list[Score], dict[str, str]]:
    """The scores in a folder and the versions they were begun with; begins a record without any.

    A line that was cut off by a crash is dropped; with `fresh` an earlier record is thrown away.
    """
    path = folder / RECORD
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lines = path.read_text("utf-8").splitlines() if path.is_file() and not fresh else []
    except OSError as error:
        raise unwritable(path, error) from None
    head = {"settings": settings, "versions": versions}
    if lines:
        head = read_head(lines[0], path, settings)
    scores = [score for line in lines[1:] if (score := read_score(line)) is not None]
    text = [head, *map(asdict, scores)]
    write_whole(path, "".join(json.dumps(line) + "\n" for line in text))
    return scores, head["versions"]


def read_head(line: str, path: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """The first line of a record of these settings; `ConfigError` for another one."""
    try:
        head = json.loads(line)
        held, versions = head["settings"], head["versions"]
        names = sorted(name for name in settings if held.get(name) != settings[name])
    except (ValueError, KeyError, TypeError, AttributeError):
        held, versions, names = None, {}, []
    if held == settings:
        return {"settings": held, "versions": versions}
    differs = ", ".join(names) or "its first line is of another version of geneoh"
    raise ConfigError(
        f"{path}: holds scores of other settings ({differs}); "
        "name another folder with -o, or pass --fresh to throw them away"
    )


def read_score(line: str) -> Score | None:
    """The score in one line; None for a line that holds none."""
    try:
        found = json.loads(line)
        return Score(**{field.name: found[field.name] for field in fields(Score)})
    except (ValueError, KeyError, TypeError):
        return None


def append_scores(folder: Path, scores: Iterable[Score]) -> None:
    """Add scores to the record."""
    path = folder / RECORD
    try:
        with path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(asdict(score)) + "\n" for score in scores)
    except OSError as error:
        raise unwritable(path, error) from None


def work_left(
    cases: Iterable[Case],
    methods: tuple[Method, ...],
    done: Iterable[Score],
    pages: Path | None = None,
) -> list[Work]:
    """Every method on every case, without those that have a score, and a page, already."""
    there = {score.key for score in done}

    def is_left(case: Case, method: Method) -> bool:
        key = (*case.key, method.name)
        lacks_page = pages is not None and method.has_pages and not page_of(pages, key).is_file()
        return key not in there or method.may_change or lacks_page

    left = [(case, tuple(each for each in methods if is_left(case, each))) for case in cases]
    return [(case, chosen) for case, chosen in left if chosen]


def page_of(pages: Path, key: ScoreKey) -> Path:
    """File of the page in 3D of one result of geneoh."""
    name = re.sub(r"[^A-Za-z0-9.-]+", "_", "_".join(map(str, key[1:])))
    return pages / f"{name}.html"


def run(
    work: list[Work],
    folder: Path,
    config: ScoringConfig,
    *,
    pages: Path | None = None,
    jobs: int = 1,
    on_progress: OnProgress | None = None,
) -> list[Score]:
    """Do all work; the record of `folder` has a case's scores as soon as they are made."""
    total = sum(len(methods) for _, methods in work)
    scores: list[Score] = []
    score = partial(score_case, config=config, pages=pages)
    for made in in_turn(work, score) if jobs == 1 else in_processes(work, score, jobs):
        append_scores(folder, made)
        scores += made
        if on_progress is not None:
            on_progress("eval", len(scores), total)
    return scores


def in_turn(work: list[Work], score: Scoring) -> Iterator[list[Score]]:
    """One case after the other here; with one thread as in workers, for the same numbers."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield from map(score, work)
    finally:
        torch.set_num_threads(before)


def in_processes(work: list[Work], score: Scoring, jobs: int) -> Iterator[list[Score]]:
    """Cases as they finish in new processes; after a stop, those not begun are dropped."""
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=start_worker)
    try:
        for future in as_completed([pool.submit(score, each) for each in work]):
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def start_worker() -> None:
    """One thread for each worker, since there are as many as cores; Ctrl-C stops the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    torch.set_num_threads(1)


def score_case(work: Work, config: ScoringConfig, pages: Path | None) -> list[Score]:
    """The methods on one case; a case that cannot be read has scores that say why."""
    case, methods = work
    case = replace(case)  # a copy, so that what is read of the case is freed with it
    try:
        scorer = CaseScorer(case, config)
    except CASE_ERRORS as error:
        return [Score(*case.key, method.name, failed=str(error)) for method in methods]
    return [score_method(scorer, method, pages) for method in methods]


def score_method(scorer: CaseScorer, method: Method, pages: Path | None) -> Score:
    """One method on one case."""
    case, began = scorer.case, time.process_time()
    try:
        cleaned = method.clean(case)
        seconds = time.process_time() - began
        if cleaned is None:
            return Score(*case.key, method.name, failed="the clip lacks what this method needs")
        score = scorer.score(method.name, cleaned, seconds)
        if pages is not None and cleaned.result is not None:
            pages.mkdir(parents=True, exist_ok=True)
            page, mano_dir = page_of(pages, score.key), scorer.config.mano_dir
            write_report(case.noisy, cleaned.result, page, title=case.clip.name, mano_dir=mano_dir)
        return score
    except CASE_ERRORS as error:
        return Score(*case.key, method.name, failed=str(error))


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
