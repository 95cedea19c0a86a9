"""What an evaluation leaves behind: a CSV of all values, a JSON of everything, a report to read."""

import csv
import html
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from geneoh.evaluation import plots
from geneoh.evaluation.scores import MEASURES, Score
from geneoh.evaluation.tables import (
    LEVEL,
    Block,
    agreement,
    as_markdown,
    blocks_of,
    named,
    shown,
)
from geneoh.files.atomic import write_whole

GENEROUS = (
    "† Of all filters and sizes the best on the very clip, chosen with the ground truth in hand: "
    "better than anybody can use it."
)
BODY = (
    "Rows of keypoints are judged by our hand fitted to them without a look at the object; ours by "
    "their own mesh."
)


@dataclass(frozen=True)
class Evaluation:
    """All scores of a run, and what they depend on."""

    settings: dict[str, Any]
    command: str
    rows: tuple[str, ...]
    """In the order of the tables."""
    scores: tuple[Score, ...]
    notes: tuple[str, ...] = ()
    pages: tuple[tuple[str, str], ...] = ()
    """Title and file, beside the report, of pages to look at."""

    @property
    def blocks(self) -> list[Block]:
        """The tables."""
        return blocks_of(self.scores, self.rows)

    def remarks(self) -> Iterator[str]:
        """What a reader of the tables must know."""
        seeds = len({score.seed for score in self.scores})
        clips = len({score.clip for score in self.scores})
        if seeds > 1:
            yield f"Mean ± standard deviation over {seeds} seeds of the mean over clips."
        if (alike := agreement(self.scores)) is not None:
            yield (
                "The seeds rank the rows by MPJPE alike to a Kendall tau of "
                f"{alike:.2f} (1: the same order for every seed)."
            )
        over = "clips" if clips > 1 else "seeds"
        yield f"Intervals in the report: {LEVEL:.0%}, bootstrap over {over}."
        if any("†" in row for row in self.rows):
            yield GENEROUS
        yield BODY
        for row in self.rows:
            said = dict.fromkeys(s.failed for s in self.scores if s.row == row and s.failed)
            for reason in list(said)[:3]:
                yield f"{row}: {reason}"
        yield from self.notes


