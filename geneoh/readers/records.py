"""Values out of foreign files with their shape and kind checked, as float64 until a track is made.

Every refusal names the file and the field, what was expected and what came.
"""

import csv
import json
import re
from array import array as growing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.pickles.files import open_text, read_bytes, read_values

Array = np.ndarray

TABLE_LIMIT = 2**29
"""Bytes of a table that is read line by line."""

JSON_LIMIT = 2**26
"""Bytes of a JSON file: its lists take twenty times as much memory."""

WORDS_LIMIT = 2**24
"""Bytes of a text of numbers, each of which takes thirty times as much memory."""

NUMBERS_LIMIT = 2**27
"""Numbers of one field: a gigabyte of float64, though a file may hold them as single bytes."""

FRAME_LIMIT = 3 * 10**5
"""Frames of one clip: almost three hours at 30 frames a second."""


@dataclass(frozen=True)
class Record:
    """A dict of a foreign file; `where` names the file and the way to it."""

    where: str
    values: dict[Any, Any]

    def __contains__(self, name: Any) -> bool:
        return name in self.values

    def refuse(self, name: Any, expected: str) -> InputError:
        """The error for a field that is not what it should be."""
        got = described(self.values[name]) if name in self.values else "none"
        return InputError(
            f"{self.where}: '{name}' must be {expected}, got {got}; "
            "check that this is the file of the data set, as it is distributed"
        )

    def array(self, name: Any, *shapes: tuple[int | str, ...]) -> Array:
        """Numbers of one of `shapes`; a letter stands for an axis of any size from 1 up.

        Axes of one are dropped or added to fit, as the field's files do.
        """
        array = self.numbers(name)
        for shape in shapes:  # an axis of frames is the first
            if len(shape) and shape[0] == "T" and len(array.shape) and array.shape[0] > FRAME_LIMIT:
                raise self.refuse(name, f"numbers of at most {FRAME_LIMIT} frames")
        for shape in shapes:
            if matches(array.shape, shape):
                return array
        for shape in shapes:
            fixed = [size for size in shape if isinstance(size, int)]
            if len(fixed) == len(shape) and squeezed(array.shape) == squeezed(shape):
                return array.reshape(fixed)
        raise self.refuse(name, f"numbers of shape {' or '.join(map(shown, shapes))}")

    def numbers(self, name: Any) -> Array:
        """The field as float64, whatever its shape."""
        value = self.values.get(name)
        if entries(value) > NUMBERS_LIMIT:
            raise self.refuse(name, f"at most {NUMBERS_LIMIT} numbers")
        try:
            array = np.asarray(value)
        except ValueError:
            raise self.refuse(name, "an array of numbers") from None
        if array.dtype.kind not in "fiub":
            raise self.refuse(name, "an array of numbers")
        return array.astype(np.float64)

    def number(self, name: Any) -> float:
        """A single finite number."""
        value = self.numbers(name)
        if value.size != 1 or not np.isfinite(value).all():
            raise self.refuse(name, "one number")
        return float(value.reshape(()))

    def text(self, name: Any) -> str:
        """A single piece of text."""
        value = self.values.get(name)
        value = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
        if not isinstance(value, str):
            raise self.refuse(name, "text")
        return value

    def record(self, name: Any) -> "Record":
        """A dict within the dict."""
        value = self.values.get(name)
        value = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
        if not isinstance(value, dict):
            raise self.refuse(name, "a dict")
        return Record(f"{self.where} '{name}'", value)

    def items(self, name: Any) -> list[Any]:
        """A list of any values."""
        value = self.values.get(name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, list | tuple):
            raise self.refuse(name, "a list")
        return list(value)


def entries(value: Any, seen: dict[int, int] | None = None) -> int:
    """How many numbers a list of lists would become; a list that stands twice counts twice.

    Counted before the array is made: fifty lists that each hold the next one twice fill any memory.
    """
    if isinstance(value, np.ndarray):
        return value.size
    if not isinstance(value, list | tuple):
        return 1
    seen = {} if seen is None else seen
    if id(value) not in seen:
        seen[id(value)] = sum(entries(item, seen) for item in value)
    return seen[id(value)]


