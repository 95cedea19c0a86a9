"""The output files of an evaluation: all values as CSV and JSON, a report as Markdown and HTML."""

import html
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from geneoh.bundle import show_text
from geneoh.evaluation import plots, tables
from geneoh.evaluation.protocols.clips import recording_of
from geneoh.evaluation.scores import MEASURES, Score
from geneoh.files.atomic import write_whole
from geneoh.files.journal import SCORED
from geneoh.files.outputs import keep_others
from geneoh.files.text import csv_text, json_text, link

BEST_FILTER_NOTE = (
    "† The filter and size, or offset, that are best on the very clip, chosen with the ground "
    "truth: better than any user can choose."
)
MESH_NOTE = (
    "Methods that give keypoints are measured with the hand of --hand, by default ours, fitted to "
    "them without use of the object; geneoh and the optimisation with their own mesh."
)
PAGE = Path(__file__).parent / "assets" / "report.html"
REPORT_FILES = ("scores.csv", "evaluation.json", "report.md", "report.html")
REASONS = 3  # largest number of reasons for failing that are reported per method


@dataclass(frozen=True)
class Evaluation:
    """All scores of a run, and the settings on which they depend. As text it has the tables."""

    settings: dict[str, Any]
    """Settings, weights and data of the run, and the versions of the packages."""
    command: str
    """The command line that started the run; empty if there was none."""
    methods: tuple[str, ...]
    """Names in the order of the tables."""
    scores: tuple[Score, ...]
    notes: tuple[str, ...] = ()
    pages: tuple[tuple[str, str], ...] = ()
    """Title and file (relative to the report) of each page in 3D."""
    reused: int = 0
    """Number of scores that were taken from an earlier run. It is not in the report, which is the
    same for an interrupted run and an uninterrupted one."""

    _repr_pretty_ = show_text

    def __str__(self) -> str:
        return "\n".join([*tables.as_text(self.blocks), *map("note: {}".format, self.remarks())])

    @property
    def blocks(self) -> list[tables.TableBlock]:
        """The tables, one for each noise."""
        return tables.blocks_of(self.scores, self.methods)

    @property
    def seeds(self) -> int:
        """Number of noise seeds."""
        return len({score.seed for score in self.scores})

    @property
    def bar_lines(self) -> str:
        """Description of the error bars in the bar plots; empty if they have none."""
        recordings = len({recording_of(score.clip) for score in self.scores})
        if recordings >= tables.FEWEST_RECORDINGS:
            return f"{tables.LEVEL:.0%} intervals over {recordings} recordings"
        if self.seeds < 2:
            return ""
        few = f"{recordings} recording{'s' * (recordings != 1)}, too few for intervals"
        return f"the standard deviation over seeds of the mean over {few}"

    def remarks(self) -> Iterator[str]:
        """Remarks below the tables: what means, intervals, measures and gaps are, and failures."""
        if self.seeds > 1:
            yield f"Mean ± standard deviation over {self.seeds} seeds of the mean over clips."
        if (tau := tables.seed_agreement(self.scores)) is not None:
            yield (
                "Kendall's tau of the ranks by MPJPE, least over pairs of seeds: "
                f"{tau:.2f} (1: the same order for every seed)."
            )
        if self.bar_lines:
            yield f"Black lines in the report's bars: {self.bar_lines}."
        if any("†" in method for method in self.methods):
            yield BEST_FILTER_NOTE
        yield MESH_NOTE
        there = dict.fromkeys(measure for block in self.blocks for measure in block.measures)
        for measure in there:
            yield f"{measure.title}: {measure.meaning}; {measure.better} is better."
        for block in self.blocks:
            yield from block.gaps()
        yield from self.failures()
        yield from self.notes

    def failures(self) -> Iterator[str]:
        """The first reasons why each method failed, each once, with all methods it concerns."""
        found: dict[str, dict[str, None]] = {}
        for score in self.scores:
            if score.failed:
                found.setdefault(score.failed, {})[score.method] = None
        reported: Counter[str] = Counter()
        for reason, methods in found.items():
            if any(reported[method] < REASONS for method in methods):
                reported.update(methods.keys())
                yield f"{', '.join(methods)}: {reason}"


def keep_other_reports(folder: Path) -> None:
    """`InputError` if a folder without a record holds files of the report's names, not ours."""
    if not (folder / SCORED).is_file():
        keep_others(*(folder / name for name in REPORT_FILES))


def write_report(evaluation: Evaluation, folder: Path | str) -> list[Path]:
    """Write scores.csv, evaluation.json, report.md and report.html; returns their paths."""
    folder = Path(folder)
    markdown = "\n".join(as_report(evaluation)) + "\n"
    texts = (scores_as_csv(evaluation), report_as_json(evaluation), markdown, as_page(evaluation))
    for name, text in zip(REPORT_FILES, texts, strict=True):
        write_whole(folder / name, text)
    return [folder / name for name in REPORT_FILES]


