"""Trajectories of one object in tables and JSON, as trackers and robots write them.

A row is a pose, object to the hand's frame: a translation and a quaternion in named columns or
fields, such as `tx`, `qw`, `pose.position.x` or `q_RS_w []`, or a matrix in row-major order.
Without names, space-separated rows of 8 numbers have TUM's format (time, translation, quaternion
xyzw), rows of 12 KITTI's; rows of 16 and blocks of 4 x 4 are whole matrices.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.files.reading import head_of, separator_of, unreadable
from geneoh.readers import bop
from geneoh.readers.clock import CLOCK_NAMES, FRAME_NAMES, TIME_NAMES, is_column, unit_by_steps
from geneoh.readers.column_names import (
    Coordinate,
    columns_called,
    coordinate_in,
    plain_name,
    split_stamp,
)
from geneoh.readers.foreign_files import by_frame, number_in, read_json, read_text, time_in
from geneoh.readers.records import FRAME_LIMIT, Array
from geneoh.readers.transforms import rigid_matrices, rigid_of_xyzw

PICKLES = (".pkl", ".pickle", ".p")
"""Endings of pickles, which may begin like a text."""

NUMBER = re.compile(r"[-+]?\.?\d|nan\b", re.IGNORECASE)
"""The beginning of a number."""

TUM: list[str] = ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"]
"""Columns of a trajectory in TUM's format, which has no heading."""
TO_NAME = (
    "name the columns in a heading, such as timestamp,x,y,z,qx,qy,qz,qw, or save (T, 4, 4) "
    "matrices with numpy.save"
)
"""Remedy for a table whose columns are unknown."""

NORM_TOLERANCE = 0.05
"""Largest difference of a quaternion's norm from 1, as rounded numbers may have."""

HIGHEST_RATE = 2000.0
"""Highest rate of poses in Hz, 1000 times the lowest; the unit of timestamps follows from them."""


@dataclass(frozen=True)
class Table:
    """Rows of numbers, NaN where a cell holds none, and the names of the columns, if any."""

    path: Path
    names: list[str]
    rows: Array

    def refuse(self, expected: str, got: str, remedy: str = TO_NAME) -> InputError:
        """The error for a table that is not what it should be."""
        return InputError(f"{self.path}: expected {expected}, got {got}; {remedy}")


def is_text(path: Path) -> bool:
    """Whether a file is a text, judged by its first bytes and its ending."""
    try:
        head = head_of(path)
    except OSError as error:
        raise unreadable(path, error) from None
    binary = set(head) - set(range(32, 256)) - set(b"\t\r\n")
    return bool(head) and not binary and path.suffix.lower() not in PICKLES


def read_trajectory(path: Path) -> tuple[Array, int, Array | None]:
    """(T, 4, 4) poses in a table or in JSON, NaN where one is missing.

    Also the number of the first frame, 0 without frame numbers, and (T,) times in seconds, None
    without timestamps.
    """
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
        return poses, 0, seconds
    refuse_fall(path, *numbers)
    at = numbers[1]
    if (at != np.rint(at)).any() or at[-1] - at[0] >= FRAME_LIMIT:
        raise found.refuse("whole numbers of frames", f"{at[0]:g} to {at[-1]:g}")
    first = int(at[0])
    every = np.arange(int(at[-1]) + 1 - first)
    numbered = dict(zip((at - first).astype(int).tolist(), poses, strict=True))
    seconds = None if seconds is None else np.interp(every, at - first, seconds)
    return by_frame(numbered, len(every), 4, 4), first, seconds


def table_in_text(path: Path) -> Table:
    """The table in a text; a heading above its rows may name the columns."""
    lines = [line.strip() for line in read_text(path).lstrip("\ufeff").splitlines()]
    lines = [line for line in lines if line]
    if lines and bop.are_results(lines[0]):
        return Table(path, list(bop.FIELDS), bop.rows_of_results(lines, path))
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
    widths = {len(row) for row in rows}
    if len(widths) > 1 or (names and {len(names)} != widths):
        got = f"{len(names)} names and " if names else ""
        raise InputError(
            f"{path}: expected rows that are as long as each other and as their heading, got "
            f"{got}rows of {sorted(widths)[:4]} cells; correct the table"
        )
    if not names and separator is None and widths == {len(TUM)}:
        names = TUM
    dated = {at for at, name in enumerate(names) if plain_name(name) in TIME_NAMES}
    numbers = [
        [time_in(cell) if at in dated else number_in(cell) for at, cell in enumerate(row)]
        for row in rows
    ]
    return Table(path, names, np.array(numbers))


