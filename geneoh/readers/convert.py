"""From a source's files to sequences, one clip after the other; what cannot be read is reported.

A clip is done when a line of `converted.jsonl` says so and its files are there: started again, the
conversion goes on behind the last whole clip.
"""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import Side
from geneoh.errors import ConfigError, GeneOHError, InputError
from geneoh.files.atomic import unwritable, write_whole
from geneoh.geometry.mesh import Mesh
from geneoh.pickles.files import DAMAGE
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clip_name
from geneoh.readers.convention_check import contradictions
from geneoh.readers.meshes import obj_text
from geneoh.readers.npz_files import save_sequence
from geneoh.readers.registry import SOURCES, Source
from geneoh.sequence.validation import check_distance, check_sequence

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


def find_clips(source: Source, paths: list[Path]) -> list[SourceClip]:
    """Every clip of a source below some paths, each once.

    Raises:
        InputError: a path is not there, or holds nothing of this source.
    """
    found: dict[Path, SourceClip] = {}
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
    return distinct(list(found.values()))


def distinct(clips: list[SourceClip]) -> list[SourceClip]:
    """Clips of one name with as much of the path in front as tells them apart."""
    for parts in range(2, 1 + max(len(clip.path.parts) for clip in clips)):
        same = repeated(clips)
        clips = [
            replace(clip, name=clip_name(clip.path, parts)) if clip.name in same else clip
            for clip in clips
        ]
    same = repeated(clips)
    clips = [
        replace(clip, name=f"{clip.name}_{clip.path.suffix[1:]}") if clip.name in same else clip
        for clip in clips
    ]
    if same := repeated(clips):
        raise InputError(f"{clips[0].path}: two clips are both called {min(same)}; rename one")
    return clips


def repeated(clips: list[SourceClip]) -> set[str]:
    """The names that more than one clip has."""
    return {name for name, count in Counter(clip.name for clip in clips).items() if count > 1}


