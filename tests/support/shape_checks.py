"""Types and shapes of calls, checked in the first call of each function in each test.

A check takes longer than most functions of the library, and jaxtyping takes time at every call that
it sees, and where a function is made: a test that calls one a thousand times would wait for its
checks above all. So jaxtyping sees the first call alone.
"""

import dataclasses
import functools
import inspect
import threading
from collections.abc import Callable
from types import FunctionType, SimpleNamespace
from typing import Any, get_type_hints

import jaxtyping
from beartype.roar import BeartypeCallHintViolation

MARK = "_first_call_is_checked"

by_jaxtyping = jaxtyping.jaxtyped


_called: set[int] = set()
"""The functions that the test that runs has called, by the id of their code: those that a call of
another one makes anew share it."""


def begin_test() -> None:
    """Check the next call of every function again."""
    _called.clear()


def check_first_call() -> None:
    """Check the first call alone, in what jaxtyping's import hook decorates from now on."""
    jaxtyping.jaxtyped = jaxtyped


def jaxtyped(*, typechecker: Callable[..., Any]) -> Callable[[Any], Any]:
    """What jaxtyping's decorator of this name does, in the first call of each test."""

    def decorate(made: Any) -> Any:
        if not isinstance(made, type):
            return _checked(made, typechecker)
        if dataclasses.is_dataclass(made) and not hasattr(made.__init__, MARK):
            made.__init__ = _checked(made.__init__, typechecker)
        return made

    return decorate


def _checked(function: Callable[..., Any], typechecker: Callable[..., Any]) -> Callable[..., Any]:
    """The function, which jaxtyping wraps when its first call is checked."""
    key = id(function.__code__)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        if key in _called or jaxtyping.config.jaxtyping_disable:
            return function(*args, **kwargs)
        _called.add(key)
        if key not in _checks:
            _checks[key] = _Check(function, typechecker)
        return _checks[key](function, args, kwargs)

    setattr(call, MARK, True)
    return call


class _Check:
    """What jaxtyping makes of a function, for all functions of the same code.

    A function within another one is made anew in each call of that one, and jaxtyping takes a
    millisecond for each.
    """

    def __init__(self, function: Callable[..., Any], typechecker: Callable[..., Any]) -> None:
        self.code = function.__code__  # kept, so that no other one gets its id
        self.local = local = threading.local()

        def latest(*args: Any, **kwargs: Any) -> Any:
            __tracebackhide__ = True
            return local.functions[-1](*args, **kwargs)

        # in the names of the function's module, in which its annotations are looked up
        named = FunctionType(latest.__code__, function.__globals__, closure=latest.__closure__)
        functools.update_wrapper(named, function)
        named.__annotations__ = {
            name: _resolved(annotation, function.__globals__)
            for name, annotation in function.__annotations__.items()
        }
        if inspect.isgeneratorfunction(function):
            self.by_type = by_jaxtyping(named, typechecker=typechecker)
        else:  # given the checker, jaxtyping would check arguments before and after the call
            self.by_type = by_jaxtyping(typechecker(named), typechecker=None)

    def __call__(self, function: Callable[..., Any], args: Any, kwargs: Any) -> Any:
        """Call the function with its arguments and its result checked."""
        __tracebackhide__ = True
        functions = self.local.__dict__.setdefault("functions", [])
        functions.append(function)
        try:
            return self.by_type(*args, **kwargs)
        except BeartypeCallHintViolation as error:
            raise jaxtyping.TypeCheckError(str(error)) from error
        finally:
            functions.pop()


def _resolved(annotation: Any, names: dict[str, Any]) -> Any:
    """An annotation without names in quotes; Any where only type checkers know a name."""
    try:
        return get_type_hints(
            SimpleNamespace(__annotations__={"it": annotation}), names, include_extras=True
        )["it"]
    except Exception:
        return Any


_checks: dict[int, _Check] = {}
"""The checks that were made, by the id of the functions' code."""
