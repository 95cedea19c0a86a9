"""JSON for other programs, which has no word for NaN."""

import json
from math import isfinite, nan
from typing import Any


def json_text(value: Any, indent: int | None = None) -> str:
    """A value as JSON; NaN and infinity, which most programs refuse in it, are null."""
    return json.dumps(with_null(value), indent=indent, allow_nan=False)


def with_nan(value: Any) -> Any:
    """A value of numbers that was read back, with NaN for every None."""
    if isinstance(value, dict):
        return {name: with_nan(part) for name, part in value.items()}
    return nan if value is None else value


def with_null(value: Any) -> Any:
    """A value as JSON can hold it, with None for every number that is not finite."""
    if isinstance(value, dict):
        return {name: with_null(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [with_null(part) for part in value]
    return None if isinstance(value, float) and not isfinite(value) else value
