"""The named fields of one file, read with checks of their shape and type.

Every error names the file and the field, what was expected, what was found and what to do.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.errors import InputError
from geneoh.readers.nested_lists import (
    NUMBERS_LIMIT,
    Shape,
    array_in,
    count_entries,
    is_transposed,
    matches,
    shown_shape,
    without_ones,
)

Array = np.ndarray

Notes = tuple[str, ...]
"""Assumptions that were made while reading, as sentences."""

FRAME_LIMIT = 3 * 10**5
"""Frames of one clip of a data set: almost three hours at 30 frames a second."""

AS_DISTRIBUTED = "check that this is the file of the data set, as it is distributed"
"""What to do about a wrong field of a data set's file."""

RESHAPE = "reshape it"
"""Beginning of the remedy for a wrong field where the arrays are a user's own."""

IN_RADIANS = "in radians"
"""Unit of rotations, which are axis-angle vectors or matrices."""

OF_OBJECTS = "make numbers of it with astype(float)"
"""What to do about a caller's array of Python objects."""


@dataclass(frozen=True)
class Record:
    """The fields of a file, or of a dict within it."""

    where: str
    """The file and the path to the fields within it, for messages."""
    values: Mapping[Any, Any]
    remedy: str = AS_DISTRIBUTED
    """Default remedy that messages on wrong fields give."""
    most_frames: int = FRAME_LIMIT
    """Largest number of frames of a field."""

    def __contains__(self, name: Any) -> bool:
        return name in self.values

    def refuse(self, name: Any, expected: str, remedy: str = "") -> InputError:
        """The error for a field that is not what it should be; `expected` follows "must be"."""
        got = described(self.values[name]) if name in self.values else "none"
        return InputError(
            f"{self.where}: '{name}' must be {expected}, got {got}; {remedy or self.remedy}"
        )

    def array(self, name: Any, *shapes: Shape, unit: str = "", remedy: str = "") -> Array:
        """A field in one of some shapes, as float64; axes of length 1 are dropped or added to fit.

        An axis of frames comes first and is called "T". `unit`, such as "in metres", is for the
        error message.
        """
        array = self.numbers(name)
        frames = len(array) if array.ndim and any(shape[:1] == ("T",) for shape in shapes) else 0
        if frames > self.most_frames:
            raise self.refuse(name, f"numbers of at most {self.most_frames} frames")
        for shape in shapes:
            if matches(array.shape, shape):
                return array
        for shape in shapes:
            fixed = [size for size in shape if isinstance(size, int)]
            if len(fixed) == len(shape) and without_ones(array.shape) == without_ones(shape):
                return array.reshape(fixed)
        cure = remedy if array.size else "at least one frame is needed"
        if not cure and self.remedy.startswith(RESHAPE) and is_transposed(array.shape, shapes):
            cure = "bring its axes into this order with transpose, reshape would mix them"
        others = array.shape[-1:] in ((4,), (6,)) or array.shape[-2:] == (3, 3)
        # with a remedy of its own, six numbers a frame may be coefficients
        if unit == IN_RADIANS and others and (array.ndim > 2 or not remedy):
            cure = "turn each rotation into an axis-angle vector"
        elif array.shape[-1:] == (4,) and any(matches((*array.shape[:-1], 3), s) for s in shapes):
            cure = (
                "keep the first three numbers of each; where the fourth is a score, save it apart"
            )
        wanted = " or ".join(map(shown_shape, shapes))
        nested = isinstance(self.values.get(name), list)  # report the shape of lists, too
        shown = replace(self, values={**self.values, name: array}) if nested else self
        raise shown.refuse(name, f"numbers of shape {wanted} {unit}".rstrip(), cure)

    def optional_array(self, name: Any, *shapes: Shape, **refusal: str) -> Array | None:
        """As `array`, or None where the field is not there."""
        return self.array(name, *shapes, **refusal) if name in self else None

    def tensor(self, name: Any, *shapes: Shape, **refusal: str) -> Tensor | None:
        """As `optional_array`, but float32; numbers that are too large become infinite."""
        array = self.optional_array(name, *shapes, **refusal)
        return None if array is None else float32(array)

    def side_by_side(self, **widths: int) -> Array:
        """(T, N) fields concatenated by columns; arguments are the fields' names and widths."""
        arrays = [
            self.array(name, ("T", width), *[("T",)] * (width == 1)).reshape(-1, width)
            for name, width in widths.items()
        ]
        self.refuse_lengths(*widths)
        return np.concatenate(arrays, axis=1)

    def numbers(self, name: Any) -> Array:
        """The field as float64, whatever its shape; null in a list of JSON becomes NaN."""
        value = self.values.get(name)
        if count_entries(value) > NUMBERS_LIMIT:
            raise self.refuse(name, f"at most {NUMBERS_LIMIT} numbers")
        try:
            array = array_in(value)
            if array.dtype.kind == "O" and isinstance(value, list):
                plain = all(each is None or isinstance(each, int | float) for each in array.flat)
                array = array.astype(np.float64) if plain else array
        except (ValueError, OverflowError):  # rows of several lengths, or huge integers
            cure = "" if self.remedy == AS_DISTRIBUTED else "fill missing rows with NaN"
            raise self.refuse(name, "an array of numbers", cure) from None
        if array.dtype.kind not in "fiub":
            objects = array.dtype.kind == "O" and name in self
            cure = OF_OBJECTS if objects and self.remedy != AS_DISTRIBUTED else ""
            if array.dtype.kind in "US" and self.remedy.startswith(RESHAPE):
                cure = "write numbers and no text"
            raise self.refuse(name, "an array of numbers", cure)
        return array.astype(np.float64)

    def number(self, name: Any, remedy: str = "") -> float:
        """A single number, which may be NaN or infinite; true and false count as 1 and 0."""
        if name not in self or (value := self.numbers(name)).size != 1:
            raise self.refuse(name, "one number", remedy)
        return float(value.reshape(()))

    def optional_number(self, name: Any, remedy: str = "") -> float | None:
        """As `number`, or None where the field is not there."""
        return self.number(name, remedy) if name in self else None

    def finite(self, name: Any) -> float:
        """A single finite number."""
        value = self.number(name)
        if not np.isfinite(value):
            raise self.refuse(name, "one finite number")
        return value

    def integers(self, name: Any) -> list[int]:
        """Whole numbers, whatever the field's shape."""
        values = self.numbers(name).ravel()
        if not (np.abs(values) < sys.maxsize).all() or (values != np.rint(values)).any():
            raise self.refuse(name, "whole numbers")
        return values.astype(np.int64).tolist()

    def integer(self, name: Any) -> int:
        """A single whole number."""
        values = self.integers(name)
        if len(values) != 1:
            raise self.refuse(name, "one whole number")
        return values[0]

    def flags(self, name: Any) -> Bool[Tensor, " T"]:
        """A mask over the frames, given as booleans or as zeros and ones."""
        array = np.asarray(self.values[name])
        if array.ndim != 1 or array.dtype.kind not in "biuf" or not np.isin(array, (0, 1)).all():
            raise self.refuse(name, "one boolean for each frame", "save it with dtype=bool")
        return torch.from_numpy(array.astype(bool))

    def text(self, name: Any) -> str:
        """A single piece of text."""
        value = only(self.values.get(name))
        if not isinstance(value, str | bytes):
            raise self.refuse(name, "one piece of text")
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else value

    def optional_text(self, name: Any) -> str | None:
        """As `text`, or None where the field is not there."""
        return self.text(name) if name in self else None

    def record(self, name: Any) -> "Record":
        """A dict within the dict."""
        value = only(self.values.get(name))
        if not isinstance(value, dict):
            raise self.refuse(name, "a dict")
        return Record(f"{self.where} '{name}'", value, self.remedy, self.most_frames)

    def items(self, name: Any) -> list[Any]:
        """A list of any values."""
        value = self.values.get(name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, list | tuple):
            raise self.refuse(name, "a list")
        return list(value)

    def texts(self, name: Any) -> list[str]:
        """A list of texts."""
        items = self.items(name)
        if not all(isinstance(item, str) for item in items):
            raise self.refuse(name, "a list of texts")
        return items

    def refuse_lengths(self, *names: str) -> None:
        """Refuse fields of one track that do not have the same number of frames."""
        fields = {name: self.values[name] for name in names if name in self}
        lengths = {
            name: len(value if isinstance(value, list) else np.atleast_1d(value))
            for name, value in fields.items()
        }
        if len(set(lengths.values())) > 1:
            got = ", ".join(f"'{name}' with {length}" for name, length in lengths.items())
            raise InputError(
                f"{self.where}: fields of one track must have the same number of frames, "
                f"got {got}; cut them to the same frames"
            )


def as_record(value: Any, where: str, remedy: str = AS_DISTRIBUTED) -> Record:
    """The record of a value that must be a dict; `remedy` is for errors on it and its fields."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: expected a dict of fields, got {described(value)}; {remedy}")
    return Record(where, value, remedy)


def only(value: Any) -> Any:
    """The element of a one-element array; any other value unchanged."""
    return value.item() if isinstance(value, np.ndarray) and value.size == 1 else value


def float32(values: Array) -> Tensor:
    """A float32 tensor, as all tracks are; numbers that are too large become infinite."""
    with np.errstate(over="ignore"):
        return torch.from_numpy(np.array(values, dtype=np.float32))


def described(value: Any) -> str:
    """A short description of a value for messages."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"{value.shape} of {value.dtype}"
    value = only(value)
    if isinstance(value, dict | list | tuple):
        return f"a {type(value).__name__} of {len(value)}"
    if isinstance(value, str):
        return f"text {value[:40]!r}"
    return f"{type(value).__name__} {value!r}"[:60]
