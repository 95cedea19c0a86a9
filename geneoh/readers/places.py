"""A point of the world that a user passes as text or as numbers."""

from typing import Any

from geneoh.errors import InputError
from geneoh.readers.records import Record

Place = tuple[float | int, float | int, float | int]
"""A point of the world, metres."""


def place_of(given: Any, caller: str) -> Place:
    """A camera's position passed from Python, as numbers or as a text for `place_in`."""
    if not isinstance(given, str):
        record = Record(caller, {"camera": given}, "give X, Y and Z in metres, or 'origin'")
        x, y, z = record.array("camera", (3,)).tolist()
        return x, y, z
    try:
        return place_in(given)
    except InputError as error:
        raise InputError(f"{caller}: 'camera' must be a place: {error}") from None


def place_in(text: str) -> Place:
    """A point from the text `X,Y,Z`, metres, or `origin`; `InputError` for anything else."""
    try:
        x, y, z = (0.0, 0.0, 0.0) if text.lower() == "origin" else map(float, text.split(","))
    except ValueError:
        raise InputError(
            f"expected three numbers X,Y,Z in metres, or origin, got {text!r}; correct it"
        ) from None
    return x, y, z
