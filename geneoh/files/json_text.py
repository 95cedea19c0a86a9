"""JSON for other programs, without NaN and infinity, which the format lacks."""

import json
from math import isfinite, nan
from typing import Any


def json_text(value: Any, indent: int | None = None) -> str:
    """A value as JSON, with null for NaN and infinity, which most JSON readers refuse."""
    return json.dumps(with_null(value), indent=indent, allow_nan=False)


def with_nan(value: Any) -> Any:
    """A value that was read from JSON, with NaN for every null."""
    if isinstance(value, dict):
        return {name: with_nan(part) for name, part in value.items()}
    return nan if value is None else value


def with_null(value: Any) -> Any:
    """A value with None for every number that is not finite, as JSON can hold it."""
    if isinstance(value, dict):
        return {name: with_null(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [with_null(part) for part in value]
    return None if isinstance(value, float) and not isfinite(value) else value
