"""The report's plots as deterministic SVG text, by matplotlib, which is an optional extra."""

import io
import re
from collections.abc import Sequence
from importlib.util import find_spec
from itertools import zip_longest
from statistics import fmean
from typing import Any, Literal

from geneoh.evaluation.scores import MEASURES, Score
from geneoh.evaluation.tables import TableBlock
from geneoh.hand.skeleton import KEYPOINT_FINGERS

EXTRA = 'pip install "geneoh[plots]"'  # installs matplotlib
STYLE: Any = {
    "svg.fonttype": "none",  # keeps text as text, which is small and searchable
    "svg.hashsalt": "geneoh",  # for the same ids in every run
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
OURS = "geneoh"  # prefix of the names of our methods, which have strong colours; others are pale
WIDTH = 7.6  # width of every plot in inches
BAR, GAP = 0.17, 0.25  # height in inches of a bar, and of the gap between two noises


def available() -> bool:
    """Whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def bars(blocks: Sequence[TableBlock], key: str) -> str:
    """Bar plot of one measure of all methods and noises, with its interval or else deviation."""
    methods = list(dict.fromkeys(method for block in blocks for method in block.cells))
    figure, axes = canvas(0.9 + BAR * len(methods) * len(blocks) + GAP * len(blocks))
    place, ticks, names = 0.0, [], []
    for block in blocks:
        for method in methods:
            cell = block.cells.get(method, {}).get(key)
            if cell is None:
                continue
            axes.barh(place, cell.mean, color=colour(method, methods), height=0.8)
            if (ends := cell.ends) is not None:
                axes.plot(ends, [place] * 2, color="black", lw=1)
            ticks.append(place)
            names.append(f"{block.noise}: {method}")
            place += 1
        place += 0.8
    axes.set_yticks(ticks, names)
    axes.invert_yaxis()
    axes.set_xlabel(title_of(key))
    return svg(figure)


def mean_errors(
    scores: Sequence[Score], methods: Sequence[str], over: Literal["frame", "joint"]
) -> str:
    """Line plot of the mean error of each frame or each keypoint, over all clips and seeds."""
    figure, axes = canvas(3.2)
    style: Any = {"marker": "."} if over == "joint" else {}
    for method in methods:
        made = [score for score in scores if score.method == method]
        tracks = [getattr(score, f"error_by_{over}_mm") for score in made]
        if means := column_means(tracks):
            width = 2.2 if method.startswith(OURS) else 1.1
            axes.plot(means, label=method, color=colour(method, methods), lw=width, **style)
    if over == "joint":
        parts = ("base", "2", "3", "tip")
        names = ["wrist", *(f"{finger} {part}" for finger in KEYPOINT_FINGERS for part in parts)]
        axes.set_xticks(range(21), names, rotation=90)
    else:
        axes.set_xlabel("frame of the clip")
    axes.set_ylabel("keypoint error, mm")
    axes.set_ylim(bottom=0)
    return svg(figure, legend=True)


def before_after(scores: Sequence[Score], methods: Sequence[str]) -> str:
    """Scatter plot of each case's error before and after cleaning; above the line it grew."""
    key = "mpjpe_mm"
    measured = [score for score in scores if score.values.get(key) is not None]
    inputs = {score.case_key: score.values[key] for score in measured if score.method == "input"}
    figure, axes = canvas(4.4)
    axes.set_aspect("equal")
    most = 0.0
    for method in methods:
        pairs = [
            (inputs[score.case_key], score.values[key])
            for score in measured
            if score.method == method != "input" and score.case_key in inputs
        ]
        if pairs:
            before, after = zip(*pairs, strict=True)
            most = max(most, *before, *after)
            style = {"color": colour(method, methods), "label": method}
            axes.scatter(before, after, s=14, alpha=0.8, **style)
    axes.plot([0, 1.05 * most], [0, 1.05 * most], color="black", lw=0.8)
    axes.set(xlabel=f"input, {title_of(key)}", ylabel=f"cleaned, {title_of(key)}")
    return svg(figure, legend=True)


def title_of(key: str) -> str:
    """Title of an axis: a measure with its unit."""
    return next(f"{each.title}, {each.unit}" for each in MEASURES if each.key == key)


def column_means(tracks: Sequence[Sequence[float | None]]) -> list[float]:
    """Mean of each column over tracks that may differ in length; NaN without any value."""
    columns = [[x for x in column if x is not None] for column in zip_longest(*tracks)]
    return [fmean(column) if column else float("nan") for column in columns]


def colour(method: str, methods: Sequence[str]) -> Any:
    """Colour of a method: grey for the input, strong for ours, pale for the others."""
    import matplotlib

    if method == "input":
        return "0.55"
    ours = [name for name in methods if name.startswith(OURS)]
    if method in ours:
        return matplotlib.colormaps["Set1"](ours.index(method) % 9)
    others = [name for name in methods if name not in ours and name != "input"]
    return matplotlib.colormaps["Set2"](others.index(method) % 8)


def canvas(height: float, rows: int = 1, columns: int = 1) -> tuple[Any, Any]:
    """A figure of this height in inches, without a window, and its axes."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasSVG(figure)
        return figure, figure.subplots(rows, columns)


def svg(figure: Any, *, legend: bool = False) -> str:
    """The figure as an <svg> element for a page."""
    import matplotlib

    if legend and figure.axes[0].get_legend_handles_labels()[0]:
        figure.legend(loc="outside right upper", fontsize=8)
    stream = io.StringIO()
    with matplotlib.rc_context(STYLE):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    found = re.search(r"<svg.*</svg>", stream.getvalue(), re.DOTALL)
    assert found is not None, "matplotlib writes an svg element"
    return found.group()
