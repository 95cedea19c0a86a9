"""The plot of a benchmark."""

import pytest

from geneoh.bench.report import write_plot
from geneoh.bench.run import Bench, Point
from geneoh.evaluation import plots


def test_lines_that_hardly_rise_lie_within_the_plot(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    canvas, made = plots.canvas, []
    monkeypatch.setattr(
        "geneoh.bench.report.plots.canvas",
        lambda *asked: made.append(canvas(*asked)) or made[-1],
    )
    grid = Bench(
        Point(samples=1, preset="fast", device="cpu", threads=1), {"frames": (1, 2)}, False
    )
    measured = {"seconds": 1.0, "processor": 1.0}
    found = {p: {"whole": {**measured, "peak_mb": 349.0 + p.frames}} for p in grid.points()}
    write_plot(tmp_path / "b.png", grid, found, "clock")
    _, peak = made[0][1].reshape(-1)
    assert peak.get_ylim()[0] == 0
    assert peak.get_ylim()[1] > 360
