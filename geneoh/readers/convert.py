"""Convert a source's files to sequences, clip by clip; clips that cannot be read are reported.

A clip is skipped if its last record in `converted.jsonl` has the same options, the input and output
files named there are unchanged, and it was checked if it is to be. An interrupted conversion
therefore resumes.
"""

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import GeneOHError
from geneoh.files.atomic import make_folder, write_whole
from geneoh.files.fingerprints import fingerprint, fingerprints, is_done
from geneoh.files.journal import (
    CONVERTED,
    append_journal,
    begin_journal,
    only_run_in,
    read_journal,
    refuse_namesake,
)
from geneoh.files.outputs import check_outputs, keep_others
from geneoh.files.reading import noted_reads
from geneoh.geometry.mesh import Mesh, size_warning
from geneoh.readers.base import ReaderOptions, Recording, SourceClip
from geneoh.readers.checks.convention import contradictions
from geneoh.readers.meshes import obj_text
from geneoh.readers.npz.files import save_sequence
from geneoh.readers.pose_matching import PoseTrack
from geneoh.readers.recordings import check_recording, read_clip, refuse_unused
from geneoh.readers.registry import Source


@dataclass(frozen=True)
class ConversionOutcome:
    """The result of converting one clip."""

    clip: SourceClip
    files: tuple[str, ...] = ()
    """Sequences written, relative to the output folder."""
    problem: str | None = None
    """Why the clip was not read, in one sentence."""
    contradictions: tuple[str, ...] = ()
    """Contradictions of the source's convention, each after the name of its recording."""
    notes: tuple[str, ...] = ()
    """Where each recording came from and what was assumed."""
    skipped: bool = False
    """Whether an earlier run has converted the clip."""

    @property
    def failed(self) -> bool:
        """Whether the clip was not read, or contradicts its convention."""
        return self.problem is not None or bool(self.contradictions)


def convert(
    source: Source,
    clips: list[SourceClip],
    folder: Path | None,
    options: ReaderOptions,
    *,
    check: bool = False,
    overwrite: bool = False,
) -> Iterator[ConversionOutcome]:
    """Convert clips to files in a folder and yield the outcome of each; without one, write nothing.

    A file that cannot be read is reported as the `problem` of its clip, and the next clip follows.
    An error in geneoh's own code ends the conversion with a traceback. `check` also compares the
    files with their convention. `overwrite` replaces files that geneoh did not write, but never
    the clip's own.
    """
    refuse_unused(source, options)
    with nullcontext() if folder is None else only_run_in(folder):
        known = {} if folder is None else _records_before(clips, folder)
        for clip in clips:
            described = _described(source, clip, options)
            record = known.get(clip.name, {})
            is_known = not check or record.get("checked")
            if folder and is_known and is_done(record, described, folder):
                yield ConversionOutcome(clip, tuple(record["files"]), skipped=True)
                continue
            try:
                yield convert_clip(
                    source, clip, folder, options, described, check=check, overwrite=overwrite
                )
            except GeneOHError as error:
                yield ConversionOutcome(clip, problem=str(error))


def _described(source: Source, clip: SourceClip, options: ReaderOptions) -> dict[str, Any]:
    """Source, path and options of a clip for the journal; if they change, it is converted again."""
    return {
        "source": source.name,
        "path": str(clip.path),
        **{field.name: _as_json(getattr(options, field.name)) for field in fields(options)},
    }


def _as_json(value: Any) -> Any:
    """The value of an option for JSON; arrays and meshes become a digest."""
    if isinstance(value, np.ndarray):
        return f"{value.shape} {sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, PoseTrack):
        return {name: _as_json(part) for name, part in vars(value).items()}
    if isinstance(value, Mesh):
        return value.sha256
    if isinstance(value, Path):
        return str(value.resolve())
    return [_as_json(part) for part in value] if isinstance(value, tuple) else value


def convert_clip(
    source: Source,
    clip: SourceClip,
    folder: Path | None,
    options: ReaderOptions,
    described: dict[str, Any],
    *,
    check: bool,
    overwrite: bool,
) -> ConversionOutcome:
    """Convert one clip, all of its recordings or none; `described` is its entry in the journal."""
    inputs = {} if folder is None else fingerprints([clip.path])  # before it is read
    with noted_reads() as read:
        recordings = read_clip(source, clip, options)
    found: list[str] = []
    for recording in recordings:
        if check:
            found += [f"{recording.name}: {words}" for words in contradictions(recording)]
        else:
            check_recording(recording)
    notes = tuple(dict.fromkeys(note for recording in recordings for note in notes_on(recording)))
    if folder is None or found:
        return ConversionOutcome(clip, contradictions=tuple(found), notes=notes)
    places = [folder / f"{recording.name}.npz" for recording in recordings]
    for place in places:
        make_folder(place.parent)
    check_outputs(places, inputs=[clip.path], overwrite=overwrite)
    files = tuple(write_recording(recording, folder) for recording in recordings)
    inputs = fingerprints({clip.path, *read}) | inputs
    made = {file: fingerprint(folder / file) for file in files}
    record = {"clip": clip.name, "asked": described, "inputs": inputs, "files": made}
    append_journal(folder / CONVERTED, [record | {"checked": check}])
    return ConversionOutcome(clip, files, notes=notes)


def notes_on(recording: Recording) -> Iterator[str]:
    """Where a recording came from, and which meshes `geneoh denoise` will refuse by their size."""
    yield recording.sequence.source
    yield from filter(None, map(size_warning, recording.sequence.object.meshes))


def write_recording(recording: Recording, folder: Path) -> str:
    """Write a sequence and its meshes; the sequence comes last, because it names their files."""
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
    """Write a mesh below a folder; its name gets a number if another mesh has that name already."""
    text, name = obj_text(mesh), name.replace("/", "_")
    for number in count(1):
        file = f"objects/{name}{'' if number == 1 else f'_{number}'}.obj"
        if not (folder / file).is_file():
            write_whole(folder / file, text, parents=True)
            return file
        if (folder / file).read_bytes() == text.encode():
            return file
    raise AssertionError("numbers do not end")


def _records_before(clips: list[SourceClip], folder: Path) -> dict[str, dict[str, Any]]:
    """The last record of each clip in a folder's journal; all other lines of it are removed.

    `InputError` if one of `clips` has the name of another one that was converted.
    """
    path = folder / CONVERTED
    keep_others(path)
    records = {str(record.get("clip")): record for record in read_journal(path)}
    for clip in clips:
        refuse_namesake(records.get(clip.name, {}), clip.path, folder)
    if path.is_file():
        begin_journal(path, records.values())
    return records
