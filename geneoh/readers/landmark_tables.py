"""Landmarks of hands in tables (CSV).

Tables are wide, a row a frame with columns such as `x0` or `WRIST_x`, or long, a row a point with
the columns `frame`, `landmark`, `x`, `y` and `z`. They may have the number of each frame, its time,
or both (`geneoh.readers.clock`), and the side of the hand.
"""

import csv
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError, numbered
from geneoh.files.reading import open_text, table_in
from geneoh.readers import mediapipe
from geneoh.readers.clock import TIME_NAMES
from geneoh.readers.foreign_files import JSON_LIMIT, number_in
from geneoh.readers.records import FRAME_LIMIT, Record

FINGERS = ("INDEX_FINGER", "MIDDLE_FINGER", "RING_FINGER", "PINKY")
NAMES = (
    *("WRIST", "THUMB_CMC", "THUMB_MCP", "THUMB_IP", "THUMB_TIP"),
    *(f"{finger}_{joint}" for finger in FINGERS for joint in ("MCP", "PIP", "DIP", "TIP")),
)
"""MediaPipe's names of the landmarks, which are in OpenPose's order."""
FRAME_COLUMNS = ("frame", "frame_id", "frame_idx", "frame_index", "frame_number")
SIDE_COLUMNS = ("side", "hand", "handedness", "label")
POINT_COLUMNS = ("landmark", "landmark_id", "landmark_index", "landmark_name", "joint", "keypoint")
POINT_AND_AXIS = re.compile(r"(?:landmark|joint|keypoint)?[_ .]?(\w+?)[_ .]?([xyz])")
AXIS_AND_POINT = re.compile(r"([xyz])[_ .]?(\d+)")
UNREAD = re.compile(r"[^#]*\d[^#]*")
"""A cell that holds a number if any; older programs of Windows write NaN as `1.#QNAN`."""

Row = dict[str | None, Any]
"""A row of a table by the names of its columns."""

Cell = tuple[Side | None, int, int, int, float]
"""Side, frame, point, axis and number of a coordinate."""


def read_points(path: Path, side: Side | None) -> mediapipe.Landmarks:
    """The hands in a table of points, by the side that a column says; see `as_one_hand`."""
    rows, columns = read_rows(path)
    frames = frames_of(rows)
    cells = list(cells_of(rows, frames, columns, side, path))
    numbers = [frame for _, frame, _, _, _ in cells]
    first, last = min(numbers, default=0), max(numbers, default=0)
    if not cells or last - first >= FRAME_LIMIT:
        raise InputError(f"{path}: expected rows of 1 to {FRAME_LIMIT} frames; correct the table")
    found: mediapipe.Tracks = {}
    for label, frame, point, axis, number in cells:
        track = found.setdefault(label, mediapipe.empty_track(last - first + 1))
        if np.isfinite(track.points[frame - first, point, axis]):
            raise InputError(
                f"{path}: expected one hand a side in each frame, got landmark {point} twice in "
                f"frame {frame - first + 1} of the table; add the column 'hand', or correct it"
            )
        track.points[frame - first, point, axis] = number
        track.trust[frame - first] = 1.0
    for track in found.values():
        mediapipe.refuse_image_landmarks(track.points, str(path))
    return mediapipe.Landmarks(
        *mediapipe.as_one_hand(found, side), times_in(rows, frames, path), first
    )


def read_rows(path: Path) -> tuple[list[Row], dict[str, tuple[int | None, int]]]:
    """The rows of a table, and its columns of coordinates; see `point_columns`."""
    try:
        with open_text(path, JSON_LIMIT) as file:
            lines, separator = table_in(file)
            table = csv.DictReader(lines, delimiter=separator)
            table.fieldnames = [str(name).strip().lower() for name in table.fieldnames or ()]
            columns = point_columns(table.fieldnames, path)
            return [with_points(row, separator, path) for row in table], columns
    except csv.Error as error:
        raise InputError(f"{path}: expected a table ({error}); export it again") from None


def with_points(row: Row, separator: str, path: Path) -> Row:
    """A row with decimal points for decimal commas, where commas do not separate cells."""
    if any(cells := row.pop(None, ())):
        raise InputError(
            f"{path}: expected rows as long as the heading, got one with "
            f"{numbered(len(cells), 'cell')} more; where decimals have commas, separate cells by "
            "semicolons"
        )
    if separator == ",":
        return row
    return {name: cell.replace(",", ".") if cell else cell for name, cell in row.items()}


