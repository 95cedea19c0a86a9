"""What a user asks of an evaluation, made into cases, rows and settings; and carrying it out."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from typing_extensions import assert_never

from geneoh.baselines.library import BASELINES, baseline_weights
from geneoh.choices import Ablation, MethodName, PresetName
from geneoh.config import as_dict
from geneoh.denoisers.library import CLEANING_STAGES, weights_of
from geneoh.errors import ConfigError, MissingAssetError
from geneoh.evaluation.cases import Pending
from geneoh.evaluation.external_results import StoredTwin
from geneoh.evaluation.methods import (
    BaselineRow,
    BestFilterRow,
    FilterRow,
    GeneohRow,
    InputRow,
    OptimisedRow,
    PredictionsRow,
    Row,
)
from geneoh.evaluation.protocols import SEEDS, ProtocolOptions, find_cases
from geneoh.evaluation.records import digest, open_record, provenance
from geneoh.evaluation.report import Evaluation
from geneoh.evaluation.run import page_of, run, tasks_of
from geneoh.evaluation.scores import Judge, Key, Score
from geneoh.pipeline.denoise import Options

DEFAULT_ROWS: tuple[MethodName, ...] = (
    *("input", "savgol", "best-filter", "optimisation"),
    *("toch", "regression", "geneoh"),
)
"""One kind of filter is enough to see: the others are among those the best is chosen from."""
DEFAULT_SEEDS: dict[str, tuple[int, ...]] = {"synthetic": SEEDS[:1]}
"""Where clips are many, one noise for each says as much as three; elsewhere the paper's seeds."""
DEFAULT_CLOSE_FRAMES: dict[str, int] = {"synthetic": 5}
"""Many short clips: a few frames of each say as much as many frames of a few."""


@dataclass(frozen=True)
class Choices:
    """An evaluation as the command line has it."""

    dataset: str
    root: Path | None = None
    noises: tuple[str, ...] = ()
    """None: the data set's own."""
    seeds: tuple[int, ...] = ()
    """None: the paper's, or what `DEFAULT_SEEDS` has."""
    limit: int | None = None
    rows: tuple[MethodName, ...] = ()
    """None: `DEFAULT_ROWS`, but for baselines whose weights are not there."""
    presets: tuple[PresetName, ...] = ("default",)
    ablations: tuple[Ablation, ...] = ()
    """Each a row of its own: the first preset without that part."""
    predictions: tuple[Path, ...] = ()
    twins: Path | None = None
    """Folder of noisy inputs to take instead of drawing them."""
    protocol: ProtocolOptions = field(default_factory=ProtocolOptions)
    options: Options = field(default_factory=Options)
    """Of the cleaner: samples, selection, steps, hand, weights; the preset is set row by row."""
    close_frames: int | None = None
    """Frames of a clip in which volume and contact on the object are taken."""

    @property
    def judge(self) -> Judge:
        """How the rows are judged."""
        usual = DEFAULT_CLOSE_FRAMES.get(self.dataset, Judge.close_frames)
        return Judge(self.options.hand, self.options.mano_dir, self.close_frames or usual)


def cases_of(choices: Choices) -> list[Pending]:
    """The cases, not read yet."""
    found = find_cases(
        choices.dataset,
        choices.root,
        noises=choices.noises,
        seeds=choices.seeds or DEFAULT_SEEDS.get(choices.dataset, SEEDS),
        limit=choices.limit,
        options=choices.protocol,
    )
    if choices.twins is None:
        return list(found)
    return [StoredTwin(pending, choices.twins) for pending in found]


def rows_of(choices: Choices) -> tuple[tuple[Row, ...], tuple[str, ...]]:
    """The rows in the order of the table, and what to say of those that had to stay out."""
    rows: list[Row] = []
    notes: list[str] = []
    for name in choices.rows or DEFAULT_ROWS:
        if name in BASELINES and not choices.rows:
            path = baseline_weights(name, choices.options.weights)
            if not path.is_file():
                notes.append(f"no row {name}: no weights; `geneoh train --stage {name}` makes them")
                continue
        rows += named_rows(name, choices)
    rows += [PredictionsRow(folder) for folder in choices.predictions]
    for folder in choices.predictions:
        if not folder.is_dir():
            raise MissingAssetError(
                f"--predictions {folder}: expected a folder of results CLIP_NOISE_SEED.npz, found "
                "none; --inputs DIR writes what they are to be made from"
            )
    names = [row.name for row in rows]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ConfigError(
            f"rows need names of their own, got {', '.join(sorted(twice))} more than once; drop "
            "one, or rename its folder"
        )
    return tuple(rows), tuple(notes)