def read_clip(source: Source, clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """The recordings of one clip.

    Raises:
        InputError: a file of it cannot be read; the message names it.
        MissingAssetError: it needs a file that the user must supply.
    """
    try:
        recordings = source.adapter().read(clip, known)
        refuse_betas(recordings, clip)
        return [with_choice(without_idle(recording), clip, known) for recording in recordings]
    except GeneOHError:
        raise
    except DAMAGE as error:  # numbers that no check foresaw; the file is at fault, not the program
        raise unforeseen(clip, error) from error


def refuse_betas(recordings: list[Recording], clip: SourceClip) -> None:
    """Raise where a hand's betas are no numbers: they cannot be masked like a frame."""
    for hand in (hand for recording in recordings for hand in recording.sequence.hands):
        if hand.betas is not None and not bool(hand.betas.isfinite().all()):
            raise InputError(
                f"{clip.path}: the betas of the {hand.side} hand must be finite, got "
                f"{hand.betas.tolist()}; copy its files again"
            )


def unforeseen(clip: SourceClip, error: Exception) -> InputError:
    """The error for numbers that no check foresaw."""
    reason = " ".join(str(error).split())[:100]
    return InputError(
        f"{clip.path}: expected a clip of its source, got numbers that fit no sequence "
        f"({type(error).__name__}: {reason}); copy its files again"
    )


def checked(recording: Recording, clip: SourceClip) -> list[str]:
    """What the self-test says of one recording."""
    try:
        return contradictions(recording)
    except DAMAGE as error:
        raise unforeseen(clip, error) from error


def without_idle(recording: Recording) -> Recording:
    """Of two hands only the one that comes near the object; the other hangs beside the body."""
    sequence = recording.sequence
    if len(sequence.hands) < 2:
        return recording
    away = {}
    for hand in sequence.hands:
        try:
            check_distance(hand, sequence.object, recording.name)
        except InputError:
            away[hand.side] = f"the {hand.side} hand never comes near the object and was left out"
    if not away or len(away) == len(sequence.hands):
        return recording
    return with_hands(recording, *away.values(), sides=sides_of(recording) - away.keys())


def with_choice(recording: Recording, clip: SourceClip, known: ReaderOptions) -> Recording:
    """The recording with the caller's choices kept.

    Raises:
        InputError: they are of another hand or object than the source has.
    """
    meshes = recording.sequence.object.meshes
    if known.meshes and not any(mesh is known.meshes[0] for mesh in meshes):
        raise InputError(f"{clip.path}: the source has its own object, got --obj as well; drop it")
    if known.side is None or sides_of(recording) == {known.side}:
        return recording
    if known.side not in sides_of(recording):
        got = " and ".join(sides_of(recording))
        raise InputError(f"{clip.path}: expected a {known.side} hand, got {got}; drop --side")
    return with_hands(recording, sides={known.side})


def sides_of(recording: Recording) -> set[Side]:
    """The sides of the hands in it."""
    return {hand.side for hand in recording.sequence.hands}


def with_hands(recording: Recording, *notes: str, sides: set[Side]) -> Recording:
    """Only the hands of some sides, with notes on why."""
    sequence = recording.sequence
    return replace(
        recording,
        sequence=replace(
            sequence,
            hands=tuple(hand for hand in sequence.hands if hand.side in sides),
            source="; ".join([sequence.source, *notes]),
        ),
    )


def convert(
    source: Source,
    clips: list[SourceClip],
    folder: Path | None,
    known: ReaderOptions,
    *,
    check: bool = False,
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
    said = told(known)
    for clip in clips:
        entry = f"{source.name} {clip.path} {said}"
        files = done.get(entry)
        if folder and files and not check and all((folder / file).is_file() for file in files):
            yield Outcome(clip, tuple(files), skipped=True)
            continue
        try:
            yield convert_clip(source, clip, folder, known, entry, check=check)
        except GeneOHError as error:
            yield Outcome(clip, problem=str(error))


def told(known: ReaderOptions) -> str:
    """What the caller said, for the log: with other options a clip is another conversion."""
    said = {}
    for option in fields(known):
        value = getattr(known, option.name)
        if option.name == "meshes":
            value = [sha256(obj_text(mesh).encode()).hexdigest() for mesh in value]
        elif isinstance(value, np.ndarray):
            value = sha256(value.tobytes()).hexdigest()
        if value not in (None, False, []):
            said[option.name] = str(value)
    return json.dumps(said, sort_keys=True)


def convert_clip(
    source: Source,
    clip: SourceClip,
    folder: Path | None,
    known: ReaderOptions,
    entry: str,
    *,
    check: bool,
) -> Outcome:
    """One clip, all of its recordings or none; `entry` is its name in the log."""
    recordings = read_clip(source, clip, known)
    said: list[str] = []
    for recording in recordings:
        if check:
            said += [f"{recording.name}: {words}" for words in checked(recording, clip)]
        else:
            check_sequence(recording.sequence, recording.name)
    notes = tuple(dict.fromkeys(recording.sequence.source for recording in recordings))
    if folder is None or said:
        return Outcome(clip, contradictions=tuple(said), notes=notes)
    files = tuple(write_recording(recording, folder) for recording in recordings)
    append_log(folder, {"clip": entry, "files": files})
    return Outcome(clip, files, notes=notes)


def write_recording(recording: Recording, folder: Path) -> str:
    """A sequence and its meshes; the sequence comes last and names them."""
    pairs = zip(recording.mesh_names, recording.sequence.object.meshes, strict=False)
    names = [write_mesh(mesh, folder, name) for name, mesh in pairs]
    path = folder / f"{recording.name}.npz"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, error) from None
    save_sequence(recording.sequence, path, extra={"object_files": np.array(names, dtype=str)})
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


def read_one(name: str, path: Path, known: ReaderOptions, clip: str | None = None) -> Recording:
    """The one recording at a path, or the one of a name where there are several.

    Raises:
        InputError: there are several and no name chooses; the message lists them.
    """
    source = source_named(name)
    clips = find_clips(source, [path])
    clips = [one for one in clips if clip is None or clip.startswith(one.name)]
    found = []
    if len(clips) == 1 or clip is not None:
        found = [
            recording
            for one in clips
            for recording in read_clip(source, one, known)
            if clip in (None, recording.name, one.name)
        ]
        found = [one for one in found if one.name == clip] or found
    if len(found) == 1:
        return found[0]
    names = ", ".join(one.name for one in (found or clips)[:8]) or "none of that name"
    raise InputError(
        f"{path}: expected one recording, got {names}; choose one with --clip NAME, or convert "
        "all of them with `geneoh convert`"
    )
