"""Trajectories of an object or a camera in tables and JSON, as trackers and robots write them.

A row is a pose, object to the hand's frame: a translation and a quaternion in named columns or
fields, such as `tx`, `qw`, `pose.position.x` or `q_RS_w []`, or a matrix in row-major order.
Without names, space-separated rows of 8 numbers have TUM's format (seconds, translation, quaternion
xyzw), rows of 12 KITTI's, both in metres; rows of 16 and blocks of 4 x 4, as in logs of Open3D, are
whole matrices.
"""

import re
from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.files.reading import head_of, separator_of
from geneoh.geometry.mesh import METRES
from geneoh.readers import bop
from geneoh.readers.clock import CLOCK_NAMES, FRAME_NAMES, TIME_NAMES, is_column, unit_by_steps
from geneoh.readers.column_names import UNIT, coordinate_in, plain_name
from geneoh.readers.foreign_files import by_frame, number_in, read_json, read_text, time_in
from geneoh.readers.pose_matching import PoseTrack
from geneoh.readers.pose_tables import (
    TO_NAME,
    Table,
    column_called,
    is_known_column,
    poses_in,
    with_stamps,
)
from geneoh.readers.records import FRAME_LIMIT, Array

PICKLES = (".pkl", ".pickle", ".p")
"""Endings of pickles, which may begin like a text."""

NUMBER = re.compile(r"[-+]?\.?\d|nan\b", re.IGNORECASE)
"""The beginning of a number."""

TUM: list[str] = ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"]
"""Columns of a trajectory in TUM's format, in seconds; a heading may name them."""
LATEST_SECOND = 1e11
"""Largest time in seconds since 1970, in the year 5138: a larger number has another unit."""
HIGHEST_RATE = 2000.0
"""Highest rate of poses in Hz, 1000 times the lowest; the unit of timestamps follows from them."""


def is_text(path: Path) -> bool:
    """Whether a file is a text, judged by its first bytes and its ending."""
    head = head_of(path)
    binary = set(head) - set(range(32, 256)) - set(b"\t\r\n")
    return bool(head) and not binary and path.suffix.lower() not in PICKLES


def read_trajectory(path: Path) -> PoseTrack:
    """The poses in a table or in JSON."""
    is_json = head_of(path).lstrip()[:1] in (b"{", b"[")
    found = table_in_json(read_json(path), path) if is_json else table_in_text(path)
    found = with_stamps(found)
    poses = poses_in(found)
    if not np.isfinite(poses).all((-1, -2)).any():
        raise found.refuse("poses in numbers", f"none in {len(poses)} rows")
    numbers = column_called(found, FRAME_NAMES)
    times = column_called(found, TIME_NAMES)
    seconds = None if times is None else in_seconds(path, *times)
    if numbers is None:
        return PoseTrack(poses, None, seconds, found.unit)
    refuse_fall(path, *numbers)
    at = numbers[1]
    if (at != np.rint(at)).any() or at[-1] - at[0] >= FRAME_LIMIT:
        raise found.refuse("whole numbers of frames", f"{at[0]:g} to {at[-1]:g}")
    first = int(at[0])
    every = np.arange(int(at[-1]) + 1 - first)
    numbered = dict(zip((at - first).astype(int).tolist(), poses, strict=True))
    seconds = None if seconds is None else np.interp(every, at - first, seconds)
    return PoseTrack(by_frame(numbered, len(every), 4, 4), first, seconds, found.unit)


