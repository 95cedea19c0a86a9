"""Read the bytes of foreign files, up to a limit; every failure is an `InputError`.

`noted_reads` tells which files were read.
"""

import csv
import lzma
import os
import pickle
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import chain
from pathlib import Path
from typing import TextIO

from geneoh.errors import ConfigError, InputError

SIZE_LIMIT = 2**30
"""Most bytes of one file, and of all arrays made from it; an hour of two hands takes half."""

BUDGET_VARIABLE, BUDGET = "GENEOH_MAX_BYTES", 2 * 10**9
"""Environment variable with the memory that reading one npz may take in bytes, and its default."""

DAMAGE = (
    *(ArithmeticError, AssertionError, AttributeError, EOFError, LookupError, MemoryError),
    *(RuntimeError, SyntaxError, TypeError, ValueError, csv.Error, lzma.LZMAError, struct.error),
    *(pickle.UnpicklingError, tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)
"""Exceptions of Python's and numpy's readers for damaged files; numpy, for one, parses the header
of an array as Python literals."""

HEAD_BYTES = 200
"""Bytes at the start of a file that tell what it is."""
EXPORT = "export what it holds of hands or objects as CSV or JSON"
STAND_INS = (
    ((b"#rosbag", b"\x89mcap"), f"a ROS bag; {EXPORT}"),
    (b"sqlite format 3", f"a database of SQLite, as a ROS bag may be; {EXPORT}"),
    (b"version https://git-lfs", "a pointer of Git LFS; fetch the file itself with `git lfs pull`"),
    (
        (b"<!doctype html", b"<html"),
        "a web page; give the file itself, which some servers send only to users who are logged in",
    ),
)
"""Files that often stand in for the real one: their first bytes in lower case, and the words that
describe them in a message."""

_NOTED: ContextVar[set[Path] | None] = ContextVar("noted", default=None)


@contextmanager
def noted_reads() -> Iterator[set[Path]]:
    """The absolute paths of the files and folders that are read within the block."""
    noted: set[Path] = set()
    before = _NOTED.set(noted)
    try:
        yield noted
    finally:
        _NOTED.reset(before)


def note_read(path: Path) -> None:
    """Note that a file, or the list of files in a folder, was read; see `noted_reads`."""
    if (noted := _NOTED.get()) is not None:
        noted.add(path.absolute())


def reason(error: Exception) -> str:
    """The text of an error of `DAMAGE`, shortened, with its type unless that is ValueError."""
    text = " ".join(str(error).split())[:100]
    return text if type(error) is ValueError else f"{type(error).__name__}: {text}"


def byte_budget() -> int:
    """Bytes of memory that reading one npz may take; `ConfigError` where the user set no number."""
    text = os.environ.get(BUDGET_VARIABLE, str(BUDGET))
    if not text.isdecimal() or len(text) > 18:
        raise ConfigError(
            f"{BUDGET_VARIABLE} must be a whole number of bytes, got {text[:40]!r}; "
            f"the default is {BUDGET}"
        )
    return int(text)


def read_bytes(path: Path, limit: int = SIZE_LIMIT) -> bytes:
    """The bytes of a file; `InputError` where it cannot be read, or is larger than `limit`."""
    try:
        refuse_large(path, limit)
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from None
    note_read(path)
    refuse_stand_in(path, data[:HEAD_BYTES])
    return data


def open_text(path: Path, limit: int) -> TextIO:
    """A text file, without the byte order mark that Excel writes; `InputError` as `read_bytes`."""
    try:
        refuse_large(path, limit)
        refuse_stand_in(path, head_of(path))
        return path.open(encoding="utf-8-sig", errors="replace", newline="")
    except OSError as error:
        raise unreadable(path, error) from None


def table_in(file: TextIO) -> tuple[Iterator[str], str]:
    """The lines of a table, and what separates its cells."""
    heading = file.readline()
    return chain([heading], file), separator_of(heading)


def separator_of(heading: str) -> str:
    """What separates cells; Excel writes semicolons where decimals have commas."""
    return max(",;\t", key=heading.count)


def refuse_large(path: Path, limit: int) -> None:
    """Raise where a file is larger than `limit` bytes, or a pipe or device without an end."""
    found = path.stat()
    if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
        raise InputError(
            f"{path}: must be a regular file, got a pipe or a device; "
            "write what it gives to a file and pass that"
        )
    if (size := found.st_size) > limit:
        raise InputError(
            f"{path}: must have at most {limit / 2**20:g} MiB, got {size / 2**20:.0f}; "
            "cut it into shorter ones"
        )


def refuse_missing(path: Path) -> None:
    """Raise where there is neither a file nor a folder."""
    try:
        path.stat()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file or folder; check the path") from None
    except OSError as error:
        raise unreadable(path, error) from None


def head_of(path: Path) -> bytes:
    """The first `HEAD_BYTES` bytes of a file; `InputError` where it cannot be read."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise unreadable(path, error) from None
    note_read(path)
    return head


def refuse_stand_in(path: Path, head: bytes) -> None:
    """Raise where the first bytes show a Git LFS pointer or a web page instead of the file."""
    start = head.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    for starts, words in STAND_INS:
        if start.startswith(starts):
            raise InputError(f"{path}: expected data, got {words}")


def unreadable(path: Path, error: OSError) -> InputError:
    """The error for a file that the operating system does not let us read."""
    if isinstance(error, FileNotFoundError):
        return InputError(f"{path}: no such file; check the path")
    cure = "check the path"
    if isinstance(error, IsADirectoryError):
        cure = "name a file in it, or say with --from whose data it is"
    return InputError(f"{path}: cannot be read ({error.strerror}); {cure}")
