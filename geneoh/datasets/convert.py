"""From a source's files to sequences, one clip after the other; what cannot be read is reported.

A clip is done when a line of `converted.jsonl` says so and its files are there: started again, the
conversion goes on behind the last whole clip.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.datasets.base import Clip, Known, Recording
from geneoh.datasets.catalogue import SOURCES, Source
from geneoh.datasets.objects import write_obj
from geneoh.datasets.selftest import contradictions
from geneoh.errors import ConfigError, GeneOHError, InputError
from geneoh.pickles.files import DAMAGE
from geneoh.sequence.checks import check_sequence
from geneoh.sequence.files import save_sequence

LOG = "converted.jsonl"


@dataclass(frozen=True)
class Outcome:
    """What became of one clip."""

    clip: Clip
    files: tuple[str, ...] = ()
    """Sequences written, relative to the output folder."""
    problem: str | None = None
    """Why it was not read, in one sentence."""
    contradictions: tuple[str, ...] = ()
    """What the self-test says against the convention, each with its recording in front."""
    notes: tuple[str, ...] = ()
    skipped: bool = False
    """It was done before."""


def source_named(name: str) -> Source:
    """The source of that name.

    Raises:
        ConfigError: there is none.
    """
    if name not in SOURCES:
        raise ConfigError(f"source {name}: expected one of {', '.join(SOURCES)}")
    return SOURCES[name]


def find_clips(source: Source, paths: list[Path]) -> list[Clip]:
    """Every clip of a source below some paths, each once.

    Raises:
        InputError: a path is not there, or holds nothing of this source.
    """
    found: dict[Path, Clip] = {}
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: no such file or folder; check the path")
        clips = source.adapter().find(path.resolve())
        if not clips:
            raise InputError(
                f"{path}: expected files of {source.title} at or below it, got none; give a folder "
                "as the data set unpacks, or choose another source"
            )
        found.update({clip.path: clip for clip in clips})
    names = [clip.name for clip in found.values()]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{paths[0]}: two clips are both called {twice}; convert them one by one")
    return list(found.values())


def read_clip(source: Source, clip: Clip, known: Known) -> list[Recording]:
    """The recordings of one clip.

    Raises:
        InputError: a file of it cannot be read; the message names it.
        MissingAssetError: it needs a file that the user must supply.
    """
    try:
        return source.adapter().read(clip, known)
    except GeneOHError:
        raise
    except DAMAGE as error:  # numbers that no check foresaw; the file is at fault, not the program
        reason = " ".join(str(error).split())[:100]
        raise InputError(
            f"{clip.path}: expected a clip of {source.title}, got numbers that fit no sequence "
            f"({type(error).__name__}: {reason}); copy its files again"
        ) from error


def convert(
    source: Source, clips: list[Clip], folder: Path | None, known: Known, *, check: bool = False
) -> Iterator[Outcome]:
    """Convert clips, telling of each what became of it.

    Args:
        source: whose files they are.
        clips: as `find_clips` gives them.
        folder: where to write; None to write nothing.
        known: what the caller knows.
        check: run the self-test as well.
    """
    done = {} if folder is None else read_log(folder)
    for clip in clips:
        files = done.get(f"{source.name} {clip.path}")
        if folder and files and not check and all((folder / file).is_file() for file in files):
            yield Outcome(clip, tuple(files), skipped=True)
            continue
        try:
            yield convert_clip(source, clip, folder, known, check=check)
        except GeneOHError as error:
            yield Outcome(clip, problem=str(error))


def convert_clip(
    source: Source, clip: Clip, folder: Path | None, known: Known, *, check: bool
) -> Outcome:
    """One clip, all of its recordings or none."""
    recordings = read_clip(source, clip, known)
    said: list[str] = []
    for recording in recordings:
        if check:
            said += [f"{recording.name}: {words}" for words in contradictions(recording)]
        else:
            check_sequence(recording.sequence, recording.name)
    notes = tuple(dict.fromkeys(recording.sequence.source for recording in recordings))
    if folder is None or said:
        return Outcome(clip, contradictions=tuple(said), notes=notes)
    files = tuple(write_recording(recording, folder) for recording in recordings)
    append_log(folder, {"clip": f"{source.name} {clip.path}", "files": files})
    return Outcome(clip, files, notes=notes)


def write_recording(recording: Recording, folder: Path) -> str:
    """A sequence and its meshes; the sequence comes last and names them."""
    names = [f"objects/{name}.obj" for name in recording.mesh_names]
    for name, mesh in zip(names, recording.sequence.object.meshes, strict=False):
        if not (folder / name).is_file():
            write_obj(mesh, folder / name)
    path = folder / f"{recording.name}.npz"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); choose another place"
        ) from None
    save_sequence(recording.sequence, path, extra={"object_files": np.array(names, dtype=str)})
    return f"{recording.name}.npz"


def read_log(folder: Path) -> dict[str, list[str]]:
    """The files of each clip that is done; half a line, after a crash, counts for nothing."""
    path = folder / LOG
    lines = path.read_text().splitlines() if path.is_file() else []
    done: dict[str, list[str]] = {}
    for line in lines:
        try:
            entry = json.loads(line)
            done[entry["clip"]] = [str(file) for file in entry["files"]]
        except (ValueError, KeyError, TypeError):
            continue
    return done


def append_log(folder: Path, entry: dict[str, Any]) -> None:
    """Note that a clip is done."""
    with (folder / LOG).open("a") as file:
        file.write(json.dumps(entry) + "\n")


def read_one(name: str, path: Path, known: Known, clip: str | None = None) -> Recording:
    """The one recording at a path, or the one of a name where there are several.

    Raises:
        InputError: there are several and no name chooses; the message lists them.
    """
    source = source_named(name)
    found = [
        recording
        for one in find_clips(source, [path])
        if clip is None or clip.startswith(one.name)
        for recording in read_clip(source, one, known)
        if clip is None or recording.name == clip
    ]
    if len(found) == 1:
        return found[0]
    names = ", ".join(recording.name for recording in found[:8]) or "none"
    raise InputError(
        f"{path}: expected one recording, got {names}; choose one with --clip NAME, or convert "
        "all of them with `geneoh convert`"
    )
