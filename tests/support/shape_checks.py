"""Types and shapes of calls, checked in the first calls of each function in each test.

A check takes longer than most functions of the library: a test that calls one a thousand times
would wait for its checks above all.
"""

from collections.abc import Callable
from typing import Any

import jaxtyping
from beartype import beartype

CALLS = 3  # of each function in each test that are checked
ALL_CALLS = 20_000  # of a test after which nothing is checked: to ask whether takes time as well


class _Test:
    """The test that runs."""

    number, calls = 0, 0


def begin_test() -> None:
    """Check the next calls of every function again."""
    _Test.number, _Test.calls = _Test.number + 1, 0
    jaxtyping.config.update("jaxtyping_disable", False)


def first_calls(function: Callable[..., Any]) -> Callable[..., Any]:
    """A checker of types for jaxtyping, whose functions have checks for a body.

    Checks are compiled when a function is first called: most functions no worker of a run calls.
    """
    check: Callable[..., Any] | None = None
    test, calls = 0, 0

    def checked(*args: Any, **kwargs: Any) -> Any:
        nonlocal check, test, calls
        if test != _Test.number:
            test, calls = _Test.number, 0
        calls += 1
        _Test.calls += 1
        if _Test.calls > ALL_CALLS:
            jaxtyping.config.update("jaxtyping_disable", True)
        if calls > CALLS:
            return None
        check = check or beartype(function)
        return check(*args, **kwargs)

    return checked