def write_report(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write scores.csv, evaluation.json, report.md and report.html; returns their paths."""
    texts = {
        "scores.csv": as_csv(evaluation.scores),
        "evaluation.json": as_json(evaluation),
        "report.md": "\n".join(as_report(evaluation)) + "\n",
        "report.html": as_page(evaluation),
    }
    for name, text in texts.items():
        write_whole(folder / name, text)
    return [folder / name for name in texts]


def as_csv(scores: Iterable[Score]) -> str:
    """A line for each score: where it is from, all measures, seconds, and why there is none."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    keys = [measure.key for measure in MEASURES]
    writer.writerow(["dataset", "clip", "noise", "seed", "row", *keys, "seconds", "failed"])
    for score in scores:
        writer.writerow(
            [*score.key, *(score.values.get(key) for key in keys), score.seconds, score.failed]
        )
    return stream.getvalue()


def as_json(evaluation: Evaluation) -> str:
    """Everything that is needed to repeat the evaluation, every table and every score."""
    tables = [
        {
            "dataset": block.dataset,
            "noise": block.noise,
            "clips": block.clips,
            "seeds": block.seeds,
            "rows": {
                row: {key: asdict(cell) for key, cell in cells.items()}
                for row, cells in block.rows.items()
            },
        }
        for block in evaluation.blocks
    ]
    whole = {
        "command": evaluation.command,
        "settings": evaluation.settings,
        "remarks": list(evaluation.remarks()),
        "measures": {measure.key: measure.unit for measure in MEASURES},
        "tables": tables,
        "scores": [asdict(score) for score in evaluation.scores],
    }
    return json.dumps(whole, indent=1)


def as_report(evaluation: Evaluation) -> Iterator[str]:
    """The tables as Markdown, with what made them."""
    yield "# geneoh eval"
    yield ""
    yield f"`{evaluation.command}`"
    yield ""
    yield from as_markdown(evaluation.blocks)
    yield ""
    yield from (f"- {remark}" for remark in evaluation.remarks())
    yield ""
    yield f"Made with {made_with(evaluation)}."


def made_with(evaluation: Evaluation) -> str:
    """Versions and weights in words."""
    versions = evaluation.settings.get("versions", {})
    weights = evaluation.settings.get("weights", {})
    told = [f"{name} {version}" for name, version in versions.items()]
    return ", ".join([*told, *(f"{name} weights {digest}" for name, digest in weights.items())])


def as_page(evaluation: Evaluation) -> str:
    """The report as one HTML file that needs nothing else."""
    blocks = evaluation.blocks
    parts = [f"<p><code>{html.escape(evaluation.command)}</code></p>"]
    for block in blocks:
        parts += [f"<h2>{html.escape(block.title)}</h2>", table(block)]
    remarks = "".join(f"<li>{html.escape(remark)}</li>" for remark in evaluation.remarks())
    parts.append(f"<ul>{remarks}</ul>")
    if plots.available():
        parts += pictures(evaluation, blocks)
    else:
        parts.append(f"<p>For plots: <code>{html.escape(plots.EXTRA)}</code></p>")
    if evaluation.pages:
        links = "".join(
            f'<li><a href="{html.escape(file)}">{html.escape(title)}</a></li>'
            for title, file in evaluation.pages
        )
        parts.append(f"<h2>Clips to look at</h2><ul>{links}</ul>")
    settings = html.escape(json.dumps(evaluation.settings, indent=1))
    parts.append(f"<details><summary>settings</summary><pre>{settings}</pre></details>")
    return PAGE.format(body="\n".join(parts))


def table(block: Block) -> str:
    """One noise as an HTML table; the best of a column is bold."""
    heads = "".join(f"<th>{m.title}<br>{m.unit}</th>" for m in block.measures)
    lines = []
    for row, cells in block.rows.items():
        line = f"<th>{html.escape(named(block, row))}</th>"
        for measure in block.measures:
            cell = cells.get(measure.key)
            best = cell is not None and round(cell.mean, measure.digits) == block.best(measure)
            line += f"<td{' class=best' if best else ''}>{shown(cell, measure)}</td>"
        lines.append(f"<tr>{line}</tr>")
    return f"<table><tr><th></th>{heads}</tr>{''.join(lines)}</table>"


def pictures(evaluation: Evaluation, blocks: Sequence[Block]) -> Iterator[str]:
    """All plots: bars over noises, then time, joints and before against after for each noise."""
    there = {key for block in blocks for cells in block.rows.values() for key in cells}
    for key in ("mpjpe_mm", "depth_mm"):
        if key in there:
            yield "<h2>All rows, with 95% intervals</h2>" + plots.bars(blocks, key)
    if "mpjpe_mm" not in there:
        return
    for block in blocks:
        scores = [
            s for s in evaluation.scores if (s.dataset, s.noise) == (block.dataset, block.noise)
        ]
        rows = list(block.rows)
        yield f"<h2>{html.escape(block.title)}: error over time</h2>"
        yield plots.over_time(scores, rows)
        yield "<h3>error per joint</h3>" + plots.per_joint(scores, rows)
        yield "<h3>before against after; above the line cleaning made it worse</h3>"
        yield plots.before_after(scores, rows)


PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>geneoh eval</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem;
  color: #222; background: #fff; }}
table {{ border-collapse: collapse; display: block; overflow-x: auto; }}
th, td {{ padding: .2rem .7rem; text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums; border-bottom: 1px solid #ddd; font-weight: 400; }}
th:first-child {{ text-align: left; }}
.best {{ font-weight: 700; }}
svg {{ max-width: 100%; height: auto; }}
pre {{ overflow-x: auto; }}
</style>
<h1>geneoh eval</h1>
{body}
</html>
"""
