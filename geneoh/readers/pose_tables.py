"""Tables of one object's poses: rows of numbers under names, and the matrices that they are."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.readers.clock import CLOCK_NAMES, TIME_NAMES
from geneoh.readers.column_names import (
    Coordinate,
    columns_called,
    coordinate_in,
    plain_name,
    split_stamp,
)
from geneoh.readers.records import Array
from geneoh.readers.transforms import rigid_matrices, rigid_of_xyzw

TO_NAME = (
    "name the columns in a heading, such as timestamp,x,y,z,qx,qy,qz,qw, or save (T, 4, 4) "
    "matrices with numpy.save"
)
"""Remedy for a table whose columns are unknown."""

NORM_TOLERANCE = 0.05
"""Largest difference of a quaternion's norm from 1, as rounded numbers may have."""


@dataclass(frozen=True)
class Table:
    """Rows of numbers, NaN where a cell holds none, and the names of the columns, if any."""

    path: Path
    names: list[str]
    rows: Array
    unit: Unit | None = None
    """Unit of the lengths, where the format fixes it."""

    def refuse(self, expected: str, got: str, remedy: str = TO_NAME) -> InputError:
        """The error for a table that is not what it should be."""
        return InputError(f"{self.path}: expected {expected}, got {got}; {remedy}")


def is_known_column(name: str) -> bool:
    """Whether the name of a column denotes a coordinate, a time or a frame number."""
    return coordinate_in(name) is not None or plain_name(name) in CLOCK_NAMES


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
    lists = numbers_of_lists(table)
    matrices = [found for found in lists if len(found) in (12, 16)]
    turns = [found for found in lists if len(found) == 9]
    if len(matrices) == 1:
        return with_bottom_row(table.rows[:, matrices[0]].reshape(len(table.rows), -1, 4))
    if place and len(turns) == 1:
        at = [table.names.index(name) for name in place]
        return rigid_matrices(table.rows[:, turns[0]].reshape(-1, 3, 3), table.rows[:, at])
    raise table.refuse(
        "columns of one object's place (x, y, z) and quaternion (qx, qy, qz, qw), each once",
        f"{', '.join(table.names)[:200] or 'no names'}",
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
    found = [[name for name, at in coordinates.items() if at.axis == axis] for axis in axes]
    return [name for (name,) in found] if all(len(names) == 1 for names in found) else []


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
