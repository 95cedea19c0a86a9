"""The record of an evaluation, one line a score: an interrupted run goes on where it was."""

import json
from collections.abc import Iterable
from dataclasses import asdict, fields
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from typing import Any

import geneoh
from geneoh.errors import ConfigError
from geneoh.evaluation.scores import Score
from geneoh.files.atomic import unwritable

RECORD = "scores.jsonl"
"""First line: the settings. Then one score a line, in the order they were made."""
PACKAGES = ("geneoh", "torch", "numpy", "scipy", "libigl", "trimesh")
NAMES = tuple(field.name for field in fields(Score))


def digest(paths: Iterable[Path]) -> str:
    """SHA-256 of files' contents in the order of their names, first sixteen digits."""
    found = sha256()
    for path in sorted(paths):
        found.update(path.name.encode())
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def provenance(weights: Iterable[Path]) -> dict[str, Any]:
    """What a number depends on besides the settings: versions, files of weights, our own code."""
    home = Path(geneoh.__file__).parent
    return {
        "versions": {name: metadata.version(name) for name in PACKAGES},
        "weights": {path.stem: digest([path]) for path in weights if path.is_file()},
        "code": digest(home.rglob("*.py")),
    }


def open_record(folder: Path, settings: dict[str, Any], *, fresh: bool = False) -> list[Score]:
    """Scores that a folder holds already; a new record is begun where there is none.

    Half a line, after a crash, counts for nothing.

    Args:
        folder: of the evaluation.
        settings: all that changes scores. Noises, seeds, clips and rows are part of each score and
            may differ from run to run.
        fresh: throw an earlier record away.

    Raises:
        ConfigError: the folder holds scores of other settings.
        InputError: it cannot be written to.
    """
    path = folder / RECORD
    head = json.dumps({"settings": settings}, sort_keys=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lines = path.read_text("utf-8").splitlines() if path.is_file() and not fresh else []
        if not lines:
            path.write_text(f"{head}\n", "utf-8")
            return []
        if not path.read_text("utf-8").endswith("\n"):
            path.write_text("".join(f"{line}\n" for line in lines), "utf-8")
    except OSError as error:
        raise unwritable(path, error) from None
    if lines[0] != head:
        raise ConfigError(
            f"{path}: holds scores of other settings ({difference(lines[0], settings)}); "
            "name another folder with -o, or pass --fresh to throw them away"
        )
    return [score for line in lines[1:] if (score := read_score(line)) is not None]


def append_scores(folder: Path, scores: Iterable[Score]) -> None:
    """Add scores to the record."""
    path = folder / RECORD
    try:
        with path.open("a", encoding="utf-8") as file:
            for score in scores:
                file.write(json.dumps(asdict(score)) + "\n")
    except OSError as error:
        raise unwritable(path, error) from None


def read_score(line: str) -> Score | None:
    """The score in one line; None for a line that is none."""
    try:
        found = json.loads(line)
        return Score(**{name: found[name] for name in NAMES})
    except (ValueError, KeyError, TypeError):
        return None


def difference(head: str, settings: dict[str, Any]) -> str:
    """The settings in which a record differs from what was asked for, by name."""
    try:
        other = json.loads(head)["settings"]
        named = [name for name in settings if other.get(name) != settings[name]]
    except (ValueError, KeyError, TypeError, AttributeError):
        return "its first line cannot be read"
    return ", ".join(named) or "of another version"