def scores_as_csv(evaluation: Evaluation) -> str:
    """One row per score: case, method, all measures, seconds, and the reason of a failure."""
    keys = [measure.key for measure in MEASURES]
    rows: list[list[Any]] = [
        ["dataset", "clip", "noise", "seed", "method", *keys, "seconds", "failed"]
    ]
    for score in evaluation.scores:
        values = [score.values.get(key) for key in keys]
        rows.append([*score.key, *values, score.seconds, score.failed])
    return csv_text(rows)


def report_as_json(evaluation: Evaluation) -> str:
    """The settings needed to repeat the evaluation, all tables and all scores."""
    whole = {
        "command": evaluation.command,
        "settings": evaluation.settings,
        "remarks": list(evaluation.remarks()),
        "measures": {measure.key: measure.unit for measure in MEASURES},
        "tables": [asdict(block) for block in evaluation.blocks],
        "scores": [asdict(score) for score in evaluation.scores],
    }
    return json_text(whole, indent=1)


def as_report(evaluation: Evaluation) -> Iterator[str]:
    """The tables as Markdown, with command, remarks, versions and weights."""
    yield from ("# geneoh eval", "", f"`{evaluation.command}`", "")
    yield from tables.as_markdown(evaluation.blocks)
    yield ""
    yield from (f"- {remark}" for remark in evaluation.remarks())
    yield from ("", made_with(evaluation.settings))


def made_with(settings: Mapping[str, Any]) -> str:
    """A sentence with the versions of packages and the weights in the settings of a run."""
    versions, weights = (settings.get(name, {}) for name in ("versions", "weights"))
    parts = [f"{name} {version}" for name, version in versions.items()]
    parts += [f"{name} weights {digest}" for name, digest in weights.items()]
    return f"Made with {', '.join(parts)}."


def as_page(evaluation: Evaluation) -> str:
    """The report as a self-contained HTML page."""
    blocks = evaluation.blocks
    parts = [f"<p><code>{html.escape(evaluation.command)}</code></p>"]
    for block in blocks:
        parts += [f"<h2>{html.escape(block.title)}</h2>", as_html_table(block)]
    remarks = "".join(f"<li>{html.escape(remark)}</li>" for remark in evaluation.remarks())
    parts.append(f"<ul>{remarks}</ul>")
    if plots.available():
        parts += plots_of(evaluation, blocks)
    else:
        parts.append(f"<p>For plots: <code>{html.escape(plots.EXTRA)}</code></p>")
    if evaluation.pages:
        links = "".join(f"<li>{link(file, title)}</li>" for title, file in evaluation.pages)
        parts.append(f"<h2>Clips in 3D</h2><ul>{links}</ul>")
    settings = html.escape(json_text(evaluation.settings, indent=1))
    parts.append(f"<details><summary>settings</summary><pre>{settings}</pre></details>")
    return PAGE.read_text("utf-8").replace("<!-- body -->", "\n".join(parts))


def as_html_table(block: tables.TableBlock) -> str:
    """The HTML table of one noise; the best value of a column is bold."""
    heads = "".join(f"<th>{m.title}<br>{m.unit}</th>" for m in block.measures)
    lines = [f"<tr><th></th>{heads}</tr>"]
    for name, cells in block.lines(block.measures):
        texts = [f"<td{' class=best' * best}>{text}</td>" for text, best in cells]
        lines.append(f"<tr><th>{html.escape(name)}</th>{''.join(texts)}</tr>")
    return f"<table>{''.join(lines)}</table>"


def plots_of(evaluation: Evaluation, blocks: list[tables.TableBlock]) -> Iterator[str]:
    """Plots: bars over all noises; per noise, errors by frame, by joint and against the input's."""
    there = {key for block in blocks for cells in block.cells.values() for key in cells}
    lines = evaluation.bar_lines and f", with {evaluation.bar_lines}"
    for key in ("mpjpe_mm", "depth_mm"):
        if key in there:
            yield f"<h2>{plots.title_of(key)}, all methods{lines}</h2>{plots.bars(blocks, key)}"
    if "mpjpe_mm" not in there:
        return
    for block in blocks:
        place, methods = (block.dataset, block.noise), list(block.cells)
        scores = [s for s in evaluation.scores if (s.dataset, s.noise) == place]
        yield f"<h2>{html.escape(block.title)}: error over time</h2>"
        yield plots.mean_errors(scores, methods, "frame")
        yield "<h3>error per joint</h3>" + plots.mean_errors(scores, methods, "joint")
        yield "<h3>before against after; above the line cleaning made it worse</h3>"
        yield plots.before_after(scores, methods)