def named_rows(name: MethodName, choices: Choices) -> Iterator[Row]:
    """The rows behind one name."""
    match name:
        case "input":
            yield InputRow()
        case "savgol" | "gaussian" | "one-euro":
            yield FilterRow(name, "keypoints")
            yield FilterRow(name, "parameters")
        case "best-filter":
            yield BestFilterRow("keypoints")
            yield BestFilterRow("parameters")
        case "optimisation":
            yield OptimisedRow(choices.options.hand, choices.options.mano_dir)
        case "toch" | "regression":
            yield BaselineRow(name, baseline_weights(name, choices.options.weights).parent)
        case "geneoh":
            for preset in choices.presets:
                yield GeneohRow(replace(choices.options, preset=preset))
            for part in choices.ablations:
                first = replace(choices.options, preset=choices.presets[0])
                yield GeneohRow(replace(first, without=(part,)))
        case _:
            assert_never(name)


def settings_of(choices: Choices) -> dict[str, object]:
    """All that scores depend on but the case and the row themselves."""
    options = choices.options
    files = [weights_of(name, options.weights) for name in (*CLEANING_STAGES, "trajectory")]
    files += [baseline_weights(name, options.weights) for name in BASELINES]
    return {
        **provenance(files),
        "root": None if choices.root is None else str(choices.root),
        "twins": None if choices.twins is None else digest(choices.twins.rglob("*.npz")),
        "protocol": as_dict(choices.protocol),
        "close_frames": choices.judge.close_frames,
        "cleaner": {
            "samples": options.samples,
            "selection": options.selection,
            "steps": options.steps,
            "hand": options.hand,
        },
    }


def evaluate(
    choices: Choices,
    folder: Path,
    *,
    command: str = "",
    jobs: int = 1,
    fresh: bool = False,
    pages: bool = False,
    on_progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Score every row on every case, going on from what `folder` holds already.

    Args:
        choices: what is asked for.
        folder: of the record and, with `pages`, of pages in 3D.
        command: what made this, for the report.
        jobs: processes.
        fresh: begin anew.
        pages: whether each of our results gets a page to look at.
        on_progress: called with the scores made and in all, of this call.

    Raises:
        MissingAssetError: the data set or a prediction folder is not there.
        ConfigError: a choice is unknown, or the folder holds scores of other settings.
        CheckpointError: weights are missing or damaged.
    """
    cases = cases_of(choices)
    rows, notes = rows_of(choices)
    settings = settings_of(choices)
    at = folder / "pages" if pages else None
    there = open_record(folder, settings, fresh=fresh)
    tasks = tasks_of(cases, rows, there, choices.judge, at)
    total, done = sum(len(task.rows) for task in tasks), 0

    def heard(made: list[Score]) -> None:
        nonlocal done
        done += len(made)
        if on_progress is not None:
            on_progress(done, total)

    made = run(tasks, folder, jobs=max(1, min(jobs, len(tasks))), on_scores=heard)
    by_key = {score.key: score for score in [*there, *made]}
    wanted = [
        (case.dataset, case.clip, case.noise, case.seed, row.name) for case in cases for row in rows
    ]
    if total < len(wanted):
        notes = (*notes, f"{len(wanted) - total} of {len(wanted)} scores were there already")
    return Evaluation(
        settings=settings,
        command=command,
        rows=tuple(row.name for row in rows),
        scores=tuple(by_key[key] for key in wanted),
        notes=notes,
        pages=() if at is None else tuple(shown_pages(at, wanted)),
    )


def shown_pages(pages: Path, keys: Iterable[Key]) -> Iterator[tuple[str, str]]:
    """Title and place beside the report of every page that is there."""
    for key in keys:
        path = page_of(pages, key)
        if path.is_file():
            yield " · ".join(map(str, key[1:])), f"{pages.name}/{path.name}"


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
