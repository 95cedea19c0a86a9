"""Types and shapes of calls, checked in the first calls of each function in each test.

A check takes longer than most functions of the library: a test that calls one a thousand times
would wait for its checks above all.
"""

from collections.abc import Callable
from typing import Any

import jaxtyping
from beartype import beartype

CALLS = 3  # calls of each function that are checked in each test
LIMIT = 20_000
"""Calls and results of a test after which jaxtyping is switched off until the next test: it takes
time at every call, whether shapes are then checked or not."""


class _Test:
    """The test that runs: its number, and how many calls and results it has had."""

    number, seen = 0, 0


def begin_test() -> None:
    """Check the next calls of every function again."""
    _Test.number, _Test.seen = _Test.number + 1, 0
    jaxtyping.config.update("jaxtyping_disable", False)


def first_calls(function: Callable[..., Any]) -> Callable[..., Any]:
    """A type checker for jaxtyping, which calls what this returns to check a call or its result.

    It is beartype's check of `function`, made at the first call: making it takes milliseconds, and
    a process that runs tests calls few of all functions.
    """
    check: Callable[..., Any] | None = None
    test, calls = 0, 0

    def checked(*args: Any, **kwargs: Any) -> Any:
        nonlocal check, test, calls
        if test != _Test.number:
            test, calls = _Test.number, 0
        calls += 1
        _Test.seen += 1
        if _Test.seen > LIMIT:
            jaxtyping.config.update("jaxtyping_disable", True)
        if calls > CALLS:
            return None
        check = check or beartype(function)
        return check(*args, **kwargs)

    return checked
