"""The report's plots as SVG text, by matplotlib, which is an optional extra.

Plain functions of scores and blocks; the same input gives the same bytes.
"""

import io
import re
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from statistics import fmean
from typing import Any

from geneoh.evaluation.scores import MEASURES, Measure, Score
from geneoh.evaluation.tables import Block
from geneoh.hand.skeleton import FINGERS

EXTRA = 'pip install "geneoh[plots]"'
"""What brings matplotlib."""
STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: small, and searchable
    "svg.hashsalt": "geneoh",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
OURS = "geneoh"
"""How the names of our rows begin; they are drawn in full colour, the others beside them."""


def available() -> bool:
    """Whether plots can be drawn."""
    return find_spec("matplotlib") is not None


def bars(blocks: Sequence[Block], key: str) -> str:
    """One measure of every row under every noise, with its 95% interval."""
    (measure,) = (measure for measure in MEASURES if measure.key == key)
    rows = list(dict.fromkeys(row for block in blocks for row in block.rows))
    figure, axes = canvas(7.6, 0.9 + 0.17 * len(rows) * len(blocks) + 0.25 * len(blocks))
    place, ticks, names = 0.0, [], []
    for block in blocks:
        for row in rows:
            cell = block.rows.get(row, {}).get(key)
            if cell is None:
                continue
            axes.barh(place, cell.mean, color=colour(row, rows), height=0.8)
            if cell.low is not None and cell.high is not None:
                axes.plot([cell.low, cell.high], [place, place], color="black", lw=1)
            ticks.append(place)
            names.append(f"{block.noise}: {row}")
            place += 1
        place += 0.8
    axes.set_yticks(ticks, names)
    axes.invert_yaxis()
    axes.set_xlabel(titled(measure))
    return svg(figure)


def over_time(scores: Iterable[Score], rows: Sequence[str]) -> str:
    """Mean keypoint error of each frame, over all clips and seeds."""
    scores = list(scores)
    figure, axes = canvas(7.6, 3.2)
    for row in rows:
        tracks = [score.error_by_frame_mm for score in scores if score.row == row]
        means = column_means([track for track in tracks if track])
        draw_line(axes, range(len(means)), means, row, rows)
    axes.set_xlabel("frame of the clip")
    axes.set_ylabel("keypoint error, mm")
    axes.set_ylim(bottom=0)
    return svg(figure, legend=True)


def per_joint(scores: Iterable[Score], rows: Sequence[str]) -> str:
    """Mean error of each keypoint, over all clips and seeds."""
    scores = list(scores)
    figure, axes = canvas(7.6, 3.2)
    for row in rows:
        tracks = [score.error_by_joint_mm for score in scores if score.row == row]
        means = column_means([track for track in tracks if track])
        draw_line(axes, range(len(means)), means, row, rows, marker=".")
    fingers = (FINGERS[-1], *(FINGERS[i] for i in (0, 1, 3, 2)))
    parts = ("base", "2", "3", "tip")
    names = ["wrist", *(f"{finger} {part}" for finger in fingers for part in parts)]
    axes.set_xticks(range(21), names, rotation=90)
    axes.set_ylabel("error, mm")
    axes.set_ylim(bottom=0)
    return svg(figure, legend=True)


def before_after(scores: Iterable[Score], rows: Sequence[str], key: str = "mpjpe_mm") -> str:
    """Each case: its input's error against the row's; above the line cleaning made it worse."""
    (measure,) = (measure for measure in MEASURES if measure.key == key)
    by_case: dict[tuple[Any, ...], dict[str, float]] = {}
    for score in scores:
        if (value := score.values.get(key)) is not None:
            by_case.setdefault(score.key[:-1], {})[score.row] = value
    figure, axes = canvas(7.6, 4.4)
    axes.set_aspect("equal")
    most = 0.0
    for row in rows:
        pairs = [
            (found["input"], found[row])
            for found in by_case.values()
            if row != "input" and row in found and "input" in found
        ]
        if pairs:
            before, after = zip(*pairs, strict=True)
            most = max(most, *before, *after)
            axes.scatter(before, after, s=14, color=colour(row, rows), label=row, alpha=0.8)
    axes.plot([0, 1.05 * most], [0, 1.05 * most], color="black", lw=0.8)
    axes.set_xlabel(f"input, {titled(measure)}")
    axes.set_ylabel(f"cleaned, {titled(measure)}")
    return svg(figure, legend=True)


def titled(measure: Measure) -> str:
    """A measure's name for an axis."""
    return f"{measure.title}, {measure.unit}"


def column_means(tracks: Sequence[Sequence[float | None]]) -> list[float]:
    """Mean of each column over tracks that may differ in length; NaN without any number."""
    length = max(map(len, tracks), default=0)
    columns = [
        [track[i] for track in tracks if i < len(track) and track[i] is not None]
        for i in range(length)
    ]
    return [
        fmean(x for x in column if x is not None) if column else float("nan") for column in columns
    ]


def colour(row: str, rows: Sequence[str]) -> Any:
    """A row's colour: the input grey, ours dark to be found at once, the others pale."""
    import matplotlib

    if row == "input":
        return "0.55"
    ours = [name for name in rows if name.startswith(OURS)]
    if row in ours:
        return matplotlib.colormaps["Set1"](ours.index(row) % 9)
    others = [name for name in rows if name not in ours and name != "input"]
    return matplotlib.colormaps["Set2"](others.index(row) % 8)


def draw_line(
    axes: Any, at: Iterable[int], values: list[float], row: str, rows: Sequence[str], **style: Any
) -> None:
    """One row's line; ours thicker. A row without values has none."""
    if values:
        width = 2.2 if row.startswith(OURS) else 1.1
        axes.plot(list(at), values, label=row, color=colour(row, rows), lw=width, **style)


def canvas(width: float, height: float) -> tuple[Any, Any]:
    """A figure of that many inches without any window system, and its axes."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasSVG(figure)
        return figure, figure.add_subplot()


def svg(figure: Any, *, legend: bool = False) -> str:
    """The figure as an <svg> element to stand in a page."""
    import matplotlib

    if legend and figure.axes[0].get_legend_handles_labels()[0]:
        figure.legend(loc="outside right upper", fontsize=8)
    stream = io.StringIO()
    with matplotlib.rc_context(STYLE):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    found = re.search(r"<svg.*</svg>", stream.getvalue(), re.DOTALL)
    assert found is not None, "matplotlib writes an svg element"
    return found.group()
