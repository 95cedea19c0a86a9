"""Files appear whole or not at all."""

import os
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from geneoh.errors import GeneOHError, InputError

STALE = 60.0
"""Seconds without a change after which an unfinished file counts as left by a killed process."""
LONGEST_NAME = 200
"""Bytes of a name that an unfinished file takes over: file systems allow 255 in all."""


@contextmanager
def in_one_step(path: Path, *, folder: bool = False, parents: bool = False) -> Iterator[Path]:
    """A new file or folder that becomes `path` when the block ends without an error.

    Until then it is called `.NAME.NUMBER.tmp`, in the same folder; after an error it is removed.
    Leftovers of killed processes that are a minute old are removed by the next write of `path`. A
    file at `path` is replaced and a link followed; a `folder` must be new. `parents` makes missing
    folders above it. `InputError` where the place cannot be written to.
    """
    path, beside = path if folder else replaceable(path), None
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        beside = reserved_beside(path, folder=folder)
        yield beside
        if not folder:
            with beside.open("rb+") as file:
                os.fsync(file.fileno())
        beside.replace(path)
    except GeneOHError:  # some are OSErrors too
        raise
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        if beside is not None:
            remove(beside)


def replaceable(path: Path) -> Path:
    """The path that a write replaces, after links; `InputError` for all but regular files."""
    place = Path(os.path.realpath(path)) if os.path.islink(path) else path
    if os.path.lexists(place) and not os.path.isfile(place):
        kinds = {stat.S_IFDIR: "folder", stat.S_IFCHR: "device", stat.S_IFBLK: "device"}
        kinds |= {stat.S_IFIFO: "pipe", stat.S_IFSOCK: "socket", stat.S_IFLNK: "broken link"}
        kind = kinds.get(stat.S_IFMT(place.lstat().st_mode), "special file")
        raise InputError(
            f"{path}: expected a regular file or a new name, got a {kind}; choose another place"
        )
    return place


def reserved_beside(path: Path, *, folder: bool) -> Path:
    """An empty file or folder beside `path` that is ours alone; stale ones are removed."""
    name = path.name
    while len(os.fsencode(name)) > LONGEST_NAME:
        name = name[:-1]
    for number in count():
        beside = path.with_name(f".{name}.{number}.tmp")
        try:
            beside.mkdir() if folder else beside.touch(exist_ok=False)
        except FileExistsError:
            with suppress(FileNotFoundError):  # another process may have removed it by now
                if time.time() - beside.stat().st_mtime > STALE:
                    remove(beside)
        else:
            return beside
    raise AssertionError("there is always a next number")


def write_whole(path: Path, data: bytes | str, *, parents: bool = False) -> None:
    """Write a file in one step: `path` holds the old file or the whole new one, never a part.

    Text is written as UTF-8, with ? for what UTF-8 cannot encode, such as parts of old file names.
    """
    with in_one_step(path, parents=parents) as beside:
        beside.write_bytes(data.encode(errors="replace") if isinstance(data, str) else data)


def remove(path: Path) -> None:
    """Remove a file or a folder, where there is one."""
    if os.path.isdir(path):
        shutil.rmtree(path, ignore_errors=True)
    path.unlink(missing_ok=True)


def make_folder(folder: Path) -> None:
    """Make a folder, and those that it is in; `InputError` where it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(folder, error) from None


def unwritable(path: Path, error: OSError) -> InputError:
    """The error for a place that cannot be written to."""
    return InputError(f"{path}: cannot be written ({error.strerror}); choose another place")
