"""The benchmark: points along axes through a base point, each measured in a separate process.

Each result is written to a JSON file at once; a run that is started again measures the rest.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from geneoh.bench import measure
from geneoh.bench.measure import Found, Tell
from geneoh.choices import PresetName
from geneoh.config import setting_differences
from geneoh.errors import ConfigError, GeneOHError, InputError
from geneoh.files.atomic import write_whole
from geneoh.files.fingerprints import file_digest
from geneoh.files.reading import read_bytes
from geneoh.files.text import json_text, with_null
from geneoh.progress import OnProgress

GENERATOR = "geneoh bench"
TRIANGLES = 2000  # of the example's mesh


@dataclass(frozen=True)
class Point:
    """The settings that one process measures."""

    samples: int
    preset: PresetName
    device: str
    threads: int
    frames: int = 180
    triangles: int = TRIANGLES
    clips: int = 1
    networks: Literal["ours", "paper"] = "ours"
    version: str = ""
    """Name of the folder of another version's checkout, and a digest of its code; empty for the
    running version."""

    def __str__(self) -> str:
        """A short description of the point."""
        if self.networks == "paper":
            return "networks of the paper's sizes"
        sizes = [f"{name} {getattr(self, name):,}" for name in QUICK]
        return ", ".join([*sizes, self.version] if self.version else sizes)


Axes = Mapping[str, tuple[int, ...]]
"""The values of each axis; an axis is a field of `Point`."""
QUICK: Axes = {
    **{"frames": (60, 180, 600), "samples": (1, 4, 8)},
    **{"triangles": (TRIANGLES, 20_000, 100_000), "clips": (1, 4)},
}
FULL: Axes = {
    **{"frames": (60, 180, 600, 6_000, 54_000), "samples": (1, 4, 10, 30, 100)},
    **{"triangles": (TRIANGLES, 8_000, 32_000, 128_000, 500_000), "clips": (1, 10, 100)},
}


@dataclass(frozen=True)
class Bench:
    """All points to measure: each differs from the base point in at most one axis."""

    base: Point
    axes: Axes
    paper: bool = True  # whether networks of the paper's sizes are timed beside ours on one window
    tree: Path | None = None  # checkout of another version, measured before this one at each point

    @cached_property
    def version(self) -> str:
        """The version of the points that are measured with `tree`."""
        if self.tree is None:
            return ""
        code = file_digest((self.tree / "geneoh").rglob("*.py"))
        return f"{self.tree.resolve().name} {code[:8]}"

    def along(self, axis: str) -> list[Point]:
        """The points along an axis, of both versions."""
        values, versions = sorted(set(self.axes[axis])), (self.version, "")
        points = [replace(self.base, version=v, **{axis: x}) for x in values for v in versions]
        return list(dict.fromkeys(points))

    def side_by_side(self) -> tuple[Point, Point]:
        """Two points of one window: with our preset, and with networks of the paper's sizes."""
        ours = replace(self.base, frames=60)
        return ours, replace(ours, samples=1, preset="paper", networks="paper")

    def points(self) -> list[Point]:
        """All points without duplicates, in the order in which they are measured."""
        points = [point for axis in self.axes for point in self.along(axis)]
        return list(dict.fromkeys([*points, *(self.side_by_side() if self.paper else ())]))


def run_bench(
    bench: Bench,
    environment: dict[str, Any],
    output: Path,
    *,
    fresh: bool = False,
    on_progress: OnProgress | None = None,
) -> dict[Point, Found]:
    """Measure all points that are not yet in the JSON file `output`, which is written after each.

    With `fresh`, all points are measured again. `environment` describes this machine and
    installation. `on_progress` gets the point and its stage.

    Raises:
        InputError: `output` is not a file of this function, or `Bench.tree` is not a checkout.
        ConfigError: the file was measured in another environment.
        GeneOHError: a process failed; the points before it are in the file.
    """
    if bench.tree is not None and not (bench.tree / "geneoh" / "__init__.py").is_file():
        raise InputError(f"{bench.tree}: expected a checkout with a folder geneoh; check --tree")
    environment = with_null(environment)
    records = [] if fresh else records_in(output, environment)
    kept = {json.dumps(record["asked"]): record["found"] for record in records}
    points, found = bench.points(), {}
    for number, point in enumerate(points, 1):

        def tell(stage: str, done: int, total: int, about: str = f"{number}: {point}") -> None:
            if on_progress is not None:
                on_progress(f"{len(points)} points, {about}; {stage}", done, total)

        wanted = asdict(point)
        if (key := json.dumps(wanted)) not in kept:
            tell("start", 0, 1)
            kept[key] = measured_apart(point, bench.tree if point.version else None, tell)
            load = round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None
            records.append({"asked": wanted, "load": load, "found": kept[key]})
            held = {"generator": GENERATOR, "environment": environment, "points": records}
            write_whole(output, json_text(held, indent=1) + "\n")
        found[point] = kept[key]
    return found


def records_in(path: Path, environment: dict[str, Any]) -> list[dict[str, Any]]:
    """The records in a file that `run_bench` wrote in this environment; empty without a file."""
    if not path.exists() or not (data := read_bytes(path)):
        return []
    try:
        held = json.loads(data)
        records, before = held["points"], dict(held["environment"])
        sound = held["generator"] == GENERATOR and all(
            {"asked", "found"} <= set(record) for record in records
        )
    except (ValueError, TypeError, LookupError):
        sound, records, before = False, [], {}
    remedy = "pass --fresh to measure anew, or choose another name"
    if not sound:
        raise InputError(f"{path}: expected a file of `{GENERATOR}`, got something else; {remedy}")
    if differ := setting_differences(before, environment):
        raise ConfigError(f"{path}: was measured on another installation ({differ}); {remedy}")
    return records


def measured_apart(point: Point, tree: Path | None, tell: Tell) -> Found:
    """Measure a point in a new process, which prints progress as lists and the result as a dict."""
    program = Path(measure.__file__)
    program = program.with_name("paper.py") if point.networks == "paper" else program
    command = [sys.executable, str(program), json.dumps(asdict(point))]
    with tempfile.TemporaryDirectory() as folder, open(Path(folder, "said"), "w+") as errors:
        environment = {**os.environ, "OMP_NUM_THREADS": str(point.threads), "TMPDIR": folder}
        if tree is not None:
            environment["PYTHONPATH"] = str(tree.resolve())
        how: Any = {"env": environment, "stdout": subprocess.PIPE, "stderr": errors, "text": True}
        found: Found = {}
        with subprocess.Popen(command, **how) as process:
            try:
                for held in map(json.loads, process.stdout or ()):
                    found = held if isinstance(held, dict) else found
                    if isinstance(held, list):
                        tell(*held)
            except BaseException:
                process.kill()
                raise
        if process.returncode == 0 and found:
            return found
        errors.seek(0)
        why = errors.read().strip().rpartition("\n")[2] or "no result"
        if process.returncode < 0:
            why = f"ended by signal {-process.returncode}, as happens where memory runs out"
        raise GeneOHError(f"{point}: could not be measured ({why}); ask for less there")