def times_in(rows: list[Row], frames: list[float], path: Path) -> Record:
    """The times of a table's frames, between others of one without a row; empty without times."""
    name = column_of(rows, TIME_NAMES)
    times = [] if name is None else [number_in(row[name] or "") for row in rows]
    if name is None or not np.isfinite(times).all():
        return Record(str(path), {})
    told = dict(zip(frames, times, strict=True))
    known = sorted(told)
    every = np.arange(int(known[0]), int(known[-1]) + 1)
    times = np.interp(every, known, [told[frame] for frame in known])
    return Record(str(path), {name: times}, "correct the table")


def column_of(rows: list[Row], names: Iterable[str]) -> str | None:
    """The first of some names that a table has as a column."""
    return next((name for name in names if rows and name in rows[0]), None)


def frames_of(rows: list[Row]) -> list[float]:
    """The frame of each row: by its number, else by its time, else one for each row."""
    if name := column_of(rows, FRAME_COLUMNS):
        return [number_in(row[name] or "") for row in rows]
    if name := column_of(rows, TIME_NAMES):
        times = np.array([number_in(row[name] or "") for row in rows])
        places = np.unique(times, return_inverse=True)[1].astype(float)
        return np.where(np.isfinite(times), places, np.nan).tolist()
    return np.arange(float(len(rows))).tolist()


def point_columns(names: Iterable[str], path: Path) -> dict[str, tuple[int | None, int]]:
    """Point and axis of each column of coordinates; the point is None where a row is a point."""
    names = list(names)
    if {"x", "y", "z"} <= set(names) and set(names) & set(POINT_COLUMNS):
        return {axis: (None, "xyz".index(axis)) for axis in "xyz"}
    found: dict[str, tuple[int | None, int]] = {}
    for name in names:
        swapped, plain = AXIS_AND_POINT.fullmatch(name), POINT_AND_AXIS.fullmatch(name)
        point, axis = swapped.group(2, 1) if swapped else plain.groups() if plain else ("", "x")
        number = point_number(point)
        if number is None and point.isdecimal():
            raise InputError(
                f"{path}: expected the 21 points of OpenPose's order, 0 to 20, got the column "
                f"{name!r}; save other points as npy and name their order (--joint-order), or "
                "keep those 21"
            )
        if number is not None:
            found[name] = (number, "xyz".index(axis))
    if len(set(found.values())) != 63:
        raise InputError(
            f"{path}: expected a table of landmarks: the columns x0, y0, z0 to z20 or WRIST_x to "
            "PINKY_TIP_z with a row a frame, or frame, landmark, x, y, z with a row a landmark, "
            f"got {', '.join(names)[:200] or 'no columns'}; rename them"
        )
    return found


def point_number(text: str) -> int | None:
    """The number of a landmark that is given by it or by MediaPipe's name; None for neither."""
    name = text.strip().upper().rpartition(".")[2]
    if name in NAMES:
        return NAMES.index(name)
    number = number_in(text)
    return int(number) if number in range(21) else None


def cells_of(
    rows: list[Row],
    frames: list[float],
    columns: dict[str, tuple[int | None, int]],
    side: Side | None,
    path: Path,
) -> Iterable[Cell]:
    """Every coordinate in a table; `side` is that of rows that say none."""
    long = next(iter(columns.values()))[0] is None
    timed = column_of(rows, (*FRAME_COLUMNS, *TIME_NAMES)) is not None
    for line, (row, frame) in enumerate(zip(rows, frames, strict=True)):
        named = next((row[name] for name in POINT_COLUMNS if name in row), None) or ""
        told_side: Side | None = next(
            (mediapipe.label_of(row[name])[0] for name in SIDE_COLUMNS if name in row), None
        )
        for name, (fixed, axis) in columns.items():
            point = point_number(named) if fixed is None else fixed
            if point is None or not abs(frame) < 1e9 or (long and not timed):
                raise InputError(
                    f"{path}: line {line + 2} must have the number or the time of its frame as a "
                    f"number, and a landmark from 0 to 20 or by name, got {frame:g} and "
                    f"{named!r:.40}; correct it"
                )
            number = number_in(cell := row[name] or "")
            if number != number and UNREAD.fullmatch(cell):
                raise InputError(
                    f"{path}: line {line + 2}: '{name}' must be a number, without separators of "
                    "thousands and with a decimal point where commas separate cells, got "
                    f"{cell!r:.40}; correct the table"
                )
            yield told_side or side, int(frame), point, axis, number
