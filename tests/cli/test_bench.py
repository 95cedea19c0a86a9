"""`geneoh bench` as its users run it."""

import json
from functools import partial

import pytest

from geneoh.bench import measure
from geneoh.bench.run import Point
from geneoh.files.outputs import is_ours

QUICK = ("bench", "--preset", "fast", "--threads", "1", "--no-paper", "--frames", "4")
PART = {"seconds": 2.0, "processor": 1.0, "peak_mb": 512.0}
STEP = {"steps": 9, "parameters": 34_200_000, "step": {"seconds": 0.5, "processor": 0.25}}
PROCESS = f"""
import json, sys
found = dict.fromkeys(("whole", "motion", "spatial", "temporal", "fit"), {PART!r})
if json.loads(sys.argv[1])["networks"] == "paper":
    found = {{stage: {PART!r} | {STEP!r} for stage in ("motion", "spatial", "temporal")}}
    found["whole"] = {PART!r} | {{"parameters": 100_000_000, "points_timed": 20}}
print(json.dumps(found))
"""


@pytest.fixture
def faked(tmp_path, monkeypatch):
    """Have all points measured at once, with the same figures."""
    for program in ("measure.py", "paper.py"):
        (tmp_path / program).write_text(PROCESS)
    monkeypatch.setattr(measure, "__file__", str(tmp_path / "measure.py"))


@pytest.mark.slow
def test_a_point_is_measured_from_end_to_end(geneoh, tmp_path, monkeypatch):
    monkeypatch.setattr("geneoh_cli.commands.bench.Point", partial(Point, frames=4))
    result = geneoh(*QUICK, "--by", "processor", "--plot", "b.png")
    assert "wrote bench.json and b.png" in result.output
    held = json.loads((tmp_path / "bench.json").read_text())
    assert held["generator"] == "geneoh bench"
    assert {"cores", "gpus", "versions", "weights"} == set(held["environment"])
    (record,) = held["points"]
    assert (record["asked"]["frames"], record["asked"]["clips"]) == (4, 1)
    found = record["found"]
    assert set(found) == {"whole", "motion", "spatial", "temporal", "fit"}
    for part in found.values():
        assert 100 < part["peak_mb"] <= found["whole"]["peak_mb"] < 4000
        assert 0 < part["processor"] <= found["whole"]["processor"]
    monkeypatch.setattr(measure, "__file__", "nothing.py")
    again = geneoh(*QUICK, "--by", "processor")
    assert again.output.replace("bench.json", "") in result.output.replace(
        "bench.json and b.png", ""
    )


def test_tables_have_frames_a_second_and_memory_of_each_stage(geneoh, faked):
    result = geneoh("bench", "--frames", 60, "--frames", 600, "--batch", 10, "--threads", 1)
    lines = result.output.splitlines()
    assert "| frames | whole | motion | spatial | temporal | fit |" in lines
    assert "| 600 | " + " | ".join(["300.0 (512)"] * 5) + " |" in lines
    assert "| 10 | " + " | ".join(["900.0 (512)"] * 5) + " |" in lines
    assert "SpatialDiff's on 20 of 2,000 points" in result.output
    assert "extrapolated" in result.output
    assert "| motion | 34.2 | 9 | 0.5 | 2.0 | 2.00 |" in lines
    assert "| whole | 100.0 |   |   | 2.0 | 2.00 |" in lines


def test_without_an_axis_the_small_grid_is_measured(geneoh, faked, tmp_path):
    geneoh("bench", "--plot", "b.png")
    held = json.loads((tmp_path / "bench.json").read_text())
    assert len(held["points"]) == 9
    assert is_ours(tmp_path / "bench.json")
    assert is_ours(tmp_path / "b.png")
    geneoh("bench", "--plot", "b.png", "--by", "processor")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("-o", "none/b.json"), "none/b.json: cannot be written"),
        (("-o", "b.npz"), "b.npz: expected .json"),
        (("-o", "my.json"), "was not written by geneoh; pass --overwrite"),
        (("--plot", "b.svg"), "b.svg: expected .png"),
        (("--plot", "none/b.png"), "none/b.png: cannot be written"),
        (("--frames", "0"), "--frames"),
        (("--samples", "-1"), "--samples"),
        (("--triangles", "10"), "2000<=x<=2000000"),
        (("--batch", "x"), "--batch"),
        (("--full", "--frames", "60"), "--full is a grid of its own; leave it or frames out"),
        (("--device", "nothing"), "--device nothing"),
        (("--tree", "nothing"), "nothing: expected a checkout"),
        (("--preset", "best"), "best"),
    ],
)
def test_what_cannot_be_done_is_refused_before_the_work(
    geneoh, tmp_path, monkeypatch, given, words
):
    monkeypatch.setattr("geneoh.bench.run.measured_apart", None)
    (tmp_path / "my.json").write_text("precious")
    result = geneoh("bench", *given, code=2)
    (last,) = result.stderr.strip().splitlines()
    assert words in last
    assert (tmp_path / "my.json").read_text() == "precious"
    assert not (tmp_path / "bench.json").exists()


def test_a_plot_without_matplotlib_is_refused_before_the_work(geneoh, tmp_path, monkeypatch):
    monkeypatch.setattr("geneoh.evaluation.plots.available", lambda: False)
    result = geneoh("bench", "--plot", "b.png", code=2)
    assert "needs matplotlib; pip install" in result.stderr
    assert not (tmp_path / "bench.json").exists()
