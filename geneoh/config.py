"""Configurations: frozen dataclasses, and TOML files and `a.b=c` settings that change their fields.

Files and settings hold only the differences from the defaults of the dataclass. A name must be a
field, and the value of the field's type; otherwise the message suggests the closest name.
"""

import difflib
import math
import os
import sys
import types
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from geneoh.errors import ConfigError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]  # of Python 3.10 alone

Config = TypeVar("Config")

Limits = Mapping[str, tuple[int | float, int | float]]
"""The least and the largest value of numbers, by the names of fields."""
NONE_WORDS = ("none", "null")  # words for None in `a.b=c`; TOML has none


def configured(base: Config, path: Path | None = None, settings: Iterable[str] = ()) -> Config:
    """The configuration `base` with the values of a file, then with those of `a.b=c` settings;
    `ConfigError` for a file that cannot be read, and a setting that is unknown or of the wrong
    type."""
    if path is not None:
        base = with_table(base, read_toml(path), str(path))
    for setting in settings:
        base = with_table(base, parse_setting(setting), f"--set {setting}")
    return base


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file."""
    try:
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: expected TOML, got {error}; correct it there") from None


def parse_setting(setting: str) -> dict[str, Any]:
    """`a.b=c` as nested tables; the value is TOML, or a bare word for text, or none."""
    name, equals, text = setting.partition("=")
    keys = [key.strip() for key in name.split(".")]
    if not equals or not all(keys):
        raise ConfigError(f"--set {setting}: expected NAME=VALUE, such as motion.depth=6; add both")
    table: Any = parse_value(text.strip())
    for key in reversed(keys):
        table = {key: table}
    return table


def parse_value(text: str) -> Any:
    """A value as TOML writes it; anything else is text."""
    if text.lower() in NONE_WORDS:
        return None
    try:
        read = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return read["value"] if read.keys() == {"value"} else text


def with_table(base: Config, table: Mapping[str, Any], origin: str, prefix: str = "") -> Config:
    """`base` with the fields named in a table replaced, nested dataclasses by nested tables.

    Raises:
        ConfigError: a name is no field, or a value is not of the field's type. The message names
            `origin`, the file or option, and the field, with the dotted `prefix` of `base`.
    """
    hints = get_type_hints(type(base))  # also of constants of the class
    types_of_fields = {field.name: hints[field.name] for field in fields(base)}  # type: ignore[arg-type]
    changes = {}
    for name, value in table.items():
        if name not in types_of_fields:
            known = sorted(prefix + each for each in types_of_fields)
            hint = closest_name(prefix + name, known)
            raise ConfigError(f"{origin}: '{prefix}{name}' is no setting; {hint}")
        current = getattr(base, name)
        if is_dataclass(current) and isinstance(value, Mapping):
            changes[name] = with_table(current, value, origin, f"{prefix}{name}.")
        else:
            changes[name] = as_field_type(value, types_of_fields[name], origin, prefix + name)
    return replace(base, **changes)  # type: ignore[type-var]  # any dataclass


def check_fields(options: Any, limits: Limits = types.MappingProxyType({})) -> None:
    """Check and convert the fields of a new frozen dataclass that a user fills in.

    Numbers of numpy become Python's, and texts become paths in fields of paths. `limits` are the
    least and the largest value of numbers by the names of their fields; whole numbers without one
    are 1 or more.

    Raises:
        ConfigError: a value is not of its field's type, or outside of its limits.
    """
    origin = type(options).__name__
    known: dict[str, tuple[int | float, int | float]] = {}
    for name, kind in get_type_hints(type(options)).items():
        value = as_field_type(getattr(options, name), kind, origin, name)
        object.__setattr__(options, name, value)
        if name in limits or type(value) is int:
            known[name] = limits.get(name, (1, math.inf))
    check_limits(options, known)


def check_limits(config: Any, limits: Limits) -> None:
    """`ConfigError` for a number outside of the least and the largest value that its field may
    have, and for a range that does not rise."""
    for name, (low, high) in limits.items():
        value = getattr(config, name)
        values = value if isinstance(value, tuple) else () if value is None else (value,)
        if not all(low <= each <= high for each in values):  # NaN is outside
            words = f"{low} or more" if high == math.inf else f"{low} to {high}"
            raise ConfigError(
                f"{type(config).__name__}: '{name}' must be {words}, got {value}; correct the value"
            )
        if isinstance(value, tuple) and value[0] > value[-1]:
            raise ConfigError(
                f"{type(config).__name__}: '{name}' must be the lower and the higher end of a "
                f"range, got {value}; exchange them"
            )


@dataclass(frozen=True)
class Limited:
    """Settings whose numbers are checked when they are made."""

    LIMITS: ClassVar[Limits] = {}
    """Limits of single fields. By default whole numbers are 1 to `LARGEST`, fields with names that
    end in `share` 0 to 1, and other numbers 0 or more."""
    LARGEST: ClassVar[int] = 10**9

    def __post_init__(self) -> None:
        """Refuse numbers outside of their limits."""
        usual: dict[type, tuple[float, float]] = {int: (1, self.LARGEST), float: (0, math.inf)}
        kinds = {field.name: type(getattr(self, field.name)) for field in fields(self)}
        limits = {name: usual[kind] for name, kind in kinds.items() if kind in usual}
        shares = {name: (0, 1) for name in limits if f"_{name}".endswith("_share")}
        check_limits(self, limits | shares | dict(self.LIMITS))


def plain_number(value: Any) -> Any:
    """A real number of numpy, torch or another package as a Python number; other values as is."""
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):
        return value.item()
    return float(value) if isinstance(value, Real) and not isinstance(value, int | float) else value


def closest_name(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: the closest one that exists, or all of them."""
    known = list(known)
    near = difflib.get_close_matches(name, known, 1, 0.5)
    return f"did you mean '{near[0]}'?" if near else f"there are {', '.join(known)}"