def table_in_text(path: Path) -> Table:
    """The table in a text; a heading above its rows may name the columns."""
    lines = [line.strip() for line in read_text(path).lstrip("\ufeff").splitlines()]
    lines = [line for line in lines if line]
    if lines and {name.strip() for name in lines[0].split(",")} >= bop.COLUMNS:
        return Table(path, list(bop.FIELDS), bop.rows_of_results(lines, path), bop.UNIT)
    start = next((at for at, line in enumerate(lines) if NUMBER.match(line)), len(lines))
    data = [line for line in lines[start:] if line[0] not in "#%"]
    if not data:
        raise InputError(
            f"{path}: expected rows of numbers, got {len(lines)} lines that begin with none; check "
            f"the path, or {TO_NAME}"
        )
    separator = separator_of(lines[max(start - 1, 0)])
    separator = separator if separator in data[0] else None
    rows = [cells_of(line, separator) for line in data]
    heads = [cells_of(line.lstrip("#% "), separator, ",") for line in lines[:start]]
    names = next((head for head in reversed(heads) if any(map(is_known_column, head))), [])
    rows = matrices_of_log(rows)
    widths = {len(row) for row in rows}
    if len(widths) > 1 or (names and {len(names)} != widths):
        got = f"{len(names)} names and " if names else ""
        raise InputError(
            f"{path}: expected rows that are as long as each other and as their heading, got "
            f"{got}rows of {sorted(widths)[:4]} cells; correct the table"
        )
    is_tum = separator is None and widths == {len(TUM)} and names in ([], TUM)
    is_kitti = separator is None and widths == {12} and not names
    if is_tum:
        # some programs write nanoseconds, which as seconds would be millennia
        names = TUM if number_in(rows[0][0]) > LATEST_SECOND else ["timestamp_s", *TUM[1:]]
    dated = {at for at, name in enumerate(names) if plain_name(name) in TIME_NAMES}
    numbers = [
        [time_in(cell) if at in dated else number_in(cell) for at, cell in enumerate(row)]
        for row in rows
    ]
    unit = "m" if is_tum or is_kitti else unit_in(names)
    return Table(path, names, np.array(numbers), unit)


def unit_in(names: Iterable[str]) -> Unit | None:
    """The unit of lengths that a heading names in brackets, if any: that of `p_RS_R_x [m]`."""
    places = (name for name in names if (at := coordinate_in(name)) and not at.is_turn)
    named = {found[1] for name in places if (found := UNIT.search(name))}
    units: list[Unit] = [unit for unit in METRES if unit in named]
    return units[0] if len(units) == 1 else None


def matrices_of_log(rows: list[list[str]]) -> list[list[str]]:
    """The rows of the matrices in a log of Open3D, where three numbers stand above each, and the
    last one may be cut off; rows of other texts as they are."""
    if len(rows) < 5 or any(len(row) != (4 if at % 5 else 3) for at, row in enumerate(rows)):
        return rows
    whole = len(rows) // 5 * 5
    return [row for row in rows[:whole] if len(row) == 4]


def cells_of(line: str, separator: str | None, comma: str = ".") -> list[str]:
    """The cells of a line; commas that do not separate cells are replaced by `comma`."""
    cells = line.split(separator)
    return [(cell if separator == "," else cell.replace(",", comma)).strip(' "') for cell in cells]


def table_in_json(value: Any, path: Path) -> Table:
    """The table in a JSON value: a list of poses, also in a field, or a dict by frame number."""
    beside: dict[str, Any] = {}
    if isinstance(value, dict) and value and all(map(str.isdecimal, value)):
        items = sorted((int(number), each) for number, each in value.items())
        name = "frame" if items[-1][0] < FRAME_LIMIT else "timestamp"
        beside, value = {name: [number for number, _ in items]}, [each for _, each in items]
    elif isinstance(value, dict):
        lists = {name: each for name, each in value.items() if isinstance(each, list) and each}
        value = only_poses(lists, path)
        beside = {name: each for name, each in lists.items() if name in CLOCK_NAMES}
        refuse_other_lengths(beside, len(value), path)
        beside = {name: each for name, each in beside.items() if is_column(each, len(value))}
    if not isinstance(value, list) or not value:
        raise InputError(f"{path}: expected a list of poses, got none; {TO_NAME}")
    return table_of_items(value, path, beside)


