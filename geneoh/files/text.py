"""Text for other programs: CSV, links of HTML pages, and JSON without NaN, which it lacks."""

import csv
import html
import io
import json
import os
from collections.abc import Iterable
from math import isfinite, nan
from typing import Any
from urllib.parse import quote


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as CSV, a line each."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def link(file: str, words: str) -> str:
    """A link of a page to a file beside it; its name may hold any letter."""
    return f'<a href="{quote(os.fsencode(file))}">{html.escape(words)}</a>'


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
