"""Lists of lists as arrays, and shapes that an array may have."""

from collections.abc import Iterable
from itertools import permutations
from typing import Any

import numpy as np

Shape = tuple[int | str, ...]
"""Sizes of the axes: a number, or a letter for any size from 1 up. Equal letters, equal sizes."""

NUMBERS_LIMIT = 2**27
"""Most numbers in one field: a gigabyte as float64, although a file may store them as bytes."""

NESTING_LIMIT = 64
"""Greatest depth of nested lists that numpy turns into an array."""


def count_entries(value: Any, seen: dict[int, int] | None = None, depth: int = 0) -> int:
    """How many numbers a list of lists would become; a list that occurs twice counts twice.

    Counted before the array is made: fifty lists that each hold the next one twice fill any memory.
    Lists that numpy would not turn into an array count as too many.
    """
    if isinstance(value, np.ndarray):
        return value.size
    if not isinstance(value, list | tuple):
        return 1
    if depth > NESTING_LIMIT:
        return NUMBERS_LIMIT + 1
    seen = {} if seen is None else seen
    if id(value) not in seen:
        seen[id(value)] = NUMBERS_LIMIT + 1  # ends the recursion for a list that holds itself
        seen[id(value)] = sum(count_entries(item, seen, depth + 1) for item in value)
    return seen[id(value)]


def array_in(value: Any) -> np.ndarray:
    """Nested lists or arrays as one array; None in place of a row becomes a row of NaN."""
    try:
        return np.asarray(value)
    except ValueError:
        filled = without_gaps(value)
        if count_entries(filled) > NUMBERS_LIMIT:
            raise
        return np.asarray(filled)


def without_gaps(value: Any) -> Any:
    """Nested lists with rows of NaN for rows that are None; `ValueError` for ragged lists."""
    if not isinstance(value, list):
        return value
    rows = [without_gaps(each) for each in value]
    like = next((row for row in rows if np.ndim(row)), None)
    lost = None if like is None else np.full(np.shape(like), np.nan)
    return [lost if row is None else row for row in rows]


def is_transposed(shape: tuple[int, ...], patterns: Iterable[Shape]) -> bool:
    """Whether an array's shape is one that a pattern allows with its axes in another order."""
    return any(matches(shape, each) for pattern in patterns for each in permutations(pattern))


def matches(shape: tuple[int, ...], pattern: Shape) -> bool:
    """Whether an array's shape is one that the pattern allows."""
    sizes: dict[str, int] = {}
    return len(shape) == len(pattern) and all(
        0 < size == sizes.setdefault(want, size) if isinstance(want, str) else size == want
        for size, want in zip(shape, pattern, strict=True)
    )


def without_ones(shape: Shape) -> Shape:
    """A shape without its axes of one."""
    return tuple(size for size in shape if size != 1)


def shown_shape(shape: Shape) -> str:
    """A shape for a message."""
    return f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
