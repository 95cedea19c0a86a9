"""Landmarks of hands in tables (CSV).

Tables are wide, with one row per frame and columns such as `x0`, `WRIST_x` or `LeftIndexTipPosX`,
or long, with one row per point and the columns `frame`, `landmark`, `x`, `y` and `z`. They may have
frame numbers, timestamps, or both (`geneoh.readers.clock`), and the side of the hand. Points have
names, those of MediaPipe, OpenXR, WebXR and the like, or numbers in a named order. Other columns,
such as orientations and points that OpenPose lacks, are ignored.
"""

import csv
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import JointOrder, Side
from geneoh.errors import InputError, numbered
from geneoh.files.reading import open_text, table_in
from geneoh.readers.clock import TIME_NAMES
from geneoh.readers.column_names import (
    IMAGE_NAMES,
    columns_called,
    coordinate_in,
    image_numbers,
    plain_name,
    point_in,
    side_in,
    split_stamp,
    words_of,
)
from geneoh.readers.foreign_files import JSON_LIMIT, number_in, time_in
from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.keypoints import mediapipe
from geneoh.readers.records import FRAME_LIMIT, Record

FRAME_COLUMNS = ("frame", "frame_id", "frame_idx", "frame_index", "frame_number")
SIDE_COLUMNS = ("side", "hand", "handedness", "label")
POINT_COLUMNS = tuple(
    f"{point}{end}"
    for point in ("landmark", "joint", "keypoint")
    for end in ("", "_id", "_index", "_name", "id", "name")
)
NOT_READ = (  # a note; the braces are for what is not read
    "{} are not read: an npz of 'joints' (T, 21, 3) takes them as 'confidence' (T, 21), from 0 to 1"
)
SCORE_WORDS = {"confidence", "score"}
"""Words in the names of columns that hold them."""
UNREAD = re.compile(r"[^#]*\d[^#]*")
"""A cell that should be a number; `1.#QNAN`, the NaN of older programs of Windows, should not."""

Row = dict[str | None, Any]
"""A row of a table by the names of its columns."""

Column = tuple[Side | None, int | None, int]
"""Side, point and axis of the coordinates in a column; the point is None in a long table, the side
None if the column's name has none."""

Cell = tuple[Side | None, int, int, int, float]
"""Side, frame, point, axis and value of a coordinate."""


def points_in_rows(
    rows: list[Row], names: list[str], path: Path, side: Side | None, order: JointOrder
) -> mediapipe.Landmarks:
    """The hands in the rows of a table of points, by their side; see `as_one_hand`.

    `names` are those of the columns, and `order` is the keypoint order of points with numbers.
    """
    rows = with_stamps(rows)
    frames = frames_of(rows)
    numbered_as = Numbering(order, path)
    columns = point_columns(names, numbered_as)
    cells = list(cells_of(rows, frames, columns, side, numbered_as))
    numbers = [frame for _, frame, _, _, _ in cells]
    first, last = min(numbers, default=0), max(numbers, default=0)
    if not cells or last - first >= FRAME_LIMIT:
        raise InputError(f"{path}: expected rows of 1 to {FRAME_LIMIT} frames; correct the table")
    numbered_as.refuse_unused()
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
    tracks, notes = mediapipe.as_one_hand(found, side)
    notes = (*notes, mediapipe.IN_TURN) if are_in_turn(rows) else notes
    if any(SCORE_WORDS & {*words_of(name)} for name in names):
        notes = (*notes, NOT_READ.format("the confidences in its columns"))
    return mediapipe.Landmarks(tracks, notes, times_in(rows, frames, path), first)


def read_rows(path: Path) -> tuple[list[Row], list[str]]:
    """The rows of a table, and the names of its columns."""
    try:
        with open_text(path, JSON_LIMIT) as file:
            lines, separator = table_in(file)
            table = csv.DictReader(lines, delimiter=separator)
            names = [str(name).strip() for name in table.fieldnames or ()]
            table.fieldnames = names
            rows = without_blanks(list(table))
            return [with_points(row, separator, path) for row in rows], names
    except csv.Error as error:
        raise InputError(f"{path}: expected a table ({error}); export it again") from None


def without_blanks(rows: list[Row]) -> list[Row]:
    """The rows but those of separators alone. Where no column has the numbers or times of frames,
    these are frames without a hand, except at the end, where spreadsheets write such lines."""
    filled = [any(row.values()) for row in rows]
    head = rows[0] if rows else ()
    if frame_column(rows) or column_of(rows, TIME_NAMES) or split_stamp(head):
        return [row for row, there in zip(rows, filled, strict=True) if there]
    return rows[: max((n for n, there in enumerate(filled, 1) if there), default=0)]