def matches(shape: tuple[int, ...], pattern: tuple[int | str, ...]) -> bool:
    """Whether a shape is that of the pattern; equal letters stand for equal sizes."""
    sizes: dict[str, int] = {}
    return len(shape) == len(pattern) and all(
        0 < size == sizes.setdefault(want, size) if isinstance(want, str) else size == want
        for size, want in zip(shape, pattern, strict=True)
    )


def squeezed(shape: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """A shape without its axes of one."""
    return tuple(size for size in shape if size != 1)


def shown(shape: tuple[int | str, ...]) -> str:
    """A shape for a message."""
    return f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"


def described(value: Any) -> str:
    """What a value is, in few words."""
    if isinstance(value, np.ndarray):
        return f"{value.shape} of {value.dtype}"
    if isinstance(value, dict | list | tuple):
        return f"a {type(value).__name__} of {len(value)}"
    if isinstance(value, str):
        return f"text {value[:40]!r}"
    shown = f" {value!r}"[:40] if isinstance(value, bool | int | float | np.generic) else ""
    return f"{type(value).__name__}{shown}"


def read_record(path: Path) -> Record:
    """The dict in a pickle, npz, npy, checkpoint or joblib file."""
    return as_record(read_values(path), str(path))


def as_record(value: Any, where: str) -> Record:
    """A value that must be a dict."""
    if not isinstance(value, dict):
        raise InputError(
            f"{where}: expected a dict of fields, got {described(value)}; "
            "check that this is the file of the data set, as it is distributed"
        )
    return Record(where, value)


def read_array(path: Path, *shapes: tuple[int | str, ...]) -> Array:
    """The one array in a npy, pickle or checkpoint file."""
    return Record(str(path), {"array": read_values(path)}).array("array", *shapes)


def read_json(path: Path) -> Any:
    """The value in a JSON file."""
    try:
        return json.loads(read_bytes(path, JSON_LIMIT))
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:100]
        raise InputError(
            f"{path}: expected JSON, got what is none ({reason}); it is damaged, copy it again"
        ) from None


def read_text(path: Path, limit: int = WORDS_LIMIT) -> str:
    """The text of a file, in UTF-8."""
    return read_bytes(path, limit).decode("utf-8", "replace")


def read_table(path: Path, wanted: re.Pattern[str]) -> Record:
    """Columns of a CSV as arrays by name; blanks around names are dropped.

    What is no number comes as NaN.

    Args:
        path: the file.
        wanted: the names of the columns to read.

    Raises:
        InputError: no table, or too large a one.
    """
    with open_text(path, TABLE_LIMIT) as file:
        rows = csv.reader(file)
        names = [name.strip() for name in next(rows, [])]
        columns = {
            index: growing("d") for index, name in enumerate(names) if wanted.fullmatch(name)
        }
        for row in rows:
            if len(row) != len(names):
                raise InputError(f"{path}: expected rows as long as the heading; copy it again")
            for index, column in columns.items():
                column.append(number_in(row[index]))
    return Record(str(path), {names[index]: np.array(column) for index, column in columns.items()})


def number_in(text: str) -> float:
    """A number, or NaN for anything else."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def read_numbers(path: Path, *counts: int) -> Array:
    """The numbers of a text file with one line per row, or all of one row.

    Args:
        path: the file.
        counts: numbers that a row may have.

    Raises:
        InputError: not numbers, or rows of other lengths.
    """
    rows = [line.split() for line in read_text(path).splitlines() if line.strip()]
    try:
        values = np.array([[float(word) for word in row] for row in rows])
    except ValueError:
        values = np.zeros((0, 0))
    if values.ndim != 2 or values.shape[1] not in counts:
        wanted = " or ".join(map(str, counts))
        raise InputError(
            f"{path}: expected rows of {wanted} numbers, got {len(rows)} rows of "
            f"{sorted({len(row) for row in rows})[:4]} words; it is damaged, copy it again"
        )
    return values


def frame_number(path: Path) -> int:
    """The number in a file's name, such as 17 in 00017.json.

    Raises:
        InputError: the name is no frame's number.
    """
    digits = "".join(ch for ch in path.stem if ch.isdigit())
    if not digits or len(digits) > 9 or int(digits) > FRAME_LIMIT:
        raise InputError(f"{path}: expected a frame's number as the name; rename or remove it")
    return int(digits)
