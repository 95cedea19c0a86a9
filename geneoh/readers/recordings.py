"""Find the clips of a source and read their recordings, with the caller's choices kept."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

from geneoh.choices import Side
from geneoh.errors import ConfigError, InputError
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clip_name
from geneoh.readers.registry import SOURCES, Source
from geneoh.sequence.validation import check_distance


def source_named(name: str) -> Source:
    """The source of that name; `ConfigError` where there is none."""
    if name not in SOURCES:
        raise ConfigError(f"source {name}: expected one of {', '.join(SOURCES)}")
    return SOURCES[name]


def find_clips(source: Source, paths: list[Path]) -> list[SourceClip]:
    """Every clip of a source below some paths, each once.

    `InputError` where a path does not exist, or holds nothing of this source.
    """
    found: dict[Path, SourceClip] = {}
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: no such file or folder; check the path")
        clips = source.reader().find(path.resolve())
        if not clips:
            raise InputError(
                f"{path}: expected files of {source.title} at or below it, got none; give a folder "
                "as the data set unpacks, or choose another source"
            )
        found.update({clip.path: clip for clip in clips})
    return with_distinct_names(list(found.values()))


def with_distinct_names(clips: list[SourceClip]) -> list[SourceClip]:
    """Clips of one name with as much of the path in front as makes their names differ."""
    for parts in range(2, 1 + max(len(clip.path.parts) for clip in clips)):
        same = repeated_names(clips)
        clips = [
            replace(clip, name=clip_name(clip.path, parts)) if clip.name in same else clip
            for clip in clips
        ]
    same = repeated_names(clips)
    clips = [
        replace(clip, name=f"{clip.name}_{clip.path.suffix[1:]}") if clip.name in same else clip
        for clip in clips
    ]
    if same := repeated_names(clips):
        raise InputError(f"{clips[0].path}: two clips are both called {min(same)}; rename one")
    return clips


def repeated_names(clips: list[SourceClip]) -> set[str]:
    """The names that more than one clip has."""
    return {name for name, count in Counter(clip.name for clip in clips).items() if count > 1}


def read_clip(source: Source, clip: SourceClip, options: ReaderOptions) -> list[Recording]:
    """The recordings of one clip.

    Raises:
        InputError: a file of it cannot be read; the message names it.
        MissingAssetError: it needs a file that the user must supply.
    """
    recordings = source.reader().read(clip, options)
    refuse_betas(recordings, clip)
    return [with_choices(without_idle_hand(recording), clip, options) for recording in recordings]


def refuse_betas(recordings: list[Recording], clip: SourceClip) -> None:
    """Raise where a hand's betas are not finite: they cannot be masked like a frame."""
    for hand in (hand for recording in recordings for hand in recording.sequence.hands):
        if hand.betas is not None and not bool(hand.betas.isfinite().all()):
            raise InputError(
                f"{clip.path}: the betas of the {hand.side} hand must be finite, got "
                f"{hand.betas.tolist()}; copy its files again"
            )


def without_idle_hand(recording: Recording) -> Recording:
    """Of two hands only the one that comes near the object; the other is idle beside the body."""
    sequence = recording.sequence
    idle: set[Side] = set()
    for hand in sequence.hands if len(sequence.hands) > 1 else ():
        try:
            check_distance(hand, sequence.object, recording.name)
        except InputError:
            idle.add(hand.side)
    if not idle or len(idle) == len(sequence.hands):
        return recording
    note = f"the {min(idle)} hand never comes near the object and was left out"
    return with_hands(recording, sides_of(recording) - idle, note)


def with_choices(recording: Recording, clip: SourceClip, options: ReaderOptions) -> Recording:
    """The recording with the caller's choices kept.

    `InputError` where they are of another hand or object than the source has.
    """
    meshes = recording.sequence.object.meshes
    own = [each for mesh in options.meshes[:1] for each in (mesh, *mesh.parts)]
    if own and not any(mesh is each for mesh in meshes for each in own):
        raise InputError(f"{clip.path}: the source has its own object, got --obj as well; drop it")
    if options.side is None or sides_of(recording) == {options.side}:
        return recording
    if options.side not in sides_of(recording):
        got = " and ".join(sides_of(recording))
        raise InputError(f"{clip.path}: expected a {options.side} hand, got {got}; drop --side")
    return with_hands(recording, {options.side})


def sides_of(recording: Recording) -> set[Side]:
    """The sides of the hands in it."""
    return {hand.side for hand in recording.sequence.hands}


def with_hands(recording: Recording, sides: set[Side], *notes: str) -> Recording:
    """Only the hands of some sides, with notes on why."""
    sequence = recording.sequence
    hands = tuple(hand for hand in sequence.hands if hand.side in sides)
    source = "; ".join([sequence.source, *notes])
    return replace(recording, sequence=replace(sequence, hands=hands, source=source))


def read_one(name: str, path: Path, options: ReaderOptions, clip: str | None = None) -> Recording:
    """The one recording at a path, or the one of a name where there are several.

    `InputError` where there are several and no name chooses; the message lists them.
    """
    source = source_named(name)
    clips = find_clips(source, [path])
    clips = [one for one in clips if clip is None or clip.startswith(one.name)]
    found = []
    if len(clips) == 1 or clip is not None:
        found = [
            recording
            for one in clips
            for recording in read_clip(source, one, options)
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
