"""Fingerprints of files: whether what a run read and wrote is still as it was."""

from glob import escape
from hashlib import sha256
from pathlib import Path

from geneoh.errors import GeneOHError
from geneoh.files.reading import read_bytes


def fingerprint(path: Path) -> str:
    """Size and SHA-256 of a file; else of names, sizes and times of the files that it stands for.

    These are all below a folder, or those whose names begin with a path that is no file itself, as
    OakInk's clips are. `InputError` where there are none.
    """
    inside = path.rglob("*") if path.is_dir() else path.parent.glob(f"{escape(path.name)}*")
    files = [] if path.is_file() else sorted(each for each in inside if each.is_file())
    stats = [(str(each.relative_to(path.parent)), each.stat()) for each in files]
    data = repr([(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]).encode()
    if not files and not path.is_dir():
        data = read_bytes(path)
    return f"{len(data)} {sha256(data).hexdigest()}"


def is_unchanged(fingerprints: dict[str, str], base: Path) -> bool:
    """Whether all of these files, relative to a folder, are there and as they were."""
    try:
        return all(fingerprint(base / path) == known for path, known in fingerprints.items())
    except GeneOHError:
        return False
