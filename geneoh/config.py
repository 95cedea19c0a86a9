"""TOML files and `a.b=c` settings over frozen dataclasses: they hold differences, nothing more.

A configuration is any frozen dataclass; its defaults live where it is defined. What is given must
be the name of a field and of that field's type, otherwise the message says which one was meant.
"""

import difflib
import sys
import types
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from geneoh.errors import ConfigError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]  # of Python 3.10 alone

Config = TypeVar("Config")

NONE_WORDS = ("none", "null")
"""How `a.b=c` says None, for which TOML has no word."""


def configured(base: Config, path: Path | None = None, settings: Iterable[str] = ()) -> Config:
    """The configuration `base` with a file's differences, then with those of `a.b=c` settings.

    Raises:
        ConfigError: the file cannot be read, or a setting is unknown or of the wrong type.
    """
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
    """One value as TOML writes it; what is no TOML is text."""
    if text.lower() in NONE_WORDS:
        return None
    try:
        read = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return read["value"] if read.keys() == {"value"} else text


def with_table(base: Config, table: Mapping[str, Any], origin: str, prefix: str = "") -> Config:
    """`base` with the fields named in a table replaced, nested dataclasses by nested tables.

    Args:
        base: a dataclass instance.
        table: field names to values.
        origin: the file or option, for the message.
        prefix: dotted name of `base` within the whole, for the message.
    """
    kinds = get_type_hints(type(base))
    changes = {}
    for name, value in table.items():
        if name not in kinds:
            raise ConfigError(f"{origin}: {unknown(prefix + name, [prefix + k for k in kinds])}")
        current = getattr(base, name)
        if is_dataclass(current) and isinstance(value, Mapping):
            changes[name] = with_table(current, value, origin, f"{prefix}{name}.")
        else:
            changes[name] = convert(value, kinds[name], origin, prefix + name)
    return replace(base, **changes)  # type: ignore[type-var]  # any dataclass


def unknown(name: str, known: list[str]) -> str:
    """What to say of a name that is no field: the nearest one, or all there are."""
    near = difflib.get_close_matches(name, known, 1, 0.5)
    hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(sorted(known))}"
    return f"'{name}' is no setting; {hint}"


def convert(value: Any, kind: Any, origin: str, name: str) -> Any:
    """A value as a field of type `kind` holds it; whole numbers are floats too, lists tuples."""
    if fits(value, kind):
        return float(value) if kind is float else value
    origin_kind, arguments = get_origin(kind), get_args(kind)
    if origin_kind in (Union, types.UnionType):
        for choice in arguments:
            if not isinstance(value, Mapping) or is_dataclass(choice):
                try:
                    return convert(value, choice, origin, name)
                except ConfigError:
                    continue
    if origin_kind is tuple and isinstance(value, list | tuple):
        kinds = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        if len(kinds) == len(value):
            parts = enumerate(zip(value, kinds, strict=True))
            return tuple(convert(part, each, origin, f"{name}[{i}]") for i, (part, each) in parts)
    if kind is Path and isinstance(value, str):
        return Path(value)
    if isinstance(kind, type) and is_dataclass(kind) and isinstance(value, Mapping):
        return with_table(kind(), value, origin, f"{name}.")
    raise ConfigError(
        f"{origin}: '{name}' must be {described(kind)}, got {value!r}; correct the value"
    )


def fits(value: Any, kind: Any) -> bool:
    """Whether a value may stand as it is in a field of a plain type or a Literal."""
    if get_origin(kind) is Literal:
        return any(value == choice and type(value) is type(choice) for choice in get_args(kind))
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if kind in (int, bool, str, types.NoneType, Path):
        return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    return kind is Any


def described(kind: Any) -> str:
    """A type in words."""
    arguments = get_args(kind)
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(repr(choice) for choice in arguments)
    if get_origin(kind) in (Union, types.UnionType):
        return " or ".join(described(choice) for choice in arguments)
    if get_origin(kind) is tuple:
        each = [described(part) for part in arguments if part is not Ellipsis]
        return f"a list of {each[0]}" if Ellipsis in arguments else f"[{', '.join(each)}]"
    words = {int: "a whole number", float: "a number", bool: "true or false", str: "text"}
    words |= {Path: "a path", types.NoneType: "none"}
    return words.get(kind, f"a table of {getattr(kind, '__name__', kind)}")


def as_dict(config: Any) -> dict[str, Any]:
    """The resolved configuration as plain values that JSON can hold; `with_table` reads it back."""
    return {field.name: plain(getattr(config, field.name)) for field in fields(config)}


def plain(value: Any) -> Any:
    """One value of a configuration as JSON knows it."""
    if is_dataclass(value):
        return as_dict(value)
    if isinstance(value, tuple):
        return [plain(part) for part in value]
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
