"""The grid, the processes and the file of the benchmark, with a process that measures nothing."""

import json
from dataclasses import replace

import pytest

from geneoh.bench import measure
from geneoh.bench.run import FULL, QUICK, Bench, Point, run_bench
from geneoh.errors import ConfigError, GeneOHError, InputError

BASE = Point(samples=4, preset="default", device="cpu", threads=1)
GRID = Bench(BASE, {"frames": (60, 180), "samples": (4, 8)}, paper=False)
PROCESS = """
import json, os, sys
point = json.loads(sys.argv[1])
with open({log!r}, "a") as log:
    log.write(sys.argv[1] + "\\n")
print(json.dumps(["fit", 1, 2]))
{how}
print(json.dumps({{"whole": {{"frames": point["frames"], "path": os.environ.get("PYTHONPATH")}}}}))
"""


@pytest.fixture
def processes(tmp_path, monkeypatch):
    """Have points measured by a small process; gives the points that were, and how to do it."""
    log, script = tmp_path / "log", tmp_path / "measure.py"

    def do(how: str) -> None:
        script.write_text(PROCESS.format(log=str(log), how=how))

    def measured() -> list[dict]:
        return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []

    do("")
    monkeypatch.setattr(measure, "__file__", str(script))
    return measured, do


def run(tmp_path, grid=GRID, environment=None, **how):
    return run_bench(grid, environment or {"torch": "2"}, tmp_path / "bench.json", **how)


def test_one_axis_changes_at_a_time_and_no_point_is_measured_twice():
    points = GRID.points()
    assert points == [
        replace(BASE, frames=60),
        BASE,
        replace(BASE, samples=8),
    ]
    both = replace(GRID, paper=True).points()
    assert both[:3] == points
    assert [point.networks for point in both[3:]] == ["paper"]


@pytest.mark.parametrize("axes", [QUICK, FULL])
def test_each_axis_of_the_grids_goes_through_the_point_in_the_middle(axes):
    for axis in axes:
        assert BASE in Bench(BASE, axes).along(axis)


def test_what_the_file_has_is_not_measured_again(processes, tmp_path):
    measured, _ = processes
    found = run(tmp_path)
    assert [found[point]["whole"]["frames"] for point in GRID.points()] == [60, 180, 180]
    assert len(measured()) == 3
    more = replace(GRID, axes={"frames": (60, 180, 600)})
    assert [found["whole"]["frames"] for found in run(tmp_path, more).values()] == [60, 180, 600]
    assert [point["frames"] for point in measured()[3:]] == [600]
    run(tmp_path, fresh=True)
    assert len(measured()) == 7


def test_the_file_says_what_was_asked_and_found_and_where(processes, tmp_path):
    run(tmp_path)
    held = json.loads((tmp_path / "bench.json").read_text())
    assert set(held) == {"generator", "environment", "points"}
    assert held["environment"] == {"torch": "2"}
    for record in held["points"]:
        assert set(record) == {"asked", "load", "found"}
        assert Point(**record["asked"]) in GRID.points()


def test_a_point_that_fails_is_told_and_those_before_are_kept(processes, tmp_path):
    measured, do = processes
    do("assert point['frames'] == 60, 'too long'")
    with pytest.raises(GeneOHError, match=r"frames 180.*AssertionError: too long\)"):
        run(tmp_path)
    do("if point['samples'] == 8: os.kill(os.getpid(), 9)")
    with pytest.raises(GeneOHError, match=r"samples 8.*signal 9, as happens where memory"):
        run(tmp_path)
    do("")
    run(tmp_path)
    assert [(point["frames"], point["samples"]) for point in measured()] == [
        *[(60, 4), (180, 4)],
        *[(180, 4), (180, 8)],
        (180, 8),
    ]


def test_an_interrupt_ends_the_process_and_keeps_what_is_done(processes, tmp_path):
    measured, do = processes
    do("if point['frames'] == 180: import time; sys.stdout.flush(); time.sleep(100)")

    def interrupt(stage: str, done: int, total: int) -> None:
        if "frames 180" in stage and done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, on_progress=interrupt)
    do("")
    run(tmp_path)
    assert [point["frames"] for point in measured()] == [60, 180, 180, 180]


def test_progress_names_the_point_and_its_stage(processes, tmp_path):
    told = []
    run(tmp_path, on_progress=lambda *now: told.append(now))
    first = "3 points, 1: frames 60, samples 4, triangles 2,000, clips 1; "
    assert told[:2] == [(f"{first}start", 0, 1), (f"{first}fit", 1, 2)]


def test_another_version_is_measured_before_this_one_at_each_point(processes, tmp_path):
    other = tmp_path / "other"
    (other / "geneoh").mkdir(parents=True)
    (other / "geneoh" / "__init__.py").touch()
    found = run(tmp_path, replace(GRID, tree=other))
    versions = [point.version for point in found]
    assert [version[:6] for version in versions] == ["other ", ""] * 3
    for point, each in found.items():
        assert (each["whole"]["path"] == str(other)) == bool(point.version)
    assert str(tmp_path) not in json.dumps(versions)


def test_another_version_in_a_folder_of_the_same_name_is_measured_as_well(processes, tmp_path):
    measured, _ = processes
    for number, place in enumerate(("one", "two", "one")):
        other = tmp_path / place / "other"
        (other / "geneoh").mkdir(parents=True, exist_ok=True)
        (other / "geneoh" / "__init__.py").write_text(place)
        run(tmp_path, replace(GRID, tree=other))
        assert len(measured()) == (6, 9, 9)[number]


def test_a_folder_without_another_version_is_refused(processes, tmp_path):
    with pytest.raises(InputError, match="expected a checkout with a folder geneoh"):
        run(tmp_path, replace(GRID, tree=tmp_path / "nothing"))
    assert not processes[0]()


def test_figures_of_another_installation_are_not_mixed_in(processes, tmp_path):
    run(tmp_path)
    before = (tmp_path / "bench.json").read_bytes()
    with pytest.raises(ConfigError, match=r"torch 2 where 3 is asked for\); pass --fresh"):
        run(tmp_path, environment={"torch": "3"})
    assert (tmp_path / "bench.json").read_bytes() == before
    run(tmp_path, environment={"torch": "3"}, fresh=True)
    assert len(processes[0]()) == 6


def test_what_is_no_number_is_null_and_no_other_installation(processes, tmp_path):
    measured, _ = processes
    environment = {"weights": {"error_left": float("nan")}}
    run(tmp_path, environment=environment)
    assert "NaN" not in (tmp_path / "bench.json").read_text()
    before = len(measured())
    run(tmp_path, environment=environment)
    assert len(measured()) == before


@pytest.mark.parametrize(
    "text",
    [
        *("{", "[]", "3", '{"generator": "geneoh realism"}'),
        '{"generator": "geneoh bench", "environment": {}, "points": [1]}',
        '{"generator": "geneoh bench", "environment": 1, "points": []}',
    ],
)
def test_a_file_of_something_else_is_refused_before_the_work(processes, tmp_path, text):
    (tmp_path / "bench.json").write_text(text)
    with pytest.raises(InputError, match="expected a file of `geneoh bench`"):
        run(tmp_path)
    assert (tmp_path / "bench.json").read_text() == text
    assert not processes[0]()
