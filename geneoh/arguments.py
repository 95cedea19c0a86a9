"""What public functions share: arguments that are checked, and calls apart from torch's modes."""

import inspect
import types
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from typing_extensions import ParamSpec

from geneoh.config import as_field_type, closest_name, plain_number
from geneoh.errors import ConfigError
from geneoh.modes import undisturbed

Options = TypeVar("Options")
Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def checked_call(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Decorate a public function to check its arguments against their annotations, and to run it
    `undisturbed` by the caller's modes.

    Paths, numbers, texts, choices and callables are checked; `ConfigError` names a wrong argument,
    or one that the function does not have.
    """
    signature = inspect.signature(function)
    plain = {n: p.annotation for n, p in signature.parameters.items() if is_plain(p.annotation)}

    @wraps(function)
    def checked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError:
            refuse_unknown(kwargs, signature.parameters, f"geneoh.{function.__name__}")
            return function(*args, **kwargs)  # raises Python's own TypeError
        for name in bound.arguments.keys() & plain.keys():
            bound.arguments[name] = value = plain_number(bound.arguments[name])
            as_field_type(value, plain[name], f"geneoh.{function.__name__}", name)
        with undisturbed():
            return function(*bound.args, **bound.kwargs)

    return checked


def refuse_unknown(
    names: Iterable[str], known: Mapping[str, inspect.Parameter], caller: str
) -> None:
    """`ConfigError` for a name that is no argument; for a setting it points to `options`."""
    kinds = get_args(known["options"].annotation) if "options" in known else ()
    for name in names:
        if name not in known:
            hint = closest_name(name, known)
            for kind in kinds:
                if name in getattr(kind, "__dataclass_fields__", ()):
                    hint = f"it is a setting, for options=geneoh.{kind.__name__}({name}=...)"
            raise ConfigError(f"{caller}: '{name}' is no argument; {hint}")


def is_plain(kind: Any) -> bool:
    """Whether a type is a path, number, text, choice or function, or any of several of them."""
    if get_origin(kind) in (Union, types.UnionType):
        return all(map(is_plain, get_args(kind)))
    plain = (float, int, bool, str, Path, types.NoneType)
    return get_origin(kind) in (Literal, Callable) or kind in plain


def given_options(given: Any, kind: type[Options], caller: str) -> Options:
    """The passed options, if they are of the expected class; `ConfigError` for anything else."""
    if not isinstance(given, kind):
        raise ConfigError(
            f"{caller}: 'options' must be geneoh.{kind.__name__}, got {given!r:.60}; "
            f"geneoh.{kind.__name__}(NAME=VALUE) makes them"
        )
    return given