def as_field_type(value: Any, wanted: Any, origin: str, name: str) -> Any:
    """A value converted to the type `wanted`, such as a list to a tuple; else `ConfigError`."""
    value = plain_number(value)
    if is_plain_value_of(value, wanted):
        return float(value) if wanted is float else value
    outer, arguments = get_origin(wanted), get_args(wanted)
    if outer in (Union, types.UnionType):
        for choice in arguments:
            if not isinstance(value, Mapping) or is_dataclass(choice):
                try:
                    return as_field_type(value, choice, origin, name)
                except ConfigError:
                    continue
    if outer is tuple and isinstance(value, list | tuple):
        each = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        if len(each) == len(value):
            parts = enumerate(zip(value, each, strict=True))
            return tuple(as_field_type(v, kind, origin, f"{name}[{i}]") for i, (v, kind) in parts)
    if wanted is Path and isinstance(value, str):
        return Path(value)
    if isinstance(wanted, type) and is_dataclass(wanted) and isinstance(value, Mapping):
        return with_table(wanted(), value, origin, f"{name}.")
    words = type_in_words(wanted)
    raise ConfigError(f"{origin}: '{name}' must be {words}, got {value!r:.60}; correct the value")


def is_plain_value_of(value: Any, wanted: Any) -> bool:
    """Whether a field of a plain type, a Literal or a Callable can hold a value as it is."""
    if get_origin(wanted) is Literal:
        return any(value == each and type(value) is type(each) for each in get_args(wanted))
    if get_origin(wanted) is Callable:
        return callable(value)
    if wanted is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if wanted is Path:
        return isinstance(value, os.PathLike)
    if wanted in (int, bool, str, types.NoneType):
        return isinstance(value, wanted) and (wanted is bool or not isinstance(value, bool))
    if isinstance(wanted, type) and is_dataclass(wanted):
        return isinstance(value, wanted)
    return wanted is Any


def type_in_words(wanted: Any) -> str:
    """The type of a field as a message names it."""
    arguments = get_args(wanted)
    if get_origin(wanted) is Literal:
        return "one of " + ", ".join(repr(choice) for choice in arguments)
    if get_origin(wanted) in (Union, types.UnionType):
        return " or ".join(type_in_words(choice) for choice in arguments)
    if get_origin(wanted) is tuple:
        each = [type_in_words(part) for part in arguments if part is not Ellipsis]
        return f"a list of {each[0]}" if Ellipsis in arguments else f"[{', '.join(each)}]"
    if get_origin(wanted) is Callable:
        return "a function"
    words = {int: "a whole number", float: "a number", bool: "true or false", str: "text"}
    words |= {Path: "a path", types.NoneType: "none"}
    return words.get(wanted, f"a table of {getattr(wanted, '__name__', wanted)}")


def as_dict(config: Any) -> dict[str, Any]:
    """The resolved configuration as plain values that JSON can hold; `with_table` reads it back."""
    return {field.name: as_json_value(getattr(config, field.name)) for field in fields(config)}


def as_json_value(value: Any) -> Any:
    """One value of a configuration as JSON can hold it."""
    if is_dataclass(value):
        return as_dict(value)
    if isinstance(value, tuple):
        return [as_json_value(part) for part in value]
    return str(value) if isinstance(value, Path) else value


def flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings by their dotted names."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = value
    return found


def setting_differences(found: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    """For a message: how nested settings `found` differ from the requested ones; else empty."""
    was, wanted = flat(found), flat(asked)
    return ", ".join(
        f"{name} {_shown(was.get(name))} where {_shown(value)} is asked for"
        for name, value in wanted.items()
        if name not in was or was[name] != value
    )


def _shown(value: Any) -> Any:
    """A setting in a sentence, in which an empty text is nothing at all."""
    return "none" if value is None or value == "" else value