def as_rows(value: Any) -> tuple[list[Row], list[str]] | None:
    """Rows and column names of a table written as a JSON list of flat dicts, as pandas does; None
    if the value is no such list, or has no column of coordinates."""
    value = value if isinstance(value, list) else []
    rows = [row for row in value if isinstance(row, dict)]
    names = list(dict.fromkeys(str(name) for row in rows for name in row))
    nested = any(isinstance(cell, list | dict) for row in rows for cell in row.values())
    if nested or len(rows) != len(value) or not any(map(coordinate_in, names)):
        return None
    texts_by_name = [{str(name): cell for name, cell in row.items()} for row in rows]
    texts = [
        ["" if row.get(name) is None else str(row[name]) for name in names] for row in texts_by_name
    ]
    return [dict(zip(names, cells, strict=True)) for cells in texts], names


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


def with_stamps(rows: list[Row]) -> list[Row]:
    """The rows, with a time in one column where ROS has split it into two, and with frame numbers
    where only names of images have them."""
    parts = split_stamp(rows[0] if rows else ())
    if column_of(rows, TIME_NAMES):
        return rows
    if parts is None:
        return with_numbers(rows)
    told = [[number_in(row[part] or "") for part in parts] for row in rows]
    return [
        {**row, "stamp_s": repr(seconds + 1e-9 * nanoseconds)}
        for row, (seconds, nanoseconds) in zip(rows, told, strict=True)
    ]


def with_numbers(rows: list[Row]) -> list[Row]:
    """The rows, with frame numbers by a column of images where there are no others."""
    images = column_of(rows, IMAGE_NAMES)
    if images is None or frame_column(rows):
        return rows
    numbers = image_numbers(row[images] for row in rows) or ()
    return [{**row, "frame": str(n)} for row, n in zip(rows, numbers, strict=False)] or rows


def times_in(rows: list[Row], frames: list[float], path: Path) -> Record:
    """The times of a table's frames, interpolated for frames without a row; empty without times."""
    name = column_of(rows, TIME_NAMES)
    times = [] if name is None else [time_in(row[name] or "") for row in rows]
    if name is None or not np.isfinite(times).all():
        return Record(str(path), {})
    stamps = dict(zip(frames, times, strict=True))
    known = sorted(stamps)
    every = np.arange(int(known[0]), int(known[-1]) + 1)
    times = np.interp(every, known, [stamps[frame] for frame in known])
    return Record(str(path), {plain_name(name): times}, "correct the table")


def column_of(rows: list[Row], names: Iterable[str]) -> str | None:
    """The column with the first of some names that the table has, if any."""
    return next((column for _, column in columns_called(rows[0] if rows else (), names)), None)


def frame_column(rows: list[Row]) -> str | None:
    """The column of frame numbers; not a column of texts, as ROS names coordinate frames so."""
    called = columns_called(rows[0] if rows else (), FRAME_COLUMNS)
    numbers = {name: [number_in(row[name] or "") for row in rows] for _, name in called}
    return next((name for name, found in numbers.items() if np.isfinite(found).any()), None)


