"""The loop over cases and rows: in this process or in several, and going on after a stop."""

import os
import re
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import torch

from geneoh.errors import CheckpointError, InputError, MissingAssetError, NumericalError
from geneoh.evaluation.cases import Pending
from geneoh.evaluation.methods import GeneohRow, PredictionsRow, Row
from geneoh.evaluation.records import append_scores
from geneoh.evaluation.scores import Bench, Judge, Key, Score
from geneoh.viz.view import write_report

CLIP_ERRORS = (InputError, MissingAssetError, NumericalError)
"""What is wrong with one clip, or one row on it: noted, and the others go on."""


@dataclass(frozen=True)
class Task:
    """One case with the rows that are still to be scored on it; goes to a worker."""

    case: Pending
    rows: tuple[Row, ...]
    judge: Judge
    pages: Path | None = None
    """Where our own rows leave a page to look at."""


def tasks_of(
    cases: Iterable[Pending],
    rows: tuple[Row, ...],
    done: Iterable[Score],
    judge: Judge,
    pages: Path | None = None,
) -> list[Task]:
    """What is left to do: every row on every case, but for those with a score."""
    there = {score.key for score in done}
    tasks = []
    for case in cases:
        key = (case.dataset, case.clip, case.noise, case.seed)
        left = tuple(
            row
            for row in rows
            if (*key, row.name) not in there
            or isinstance(row, PredictionsRow)  # the folder may hold other results by now
            or lacks_page(pages, row, (*key, row.name))
        )
        if left:
            tasks.append(Task(case, left, judge, pages))
    return tasks


def lacks_page(pages: Path | None, row: Row, key: Key) -> bool:
    """Whether a row of ours has still to leave its page."""
    return pages is not None and isinstance(row, GeneohRow) and not page_of(pages, key).is_file()


def page_of(pages: Path, key: Key) -> Path:
    """Where the page of one of our rows stands."""
    name = re.sub(r"[^A-Za-z0-9.-]+", "_", "_".join(map(str, key[1:])))
    return pages / f"{name}.html"


def run(
    tasks: list[Task],
    folder: Path,
    *,
    jobs: int = 1,
    on_scores: Callable[[list[Score]], None] | None = None,
) -> list[Score]:
    """Score all tasks; each case's scores are in the record of `folder` as soon as they are made.

    Args:
        tasks: from `tasks_of`.
        folder: of the evaluation, its record begun.
        jobs: processes, each with one thread; 1 works in this one.
        on_scores: called with the scores of each finished case.
    """
    scores: list[Score] = []
    for made in in_turn(tasks) if jobs == 1 else in_processes(tasks, jobs):
        append_scores(folder, made)
        scores += made
        if on_scores is not None:
            on_scores(made)
    return scores


def in_turn(tasks: Iterable[Task]) -> Iterator[list[Score]]:
    """One task after the other, here; with one thread as in workers, for the same numbers."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        for task in tasks:
            yield score_task(task)
    finally:
        torch.set_num_threads(before)


def in_processes(tasks: Iterable[Task], jobs: int) -> Iterator[list[Score]]:
    """Tasks as they finish in fresh processes; those not begun are dropped when we are stopped."""
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=one_thread)
    try:
        for future in as_completed([pool.submit(score_task, task) for task in tasks]):
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def one_thread() -> None:
    """Workers share the cores by being many, and leave Ctrl-C to the process that began them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    torch.set_num_threads(1)


def score_task(task: Task) -> list[Score]:
    """All rows of one case; what cannot be read or cleaned has a score that says why."""
    pending = task.case
    key = (pending.dataset, pending.clip, pending.noise, pending.seed)
    try:
        bench = Bench(pending.load(), task.judge)
    except CLIP_ERRORS as error:
        return [Score(*key, row.name, failed=str(error)) for row in task.rows]
    return [score_row(bench, row, task.pages) for row in task.rows]


def score_row(bench: Bench, row: Row, pages: Path | None) -> Score:
    """One row on one case."""
    case, began = bench.case, time.process_time()
    key = (case.dataset, case.clip, case.noise, case.seed, row.name)
    try:
        cleaned = row.clean(case)
        spent = time.process_time() - began
        if cleaned is None:
            return Score(*key, failed="the clip has not what this row needs")
        score = bench.score(row.name, cleaned, spent)
        if pages is not None and cleaned.result is not None:
            pages.mkdir(parents=True, exist_ok=True)
            write_report(case.noisy, cleaned.result, page_of(pages, key), title=case.clip)
        return score
    except CheckpointError:
        raise  # no case can be scored without it
    except CLIP_ERRORS as error:
        return Score(*key, failed=str(error))
