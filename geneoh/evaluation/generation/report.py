"""The output files of an evaluation of generated clips: a table in Markdown, a CSV and a JSON."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch

from geneoh.bundle import show_text
from geneoh.evaluation.generation.scores import MEASURES, RowScores
from geneoh.evaluation.report import made_with
from geneoh.evaluation.scores import Measure
from geneoh.files.atomic import write_whole
from geneoh.files.outputs import is_ours, keep_others
from geneoh.files.text import csv_text, json_text
from geneoh.metrics.features import Interval, interval

FILES = ("generation.json", "generation.csv", "generation.md")


@dataclass(frozen=True)
class GenerationReport:
    """All scores of a run, and the settings on which they depend. As text it has the table."""

    settings: dict[str, Any]
    """Settings, clips, weights, the classifier's configuration and hash, and package versions."""
    command: str
    rows: dict[str, RowScores]
    about: tuple[str, ...]  # remarks below the table
    measures: tuple[Measure, ...] = MEASURES

    _repr_pretty_ = show_text

    def __str__(self) -> str:
        return "\n".join([*_as_text(self), *map("note: {}".format, self.remarks())])

    def remarks(self) -> Iterator[str]:
        """Remarks below the table, among them the meaning of each column."""
        yield from self.about
        for measure in self.measures:
            yield f"{measure.title}: {measure.meaning}; {measure.better} is better."
        # all rows are scored on the same halves of the clips, so differences vary less than FIDs
        distances = {name: torch.tensor(row.values["fid"]) for name, row in self.rows.items()}
        *others, last = distances
        if others:
            found = {name: interval(distances[name] - distances[last]) for name in others}
            each = (f"{name} {by.mean:+.2f}±{by.half:.2f}" for name, by in found.items())
            yield f"FID less that of {last}, over the same halves: {', '.join(each)}."


def keep_other_generation_reports(folder: Path) -> None:
    """`InputError` if a folder holds files of the report's names that geneoh did not write."""
    if not is_ours(folder / FILES[0]):
        keep_others(*(folder / name for name in FILES))


def write_generation_report(report: GenerationReport, folder: Path) -> list[Path]:
    """Write generation.json, generation.csv and generation.md; returns their paths."""
    texts = (as_json(report), _as_csv(report), _as_markdown(report))
    for name, text in zip(FILES, texts, strict=True):
        write_whole(folder / name, text, parents=True)
    return [folder / name for name in FILES]


def as_json(report: GenerationReport) -> str:
    """The settings needed to repeat the evaluation, and the scores of all repetitions.

    Values that cannot be measured, such as the multimodality of a single clip, are null.
    """
    whole = {
        "generator": "geneoh eval",
        "command": report.command,
        "settings": report.settings,
        "remarks": list(report.remarks()),
        "measures": [asdict(measure) for measure in report.measures],
        "table": {
            name: {key: asdict(cell) for key, cell in row.cells.items()}
            for name, row in report.rows.items()
        },
        "repetitions": {name: row.values for name, row in report.rows.items()},
    }
    return json_text(whole, indent=1) + "\n"


def _as_csv(report: GenerationReport) -> str:
    """One line per row and repetition, with all measures."""
    keys = [measure.key for measure in report.measures]
    rows: list[list[Any]] = [["row", "repetition", *keys]]
    for name, row in report.rows.items():
        for number, values in enumerate(zip(*(row.values[key] for key in keys), strict=True)):
            rows.append([name, number, *values])
    return csv_text(rows)


def _as_markdown(report: GenerationReport) -> str:
    """The table as Markdown, with command, remarks, versions and weights."""
    heads = [f"{m.title} {m.unit}".strip() for m in report.measures]
    lines = ["# geneoh eval", "", f"`{report.command}`", ""]
    lines += [f"| | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
    lines += [f"| {name} | {' | '.join(texts)} |" for name, texts in _table(report)]
    lines += ["", *(f"- {remark}" for remark in report.remarks()), ""]
    return "\n".join([*lines, made_with(report.settings), ""])


def _as_text(report: GenerationReport) -> Iterator[str]:
    """The table as lines of text."""
    yield f"{'':<24}" + "".join(f"{f'{m.title} {m.unit}'.strip():>16}" for m in report.measures)
    for name, texts in _table(report):
        yield f"{name:<24}" + "".join(f"{text:>16}" for text in texts)


def _table(report: GenerationReport) -> Iterator[tuple[str, list[str]]]:
    """The name and the cell texts of each row."""
    for name, row in report.rows.items():
        cells = row.cells
        yield name, [_shown(cells[measure.key], measure) for measure in report.measures]


def _shown(cell: Interval, measure: Measure) -> str:
    """Mean and half interval with the measure's digits; n/a for NaN."""
    if cell.mean != cell.mean:
        return "n/a"
    mean = f"{cell.mean:.{measure.digits}f}"
    return mean if cell.half != cell.half else f"{mean}±{cell.half:.{measure.digits}f}"
