"""The summary of a batch as CSV and HTML: failed clips first, then the hands that moved most."""

import html
from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import Any

from geneoh.batch.cleaning import CleaningOutcome
from geneoh.errors import numbered
from geneoh.files.atomic import write_whole
from geneoh.files.text import csv_text, link
from geneoh.metrics.report import LINES, format_number

SUMMARY_FILES = ("summary.csv", "summary.html")
PAGE = Path(__file__).parent / "assets" / "summary.html"
PLAIN = ("clip", "file", "side", "frames", "filled", "moved_mm")
MEASURES = tuple(name for name, _, _ in LINES)


def write_summary(outcomes: Iterable[CleaningOutcome], folder: Path) -> None:
    """Write summary.csv and summary.html, with one row per hand of a result or failed clip."""
    rows = sorted((row for outcome in outcomes for row in _rows_of(outcome)), key=rank)
    write_whole(folder / SUMMARY_FILES[0], _as_csv(rows))
    write_whole(folder / SUMMARY_FILES[1], _as_page(rows))


def _rows_of(outcome: CleaningOutcome) -> list[dict[str, Any]]:
    """One row per hand, or a single row for a clip that failed."""
    if outcome.failed:
        return [{"clip": outcome.clip, "failed": outcome.failed}]
    return [{"clip": outcome.clip, **hand} for hand in outcome.hands]


def rank(row: dict[str, Any]) -> tuple[float, str, str]:
    """Sort key of a row: failed clips first, then by the distance moved, largest first."""
    moved = row.get("moved_mm", float("inf"))
    return (-moved if isfinite(moved) else float("-inf"), row["clip"], row.get("side", ""))


def _as_csv(rows: list[dict[str, Any]]) -> str:
    """The rows as CSV: each measure before and after, notes, and why a clip failed."""
    both = [f"{name}_{when}" for name in MEASURES for when in ("before", "after")]
    lines: list[list[Any]] = [[*PLAIN, *both, "notes", "failed"]]
    for row in rows:
        values = [row.get(when, {}).get(name) for name in MEASURES for when in ("before", "after")]
        notes = "; ".join(row.get("notes", ()))
        lines.append([*(row.get(name) for name in PLAIN), *values, notes, row.get("failed")])
    return csv_text(lines)


def _as_page(rows: list[dict[str, Any]]) -> str:
    """The rows as a self-contained HTML page."""
    failed = [row for row in rows if "failed" in row]
    there = [row for row in rows if "failed" not in row]
    hands = numbered(len(there), "hand")
    clips = numbered(len({row["clip"] for row in there}), "clip")
    parts = [
        f"<p>{clips} cleaned ({hands}), {len(failed)} failed. "
        "Each measure stands before and after cleaning.</p>"
    ]
    if failed:
        lines = [
            f"<tr><th>{html.escape(row['clip'])}<td>{html.escape(row['failed'])}" for row in failed
        ]
        parts.append(f"<h2>Failed</h2><table class=words>{''.join(lines)}</table>")
    if there:
        parts.append(f"<h2>Cleaned, what changed most first</h2>{as_table(there)}")
    return PAGE.read_text("utf-8").replace("<!-- body -->", "\n".join(parts))


def as_table(rows: list[dict[str, Any]]) -> str:
    """HTML table of the clean hands; a bar shows how far each moved, relative to the largest."""
    heads = "".join(f"<th colspan=2>{name}{f', {unit}' * bool(unit)}" for _, name, unit in LINES)
    lines = [f"<tr><th>clip<th>hand<th>frames<th colspan=2>moved, mm{heads}<th class=words>notes"]
    most = max((row["moved_mm"] for row in rows if isfinite(row["moved_mm"])), default=0.0)
    for row in rows:
        moved = row["moved_mm"]
        share = 100 * moved / most if most and isfinite(moved) else 0
        linked = link(row["file"], row["clip"])
        cells = [f"<th>{linked}<td>{row['side']}<td>{row['frames']}<td>{format_number(moved)}"]
        cells.append(f"<td class=bar><i style='width:{share:.0f}%'></i>")
        for name, _, unit in LINES:
            scale = 100 if unit == "%" else 1
            for when in ("before", "after"):
                cells.append(f"<td>{format_number(scale * row[when][name])}")
        notes = "; ".join(row["notes"])
        shown = f"<details><summary>{len(row['notes'])}</summary>{html.escape(notes)}</details>"
        lines.append(f"<tr>{''.join(cells)}<td class=words>{shown if notes else ''}")
    return f"<table>{''.join(lines)}</table>"
