"""What results depend on: fingerprints of files, and versions of packages."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from glob import escape
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from typing import Any

from geneoh.errors import GeneOHError
from geneoh.files.reading import refuse_missing, unreadable

PACKAGES = ("geneoh", "torch", "numpy", "scipy", "libigl", "trimesh")
"""Packages whose version can change a result."""


def package_versions(*more: str) -> dict[str, Any]:
    """The versions of `PACKAGES` and of `more`; None for a package that is not installed."""
    found: dict[str, Any] = dict.fromkeys((*PACKAGES, *more))
    for name in found:
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def fingerprint(path: Path) -> str:
    """Size and SHA-256 of a file, or of the names, sizes and times of the files that `files_at` a
    path finds. `InputError` where there are none."""
    if path.is_file():
        return f"{path.stat().st_size} {_sha256(path)}"
    files = files_at(path)
    if not files:
        refuse_missing(path)
    stats = [(str(each.relative_to(path.parent)), each.stat()) for each in files]
    data = repr([(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]).encode()
    return f"{len(data)} {sha256(data).hexdigest()}"


def fingerprints(paths: Iterable[Path]) -> dict[str, str]:
    """The fingerprint of each path, by path, except of those at another one."""
    found: dict[str, str] = {}
    known: set[Path] = set()
    for path in sorted(paths):
        if known.isdisjoint((path, *path.parents)):
            found[str(path)] = fingerprint(path)
            known |= {path, *files_at(path)}
    return found


def files_at(path: Path) -> list[Path]:
    """The file itself; for a folder, all files below it. For a path that does not exist, all files
    that begin with it, as clips of OakInk do."""
    if path.is_file():
        return [path]
    inside = path.rglob("*") if path.is_dir() else path.parent.glob(f"{escape(path.name)}*")
    return sorted(each for each in inside if each.is_file())


def is_unchanged(fingerprints: dict[str, str], base: Path) -> bool:
    """Whether all of these files, relative to `base`, still have their recorded fingerprints."""
    try:
        return all(fingerprint(base / path) == known for path, known in fingerprints.items())
    except GeneOHError:
        return False


def is_done(record: Mapping[str, Any], described: Mapping[str, Any], folder: Path) -> bool:
    """Whether a journal's record is of the same work, and its inputs and outputs are unchanged.

    If another clip replaced an output file since, the fingerprint differs and the work is not done.
    """
    same = record.get("asked") == described
    return same and all(is_unchanged(record.get(name, {}), folder) for name in ("inputs", "files"))


def file_digests(paths: Iterable[Path]) -> dict[str, str]:
    """A digest of each of these files that exists, by its name without its ending."""
    return {path.stem: file_digest([path]) for path in paths if path.is_file()}


def file_digest(paths: Iterable[Path]) -> str:
    """SHA-256 of files' names and contents in the order of their names, first sixteen digits."""
    found = sha256()
    for path in sorted(paths):
        found.update(path.name.encode())
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def records_of(files: Iterable[tuple[str, Path]]) -> dict[str, tuple[int, str]]:
    """Size and SHA-256 of files by name."""
    return {name: (file.stat().st_size, _sha256(file)) for name, file in files}


def are_as_recorded(
    files: Sequence[tuple[str, Path]], records: Mapping[str, tuple[int, str]], made: Path
) -> bool:
    """Whether files still match the `records_of` them, from which the file `made` was made.

    Files that changed after `made` are compared by content, others by size only. Files that the
    records name by absolute paths are looked up there.
    """
    time = made.stat().st_mtime
    there = dict(files) | {name: Path(name) for name in records if Path(name).is_absolute()}
    if there.keys() != records.keys() or not all(file.is_file() for file in there.values()):
        return False
    for name, file in there.items():
        size, content = records[name]
        stat = file.stat()
        changed = max(stat.st_mtime, stat.st_ctime)  # moving a file keeps its mtime
        if stat.st_size != size or (changed > time and _sha256(file) != content):
            return False
    return True


def _sha256(file: Path) -> str:
    """SHA-256 of a file of any size, read once as long as nothing is written to it."""
    try:
        stat = file.stat()
        return _content(file, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
    except OSError as error:
        raise unreadable(file, error) from None


@lru_cache(maxsize=2**14)
def _content(file: Path, *_: int) -> str:
    """SHA-256 of a file; cached, because many clips share meshes and models of hands."""
    found = sha256()
    with file.open("rb") as opened:
        while block := opened.read(2**20):
            found.update(block)
    return found.hexdigest()