def table_of_items(items: list[Any], path: Path, beside: Mapping[str, Any]) -> Table:
    """The table of a list of poses, with further columns `beside` them."""
    poses = [bop.pose_of_image(each, path) for each in items]
    unit = None if all(pose is each for pose, each in zip(poses, items, strict=True)) else bop.UNIT
    rows = [dict(flat_fields(pose, path)) for pose in poses]
    for name, numbers in beside.items():
        rows = [{**row, name: n} for row, n in zip(rows, numbers, strict=True)]
    names = list(dict.fromkeys(chain.from_iterable(rows)))
    numbers = np.array([[row.get(name, np.nan) for name in names] for row in rows])
    return Table(path, names, numbers, unit)


def only_poses(lists: Mapping[str, list[Any]], path: Path) -> list[Any]:
    """The one of some lists that holds poses; if none does, the first whose items are no numbers.

    `InputError` if several do, as for several objects.
    """
    nested = {n: each for n, each in lists.items() if any(isinstance(i, dict | list) for i in each)}
    found = [name for name, each in nested.items() if len(nested) < 2 or holds_poses(each, path)]
    if len(found) > 1:
        raise InputError(
            f"{path}: expected the poses of one object, got {', '.join(found)[:200]}; keep one of "
            "them"
        )
    return nested[found[0]] if found else next(iter(nested.values()), [])


def holds_poses(items: list[Any], path: Path) -> bool:
    """Whether the items of a list can be read as poses."""
    try:
        poses_in(table_of_items(items, path, {}))
    except InputError:
        return False
    return True


def refuse_other_lengths(columns: Mapping[str, Any], count: int, path: Path) -> None:
    """Refuse times and frame numbers of which there are more or fewer than the `count` poses."""
    for name, each in columns.items():
        if is_column(each, len(each)) and len(each) != count:
            raise InputError(
                f"{path}: '{name}' must be one number for each of the {count} poses, got "
                f"{len(each)}; correct it or leave it out"
            )


def flat_fields(value: Any, path: Path, name: str = "") -> Iterable[tuple[str, float]]:
    """The numbers in a nested value with the path to each, such as `pose.position.x`.

    Lists of three are x, y and z; the name of a list of four must contain `xyzw` or `wxyz`.
    """
    if isinstance(value, dict):
        for key, each in value.items():
            yield from flat_fields(each, path, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list):
        flat = np.array(value, dtype=object).ravel().tolist()
        order = next((order for order in ("xyzw", "wxyz") if order in name.lower()), None)
        axes = order if len(flat) == 4 else "xyz" if len(flat) == 3 else None
        if len(flat) == 4 and axes is None and not name:
            raise InputError(
                f"{path}: expected a list of poses, or poses by frame number, got lists of four "
                f"numbers without a name; {TO_NAME}"
            )
        if len(flat) == 4 and axes is None:
            raise InputError(
                f"{path}: '{name}' must say the order of its four numbers, got none; call it "
                f"{name}_xyzw or {name}_wxyz"
            )
        for at, each in enumerate(flat):
            yield f"{name}.{axes[at]}" if axes else f"{name}[{at}]", number_in(str(each))
    else:
        read = time_in if plain_name(name) in TIME_NAMES else number_in
        if not np.isnan(number := read(str(value))):
            yield name, number


def in_seconds(path: Path, name: str, values: Array) -> Array:
    """(T,) times in seconds; the unit follows from their name, else from their steps."""
    refuse_fall(path, name, values)
    unit = TIME_NAMES[name]
    if unit is None and len(values) > 1:
        unit = unit_by_steps(np.diff(values), HIGHEST_RATE / 1000, HIGHEST_RATE)
    return values * (unit or 1.0)


def refuse_fall(path: Path, name: str, values: Array) -> None:
    """Refuse timestamps or frame numbers that do not increase."""
    if len(wrong := np.flatnonzero(np.diff(values) <= 0)):
        before, after = (f"{value:.15g}" for value in values[wrong[0] : wrong[0] + 2])
        raise InputError(
            f"{path}: '{name}' must rise from pose to pose, got {after} after {before}; give the "
            "poses of one object, in order and each frame once"
        )
