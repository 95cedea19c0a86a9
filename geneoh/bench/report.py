"""The results of a benchmark as Markdown tables and as a plot."""

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from geneoh.bench.measure import Found
from geneoh.bench.paper import FRAMES, POINTS
from geneoh.bench.run import Bench, Point
from geneoh.errors import ConfigError
from geneoh.evaluation import plots
from geneoh.files.atomic import write_whole
from geneoh.files.outputs import check_ending

PARTS = ("whole", "motion", "spatial", "temporal", "fit")
CLOCKS = {"clock": "seconds", "processor": "processor"}
"""The key of a measured time in `Found`, by the name of its clock."""


def tables(bench: Bench, found: Mapping[Point, Found], by: str) -> Iterator[str]:
    """Tables of frames per second with peak memory along each axis, then ours beside the paper's.

    `by` is "clock" for wall time, or "processor" for processor time, which other work on the
    machine hardly changes.
    """
    base, clock = bench.base, CLOCKS[by]
    yield (
        f"Frames a second by the {by} (highest memory so far, MB), preset {base.preset}, "
        f"{base.device}, threads {base.threads}; one axis at a time around {base}"
    )
    for axis in bench.axes:
        yield from ("", row(axis, *PARTS), row(*["--:"] * (1 + len(PARTS))))
        for point in bench.along(axis):
            name = f"{getattr(point, axis):,} {point.version}".strip()
            yield row(name, *(cell(point, found[point].get(part), clock) for part in PARTS))
    if bench.paper:
        ours, paper = (found[point] for point in bench.side_by_side())
        yield from beside_the_paper(ours, paper, clock)


def row(*cells: str) -> str:
    """One row of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def frames_a_second(point: Point, part: dict[str, Any], clock: str) -> float:
    """Frames per second: the frames of all clips over the time of one part of the work."""
    return point.frames * point.clips / max(part[clock], 1e-9)


def cell(point: Point, part: dict[str, Any] | None, clock: str) -> str:
    """A table cell with frames per second and peak memory in MB of one part of the work."""
    if part is None:
        return "-"
    return f"{frames_a_second(point, part, clock):,.1f} ({part['peak_mb']:,.0f})"


def beside_the_paper(ours: Found, paper: Found, clock: str) -> Iterator[str]:
    """Seconds for one window with the preset and with networks of the paper's sizes."""
    yield (
        f"\nOne window of {FRAMES} frames: this preset, and one sample with networks of the sizes "
        "that the paper publishes. These are extrapolated: one step was timed, SpatialDiff's on "
        f"{paper['whole']['points_timed']} of {POINTS:,} points, times the steps.\n"
    )
    yield row("stage", "parameters, M", "steps", "s a step", "paper's sizes, s", "this preset, s")
    yield row("---", *["--:"] * 5)
    for stage, theirs in paper.items():
        size = f"{theirs['parameters'] / 1e6:.1f}"
        steps, step = (
            (theirs["steps"], f"{theirs['step'][clock]:.3g}") if stage != "whole" else "  "
        )
        own = f"{ours[stage][clock]:.2f}" if stage in ours else "-"
        yield row(stage, size, str(steps), step, f"{theirs[clock]:,.1f}", own)


def check_plot(path: Path | None) -> list[Path]:
    """A list with the file of the plot, empty without one; refused if its ending is not `.png`, or
    if matplotlib is not installed."""
    if path is None:
        return []
    check_ending(path, (".png",))
    if not plots.available():
        raise ConfigError(f"--plot {path} needs matplotlib; {plots.EXTRA}")
    return [path]


def write_plot(path: Path, bench: Bench, found: Mapping[Point, Found], by: str) -> None:
    """Plot frames per second and peak memory along each axis into a PNG."""
    figure, grid = plots.canvas(2.3 * len(bench.axes), len(bench.axes), 2)
    for axis, (speed, peak) in zip(bench.axes, grid.reshape(-1, 2), strict=True):
        points = [point for point in bench.along(axis) if not point.version]
        for part in PARTS:
            held = [(point, found[point][part]) for point in points if part in found[point]]
            at = [getattr(point, axis) for point, _ in held]
            style: Any = {"label": part, "marker": ".", "lw": 2.2 if part == "whole" else 1.1}
            speed.plot(at, [frames_a_second(*each, CLOCKS[by]) for each in held], **style)
            peak.plot(at, [values["peak_mb"] for _, values in held], **style)
        for plot, title in ((speed, "frames a second"), (peak, "highest so far, MB")):
            plot.set(xlabel=axis, ylabel=title, xscale="log", ylim=(0, 1.08 * plot.dataLim.y1))
            plot.set_xticks([getattr(p, axis) for p in points], minor=False)
            plot.xaxis.set_major_formatter("{x:,.0f}")
            plot.minorticks_off()
    lines = figure.axes[0].get_legend_handles_labels()
    figure.legend(*lines, loc="outside upper center", ncols=len(PARTS))
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=120, metadata={"Software": "geneoh"})
    write_whole(path, stream.getvalue())
