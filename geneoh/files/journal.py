"""The journal of a run, one JSON object a line, and the lock that keeps other runs out."""

import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from geneoh.errors import InputError
from geneoh.files.atomic import make_folder, unwritable, write_whole
from geneoh.files.fingerprints import fingerprint
from geneoh.files.text import json_text

LOCK = ".geneoh.lock"
JOURNALS = CONVERTED, CLEANED, SCORED = "converted.jsonl", "journal.jsonl", "scores.jsonl"
"""Names of the journals that runs leave in folders; they do not count as recordings there."""
Record = Mapping[str, Any]
FIRST_NAMES = (("options", "weights"), ("settings", "versions"), ("clip", "asked"))
"""Two fields of the first record of each kind of journal; a record begins with the first one."""


def read_journal(path: Path) -> list[dict[str, Any]]:
    """The records of a journal, none where there is no file; a line that was cut off is dropped."""
    try:
        lines = path.read_bytes().splitlines() if path.is_file() else []
    except OSError as error:
        raise unwritable(path, error) from None
    found = []
    for line in lines:
        with suppress(ValueError):
            found.append(json.loads(line))
    return [record for record in found if isinstance(record, dict)]


def is_journal(path: Path) -> bool:
    """Whether a file is a journal of a run, judged by its first record, which may be cut off."""
    try:
        with path.open("rb") as file:
            first = file.readline()
    except OSError:
        return False
    try:
        record = json.loads(first)
    except (ValueError, RecursionError):
        starts = [f'{{"{name}": '.encode() for name, _ in FIRST_NAMES]
        cut_off = not first.endswith(b"\n")
        return cut_off and any(first[: len(start)] == start[: len(first)] for start in starts)
    return isinstance(record, dict) and any(set(names) <= record.keys() for names in FIRST_NAMES)


def results_in(folder: Path, name: str) -> set[Path]:
    """The real paths of the results of earlier runs in a folder, by their journal of this name."""
    records = read_journal(folder / name) if is_journal(folder / name) else []
    return {(folder / file).resolve() for record in records for file in record.get("files", ())}


def refuse_namesake(record: Record, path: Path, folder: Path) -> None:
    """`InputError` where a folder has a result of another clip than that at `path` under its name;
    `record` is the last one of the name. The same files at another path are the same clip."""
    other = record.get("asked", {}).get("path", path)
    there = any((folder / file).is_file() for file in record.get("files", ()))
    if not there or Path(other).resolve() == path.resolve():
        return
    if record.get("inputs", {}).get(str(other)) != fingerprint(path):
        raise InputError(
            f"{path}: its name '{record['clip']}' is that of the result of {other} in {folder}; "
            "name another folder, or remove that result"
        )


def begin_journal(path: Path, records: Iterable[Record]) -> None:
    """Write a new journal in one step, in place of an old one; makes its folder."""
    write_whole(path, "".join(json_text(record) + "\n" for record in records), parents=True)


def append_journal(path: Path, records: Iterable[Record]) -> None:
    """Add records, which are on the disk when this returns."""
    try:
        with path.open("a", encoding="utf-8") as file:
            file.writelines(json_text(record) + "\n" for record in records)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise unwritable(path, error) from None


@contextmanager
def only_run_in(folder: Path, name: str = LOCK) -> Iterator[None]:
    """Make a folder and lock it against other runs; the lock ends with the process.

    `name` is the name of the lock file; it excludes runs that use the same one. Folders that were
    made for the run and are empty at its end are removed. `InputError` where another run is
    working, or where it cannot be written to.
    """
    path = folder / name
    missing = [each for each in (folder, *folder.parents) if not os.path.exists(each)]
    make_folder(folder)
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise unwritable(folder, error) from None
    try:
        lock(descriptor, folder)
        try:
            yield
        finally:
            with suppress(OSError):  # some systems do not remove open files
                path.unlink()
    finally:
        os.close(descriptor)
        with suppress(OSError):  # such as one that is not empty
            for each in missing:
                each.rmdir()


def lock(descriptor: int, folder: Path) -> None:
    """Take the lock of an open file of a folder, on file systems that have locks."""
    if sys.platform == "win32":
        return
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        free = os.fstat(descriptor).st_nlink > 0  # else a run that ended just now removed it
    except BlockingIOError:
        free = False
    except OSError:
        free = True
    if not free:
        raise InputError(
            f"{folder}: another run is working in it; wait for its end, or name another folder"
        )