def frames_of(rows: list[Row]) -> list[float]:
    """The frame of each row: by its number, else by its time, else one frame per row, or per two
    rows of left and right in turn."""
    if name := frame_column(rows):
        return [number_in(row[name] or "") for row in rows]
    if name := column_of(rows, TIME_NAMES):
        times = np.array([time_in(row[name] or "") for row in rows])
        places = np.unique(times, return_inverse=True)[1].astype(float)
        return np.where(np.isfinite(times), places, np.nan).tolist()
    return (np.arange(float(len(rows))) // (2 if are_in_turn(rows) else 1)).tolist()


def are_in_turn(rows: list[Row]) -> bool:
    """Whether rows without the number or the time of their frame are two hands in turn."""
    saying = column_of(rows, SIDE_COLUMNS)
    if saying is None or frame_column(rows) or column_of(rows, TIME_NAMES):
        return False
    sides: list[Side | None] = [side_in(words_of(row[saying] or "")) for row in rows]
    return mediapipe.are_in_turn(sides)


class Numbering:
    """Converts numbered points from a keypoint order; refuses an order that is not needed."""

    def __init__(self, order: JointOrder, path: Path | str) -> None:
        self.path, self._order, self._used = path, order, False
        self._count, entries = ORDERS[order].count, ORDERS[order].entries
        self._points = {entry: point for point, entry in enumerate(entries)}
        if -1 in entries:
            raise InputError(
                f"{path}: expected an order with all 21 points, got --joint-order {order}; save "
                "the points as npy"
            )

    def point(self, words: list[str]) -> int | str | None:
        """As `point_in`, but a number in the order becomes OpenPose's, "" if OpenPose lacks it."""
        point = point_in(words)
        if not isinstance(point, str) or not point:
            return point
        self._used = True
        if int(point) >= self._count:
            raise self._refusal(f"0 to {self._count - 1}, got number {point}")
        return self._points.get(int(point), "")

    def refuse_other_count(self, count: int) -> None:
        """Refuse a list whose number of points is not that of the order."""
        if count != self._count:
            raise self._refusal(f"got a list of {count}")

    def _refusal(self, got: str) -> InputError:
        """The error for points of another order."""
        return InputError(
            f"{self.path}: expected the {self._count} points of the order {self._order}, {got}; "
            "name the order of the points (--joint-order), such as openxr for the 26 of OpenXR, or "
            "keep those"
        )

    def refuse_unused(self) -> None:
        """Refuse a keypoint order beside points that have names."""
        if self._order != "openpose" and not self._used:
            raise InputError(
                f"{self.path}: --joint-order is for numbered points, got points with names, which "
                "say their order; drop it"
            )


def point_columns(names: list[str], numbering: Numbering) -> dict[str, Column]:
    """Side, point and axis of each column of coordinates of the 21 points."""
    coordinates = {name: coordinate_in(name) for name in names}
    places = {name: at for name, at in coordinates.items() if at is not None and not at.is_turn}
    alone: dict[str, Column] = {
        name: (None, None, "xyz".index(at.axis)) for name, at in places.items() if not at.of
    }
    if len(alone) == 3 and {plain_name(name) for name in names} & set(POINT_COLUMNS):
        return alone
    found: dict[str, Column] = {}
    for name, at in places.items():
        point = numbering.point(list(at.of))
        if isinstance(point, int):
            found[name] = (side_in(at.of), point, "xyz".index(at.axis))
    sides = {side for side, _, _ in found.values()}
    if names and not any(math.isnan(number_in(name)) for name in names):
        raise InputError(
            f"{numbering.path}: expected a table with a heading, got numbers in its first line; "
            "name the columns, such as WRIST_x to PINKY_TIP_z, or save the points as npy"
        )
    if not found or len(set(found.values())) != 63 * len(sides):
        raise InputError(
            f"{numbering.path}: expected a table of landmarks: the columns x0, y0, z0 to z20 or "
            "WRIST_x to PINKY_TIP_z, or the names of OpenXR, such as LeftIndexTipPosX, with a row "
            "a frame, or frame, landmark, x, y, z with a row a landmark, got "
            f"{', '.join(names)[:200] or 'no columns'}; rename them"
        )
    return found


def cells_of(
    rows: list[Row],
    frames: list[float],
    columns: dict[str, Column],
    side: Side | None,
    numbering: Numbering,
) -> Iterable[Cell]:
    """Every coordinate in a table of the 21 points; `side` is for rows without a side."""
    long = any(point is None for _, point, _ in columns.values())
    timed = (frame_column(rows) or column_of(rows, TIME_NAMES)) is not None
    naming, saying = column_of(rows, POINT_COLUMNS), column_of(rows, SIDE_COLUMNS)
    path = numbering.path
    for line, (row, frame) in enumerate(zip(rows, frames, strict=True)):
        named = (row[naming] if naming else None) or ""
        row_side = side_in(words_of(row[saying] or "")) if saying else None
        row_point = numbering.point(words_of(named)) if long else ""
        if row_point is None or not abs(frame) < 1e9 or (long and not timed):
            raise InputError(
                f"{path}: line {line + 2} must have the number or the time of its frame as a "
                f"number, and a landmark by number or by name, got {frame:g} and "
                f"{named!r:.40}; correct it"
            )
        for name, (column_side, fixed, axis) in columns.items():
            point = row_point if fixed is None else fixed
            if not isinstance(point, int):
                continue
            number = number_in(cell := row[name] or "")
            if number != number and UNREAD.fullmatch(cell):
                raise InputError(
                    f"{path}: line {line + 2}: '{name}' must be a number, without separators of "
                    "thousands and with a decimal point where commas separate cells, got "
                    f"{cell!r:.40}; correct the table"
                )
            yield column_side or row_side or side, int(frame), point, axis, number
