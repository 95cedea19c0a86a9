"""From a source's files to sequences, one clip after the other; what cannot be read is reported.

A clip is done when a line of `converted.jsonl` says so and its files are there: started again, the
conversion goes on behind the last whole clip.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import GeneOHError
from geneoh.files.atomic import unwritable, write_whole
from geneoh.files.outputs import check_outputs
from geneoh.geometry.mesh import Mesh
from geneoh.readers.base import ReaderOptions, Recording, SourceClip
from geneoh.readers.convention_check import contradictions
from geneoh.readers.meshes import obj_text
from geneoh.readers.npz_files import save_sequence
from geneoh.readers.recordings import read_clip
from geneoh.readers.registry import Source
from geneoh.sequence.validation import check_sequence

LOG = "converted.jsonl"


@dataclass(frozen=True)
class Outcome:
    """What became of one clip."""

    clip: SourceClip
    files: tuple[str, ...] = ()
    """Sequences written, relative to the output folder."""
    problem: str | None = None
    """Why it was not read, in one sentence."""
    contradictions: tuple[str, ...] = ()
    """What contradicts the source's convention, each with its recording in front."""
    notes: tuple[str, ...] = ()
    """Where each recording came from and what was assumed."""
    skipped: bool = False
    """It was done before."""

    @property
    def failed(self) -> bool:
        """Whether it was not read, or contradicts its convention."""
        return self.problem is not None or bool(self.contradictions)


def convert(
    source: Source,
    clips: list[SourceClip],
    folder: Path | None,
    options: ReaderOptions,
    *,
    check: bool = False,
    overwrite: bool = False,
) -> Iterator[Outcome]:
    """Convert clips to files in a folder, or to none, and report on each.

    A file that cannot be read is the problem of its clip. An error in geneoh's own code ends the
    conversion with its traceback: copying the files again would not help. With `check` the files
    are compared with their convention as well; `overwrite` replaces files that geneoh did not
    write, but never the clip's own.
    """
    done = {} if folder is None else read_log(folder)
    described = describe_options(options)
    for clip in clips:
        entry = f"{source.name} {clip.path} {described}"
        files = done.get(entry)
        if folder and files and not check and all((folder / file).is_file() for file in files):
            yield Outcome(clip, tuple(files), skipped=True)
            continue
        try:
            yield convert_clip(
                source, clip, folder, options, entry, check=check, overwrite=overwrite
            )
        except GeneOHError as error:
            yield Outcome(clip, problem=str(error))


def describe_options(options: ReaderOptions) -> str:
    """The options as text for the log: with other options a clip is another conversion."""
    described = {}
    for option in fields(options):
        value = getattr(options, option.name)
        if option.name == "meshes":
            value = [sha256(obj_text(mesh).encode()).hexdigest() for mesh in value]
        elif isinstance(value, np.ndarray):
            value = sha256(value.tobytes()).hexdigest()
        if value not in (None, False, []):
            described[option.name] = str(value)
    return json.dumps(described, sort_keys=True)


def convert_clip(
    source: Source,
    clip: SourceClip,
    folder: Path | None,
    options: ReaderOptions,
    entry: str,
    *,
    check: bool,
    overwrite: bool,
) -> Outcome:
    """One clip, all of its recordings or none; `entry` is its name in the log."""
    recordings = read_clip(source, clip, options)
    found: list[str] = []
    for recording in recordings:
        if check:
            found += [f"{recording.name}: {words}" for words in contradictions(recording)]
        else:
            check_sequence(recording.sequence, recording.name)
    notes = tuple(dict.fromkeys(recording.sequence.source for recording in recordings))
    if folder is None or found:
        return Outcome(clip, contradictions=tuple(found), notes=notes)
    check_places(recordings, folder, clip, overwrite=overwrite)
    files = tuple(write_recording(recording, folder) for recording in recordings)
    append_log(folder, {"clip": entry, "files": files})
    return Outcome(clip, files, notes=notes)


def check_places(
    recordings: list[Recording], folder: Path, clip: SourceClip, *, overwrite: bool
) -> None:
    """Make the folders of a clip's sequences, and refuse to replace the clip or files of others."""
    places = [folder / f"{recording.name}.npz" for recording in recordings]
    for place in places:
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise unwritable(place, error) from None
    check_outputs(places, inputs=[clip.path], overwrite=overwrite)


def write_recording(recording: Recording, folder: Path) -> str:
    """A sequence and its meshes; the sequence comes last and names them."""
    sequence, names = recording.sequence, recording.mesh_names
    written = [
        replace(mesh, source=folder / write_mesh(mesh, folder, name))
        for name, mesh in zip(names, sequence.object.meshes, strict=False)
    ]
    meshes = (*written, *sequence.object.meshes[len(written) :])
    sequence = replace(sequence, object=replace(sequence.object, meshes=meshes))
    path = folder / f"{recording.name}.npz"
    save_sequence(sequence, path)
    return f"{recording.name}.npz"


def write_mesh(mesh: Mesh, folder: Path, name: str) -> str:
    """The file of a mesh below a folder; one of that name that holds another mesh is kept."""
    text, name = obj_text(mesh), name.replace("/", "_")
    for number in count(1):
        file = f"objects/{name}{'' if number == 1 else f'_{number}'}.obj"
        if not (folder / file).is_file():
            write_whole(folder / file, text, parents=True)
            return file
        if (folder / file).read_bytes() == text.encode():
            return file
    raise AssertionError("numbers do not end")


def read_log(folder: Path) -> dict[str, list[str]]:
    """The files of each clip that is done; half a line, after a crash, counts for nothing."""
    path = folder / LOG
    lines = path.read_text(errors="replace").splitlines() if path.is_file() else []
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
    try:
        with (folder / LOG).open("a") as file:
            file.write(json.dumps(entry) + "\n")
    except OSError as error:
        raise unwritable(folder / LOG, error) from None
