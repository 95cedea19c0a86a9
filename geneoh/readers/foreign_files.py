"""Files that others wrote: pickles, JSON, tables and texts of numbers."""

import csv
import json
import re
from array import array as growing
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.files.reading import note_read, open_text, read_bytes
from geneoh.files.values import read_values
from geneoh.readers.nested_lists import Shape
from geneoh.readers.records import FRAME_LIMIT, Array, Record, as_record

TABLE_LIMIT = 2**29
"""Bytes of a table that is read line by line."""

JSON_LIMIT = 2**26
"""Bytes of a JSON file: its lists take twenty times as much memory."""

TEXT_LIMIT = 2**24
"""Bytes of a text of numbers, each of which takes thirty times as much memory."""


def read_record(path: Path) -> Record:
    """The dict in a pickle, npz, npy, checkpoint or joblib file."""
    return as_record(read_values(path), str(path))


def read_array(path: Path, *shapes: Shape) -> Array:
    """The one array in a npy, pickle or checkpoint file."""
    return Record(str(path), {"array": read_values(path)}).array("array", *shapes)


def read_json(path: Path) -> Any:
    """The value in a JSON file, or the list of values in a file with one per line (.jsonl).

    If the file is not in the form that its ending names, the other form is tried.
    """
    data, by_line = read_bytes(path, JSON_LIMIT), path.suffix.lower() == ".jsonl"
    try:
        return json_values(data, path, by_line=by_line)
    except InputError:
        with suppress(InputError):
            return json_values(data, path, by_line=not by_line)
        raise


def json_values(data: bytes, path: Path, *, by_line: bool) -> Any:
    """The one value of a JSON file, or the list of the values of one that has one per line."""
    if not by_line:
        return json_in(data, str(path), "copy it again")
    lines = ((number, line) for number, line in enumerate(data.splitlines(), 1) if line.strip())
    cure = "copy it again, or leave the line out"
    return [json_in(line, f"{path}, line {number}", cure) for number, line in lines]


def json_in(data: bytes, where: str, cure: str) -> Any:
    """The value of a text of JSON; `InputError` where it is none."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:100]
        reason = reason if ", line " not in where else reason.replace("line 1 ", "")
        raise InputError(
            f"{where}: expected JSON, got what is none ({reason}); it is damaged, {cure}"
        ) from None


def read_text(path: Path) -> str:
    """The text of a file, in UTF-8."""
    return read_bytes(path, TEXT_LIMIT).decode("utf-8", "replace")


def read_yaml(path: Path) -> Record:
    """Names with a value or a list in YAML of two levels; nested names move to the top level."""
    values: dict[str, object] = {}
    items: list[object] = []
    for line in read_text(path).splitlines():
        words = line.strip()
        if words.startswith("- "):
            items.append(scalar(words[2:]))
        elif ":" in words:
            name, _, rest = (part.strip() for part in words.partition(":"))
            items = []
            values[name.strip("'\"")] = scalar(rest) if rest else items
    return Record(str(path), values)


def scalar(text: str) -> object:
    """The value of a YAML text: a list in brackets, a number without quotes, else text."""
    if text.startswith("[") and text.endswith("]"):
        return [scalar(part.strip()) for part in text[1:-1].split(",") if part.strip()]
    if text[:1] in ("'", '"') and text[-1:] == text[:1]:
        return text[1:-1]
    try:
        return float(text)
    except ValueError:
        return text


def read_table(path: Path, wanted: re.Pattern[str]) -> Record:
    """The wanted columns of a CSV as arrays by name; a cell that is no number becomes NaN."""
    try:
        with open_text(path, TABLE_LIMIT) as file:
            rows = csv.reader(file)
            names = [name.strip() for name in next(rows, [])]
            columns = {at: growing("d") for at, name in enumerate(names) if wanted.fullmatch(name)}
            for row in rows:
                if len(row) != len(names):
                    raise InputError(f"{path}: expected rows as long as the heading; copy it again")
                for at, column in columns.items():
                    column.append(number_in(row[at]))
    except csv.Error as error:
        raise InputError(f"{path}: expected a table ({error}); copy it again") from None
    return Record(str(path), {names[at]: np.array(column) for at, column in columns.items()})


def number_in(text: str) -> float:
    """A number, or NaN for anything else."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def time_in(text: str) -> float:
    """A time as a number, a date in seconds since 1970; NaN for anything else."""
    number = number_in(text)
    if np.isfinite(number) or not text:
        return number
    try:
        at = datetime.fromisoformat(text.strip().replace("Z", "+00:00"))
    except ValueError:
        return number
    return (at if at.tzinfo else at.replace(tzinfo=timezone.utc)).timestamp()


def read_numbers(path: Path, *counts: int, remedy: str = "it is damaged, copy it again") -> Array:
    """The numbers of a text, one row per line; all rows have the same length, one of `counts`.

    `remedy` ends the error message on other texts.
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
            f"{sorted({len(row) for row in rows})[:4]} words; {remedy}"
        )
    return values


def frame_number(path: Path) -> int:
    """The number in a file's name, 17 in 00017.json; `InputError` for names without one."""
    digits = "".join(ch for ch in path.stem if ch.isdecimal())
    if not digits or len(digits) > 9 or int(digits) > FRAME_LIMIT:
        raise InputError(f"{path}: expected a frame's number as the name; rename or remove it")
    return int(digits)


def numbered_files(folder: Path, pattern: str) -> dict[int, Path]:
    """The files of a folder that match a pattern, by the frame's number in their names."""
    if folder.is_dir():
        note_read(folder)
    return {frame_number(path): path for path in sorted(folder.glob(pattern))}


def by_frame(values: Mapping[int, Array], frames: int, *shape: int) -> Array:
    """(T, *shape) of the values of single frames; NaN in every frame that has none."""
    result = np.full((frames, *shape), np.nan)
    for frame, value in values.items():
        if frame < frames:
            result[frame] = value
    return result


def field_by_frame(records: Mapping[int, Record], name: str, frames: int, *shape: int) -> Array:
    """(T, *shape) of one field of each frame's record; NaN in every frame that has none."""
    found = {frame: record.array(name, shape) for frame, record in records.items()}
    return by_frame(found, frames, *shape)