def is_known_column(name: str) -> bool:
    """Whether the name of a column denotes a coordinate, a time or a frame number."""
    return coordinate_in(name) is not None or plain_name(name) in CLOCK_NAMES


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
        value = next((each for each in lists.values() if isinstance(each[0], dict | list)), [])
        beside = {name: each for name, each in lists.items() if is_column(each, len(value))}
        beside = {name: each for name, each in beside.items() if name in CLOCK_NAMES}
    if not isinstance(value, list) or not value:
        raise InputError(f"{path}: expected a list of poses, got none; {TO_NAME}")
    rows = [dict(flat_fields(bop.pose_of_image(each, path), path)) for each in value]
    for name, numbers in beside.items():
        rows = [{**row, name: n} for row, n in zip(rows, numbers, strict=True)]
    names = list(dict.fromkeys(chain.from_iterable(rows)))
    return Table(path, names, np.array([[row.get(n, np.nan) for n in names] for row in rows]))


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


def poses_in(table: Table) -> Array:
    """(T, 4, 4) poses of the rows."""
    if table.names:
        return named_poses(table)
    rows, width = table.rows, table.rows.shape[1]
    if width == 4 and len(rows) % 4 == 0:
        return rows.reshape(-1, 4, 4)
    if width in (12, 16):
        return with_bottom_row(rows.reshape(len(rows), -1, 4))
    raise table.refuse(
        "columns with names, rows of 16 or 12 numbers of a matrix, or rows of TUM with spaces "
        "between the numbers",
        f"rows of {width} numbers without names",
    )


def with_bottom_row(matrices: Array) -> Array:
    """(..., 4, 4) from (..., 3, 4) matrices; matrices of four rows stay as they are."""
    if matrices.shape[-2] == 4:
        return matrices
    bottom = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*matrices.shape[:-2], 1, 4))
    return np.concatenate([matrices, bottom], axis=-2)


def named_poses(table: Table) -> Array:
    """(T, 4, 4) poses from named columns: translation and quaternion, or a matrix."""
    coordinates = {name: found for name in table.names if (found := coordinate_in(name))}
    turn = columns_of({name: at for name, at in coordinates.items() if at.is_turn}, "xyzw")
    places = {name: at for name, at in coordinates.items() if not at.is_turn}
    marked = columns_of({name: at for name, at in places.items() if at.is_marked}, "xyz")
    place = marked or columns_of({name: at for name, at in places.items() if not at.of}, "xyz")
    if turn and place:
        rows = table.rows[:, [table.names.index(name) for name in (*turn, *place)]]
        length = np.linalg.norm(rows[:, :4], axis=1)
        if (wrong := (length > 0) & (np.abs(length - 1) > NORM_TOLERANCE)).any():
            first = int(np.flatnonzero(wrong)[0])
            raise table.refuse(
                "quaternions of length 1", f"one of length {length[first]:.3g} in row {first}"
            )
        return rigid_of_xyzw(rows)
    matrices = [found for found in numbers_of_lists(table) if len(found) in (12, 16)]
    turns = [found for found in numbers_of_lists(table) if len(found) == 9]
    if len(matrices) == 1:
        return with_bottom_row(table.rows[:, matrices[0]].reshape(len(table.rows), -1, 4))
    if place and len(turns) == 1:
        at = [table.names.index(name) for name in place]
        return rigid_matrices(table.rows[:, turns[0]].reshape(-1, 3, 3), table.rows[:, at])
    raise table.refuse(
        "columns of one object's place (x, y, z) and quaternion (qx, qy, qz, qw), each once",
        f"{', '.join(table.names)[:200]}",
    )


def numbers_of_lists(table: Table) -> list[list[int]]:
    """Columns of each list (`name[i]`), and in a group of their own those with unknown names."""
    found: dict[str, list[int]] = {}
    for at, name in enumerate(table.names):
        label = name.partition("[")[0] if name.endswith("]") else ""
        if label or not is_known_column(name):
            found.setdefault(label, []).append(at)
    return list(found.values())


def columns_of(coordinates: dict[str, Coordinate], axes: str) -> list[str]:
    """The columns of some axes, in order; none if an axis is missing or occurs twice."""
    by_axis = {axis: [name for name, at in coordinates.items() if at.axis == axis] for axis in axes}
    names = [name for found in by_axis.values() for name in found]
    return names if all(len(found) == 1 for found in by_axis.values()) else []


def with_stamps(table: Table) -> Table:
    """The table, with a time in one column where ROS has split it into two."""
    parts = split_stamp(table.names)
    if parts is None or column_called(table, TIME_NAMES):
        return table
    seconds, nanoseconds = (table.rows[:, table.names.index(part)] for part in parts)
    rows = np.column_stack([table.rows, seconds + 1e-9 * nanoseconds])
    return replace(table, names=[*table.names, "stamp_s"], rows=rows)


def column_called(table: Table, names: Iterable[str]) -> tuple[str, Array] | None:
    """The first of some names whose column holds finite numbers only, and those numbers."""
    called = columns_called(table.names, names)
    found = ((name, table.rows[:, table.names.index(column)]) for name, column in called)
    return next((each for each in found if np.isfinite(each[1]).all()), None)


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
