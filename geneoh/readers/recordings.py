"""Find the clips of a source, read their recordings, and apply the caller's options."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_type_hints

from geneoh.arguments import checked_call, is_plain
from geneoh.choices import Side, Unit
from geneoh.config import as_field_type, closest_name
from geneoh.errors import ConfigError, InputError
from geneoh.files.journal import CLEANED, CONVERTED, results_in
from geneoh.files.outputs import lies_within
from geneoh.files.reading import refuse_missing
from geneoh.geometry.mesh_files import MeshInput, meshes_of
from geneoh.readers.base import (
    OF_SOME,
    ReaderOptions,
    Recording,
    SourceClip,
    clip_name,
    fit_for_name,
    image_size_of,
    place_of,
)
from geneoh.readers.object_poses import poses_of
from geneoh.readers.records import Array
from geneoh.readers.registry import SOURCES, Source
from geneoh.sequence.distance_check import check_distance
from geneoh.sequence.sequence import Sequence
from geneoh.sequence.validation import check_sequence


@checked_call
def read(source: str, path: Path | str, *, clip: str | None = None, **options: Any) -> Sequence:
    """Read one recording of a data set or an estimator, as `geneoh denoise --from` does.

    Args:
        source: the source's name, such as "hoi4d" or "hamer"; `geneoh convert --help` lists all.
        path: the file or folder of the recording, as the data set unpacks.
        clip: which recording, where the path holds several.
        options: fields of `geneoh.readers.base.ReaderOptions`, such as `mano_dir`, `side`, `fps` or
            `focal`. Instead of `meshes` pass `obj`, the mesh of the object or its file, or one per
            rigid part, and `unit`, the unit of the files. `object_pose` may be an array, or a path
            that `geneoh.readers.object_poses.read_poses` reads, with lengths in `keypoint_unit`;
            the same holds for `camera_pose`; `camera` may be "origin", and `image_size`
            "1280x720".

    Raises:
        ConfigError: there is no source of that name, or it does not use one of the options.
        InputError: a file cannot be read, or there are several recordings and no `clip` is passed.
        MissingAssetError: a file that the user must supply is missing.
    """
    recording = read_one(source, Path(path), options_with_files(**options), clip)
    check_recording(recording)
    return recording.sequence


def check_recording(recording: Recording) -> None:
    """Raise `InputError` if a recording cannot be an interaction, with notes that name a remedy."""
    try:
        check_sequence(recording.sequence, recording.name)
    except InputError as error:
        hints = [note for note in recording.sequence.assumed if "pass --" in note]
        raise InputError("; ".join([str(error), *hints])) from None


def options_with_files(
    *,
    obj: MeshInput = (),
    unit: Unit = "m",
    object_pose: Path | str | Array | None = None,
    camera_pose: Path | str | Array | None = None,
    **others: Any,
) -> ReaderOptions:
    """The options, after reading the files of the object's meshes and poses; see `read`."""
    kinds = get_type_hints(ReaderOptions) | {"unit": Unit}
    for name in others:
        if name not in kinds or name == "meshes":
            known = [*(each for each in kinds if each != "meshes"), "obj", "clip"]
            raise ConfigError(f"geneoh.read: '{name}' is no option; {closest_name(name, known)}")
    for name, value in {**others, "unit": unit}.items():
        if is_plain(kinds.get(name)):
            others[name] = as_field_type(value, kinds[name], "geneoh.read", name)
    unit, keypoint_unit = others.pop("unit"), others.get("keypoint_unit")
    poses = poses_of(object_pose, "geneoh.read", keypoint_unit)
    if (camera := others.get("camera")) is not None:
        others["camera"] = place_of(camera, "geneoh.read")
    if (size := others.get("image_size")) is not None:
        others["image_size"] = image_size_of(size)
    cameras = poses_of(camera_pose, "geneoh.read", keypoint_unit, "camera")
    found = {"object_pose": poses, "camera_pose": cameras}
    return ReaderOptions(meshes=meshes_of(obj, unit), **found, **others)


def source_named(name: str) -> Source:
    """The source of that name; `ConfigError` where there is none."""
    if name not in SOURCES:
        raise ConfigError(f"source {name}: expected one of {', '.join(SOURCES)}")
    return SOURCES[name]


def find_clips(source: Source, paths: list[Path], results: Path | None = None) -> list[SourceClip]:
    """Every clip of a source below some paths, each once; `InputError` for a path without any.

    Files in the output folder `results` do not count as clips, unless the path is inside it. Then
    those that its journals name as results count only where there are no others.
    """
    within = {path for path in paths if results is not None and lies_within(path, results)}
    made = set[Path]()
    if results is not None and within:
        made = results_in(results, CONVERTED) | results_in(results, CLEANED)
    found: dict[Path, SourceClip] = {}
    for path in paths:
        refuse_missing(path)
        clips = source.reader().find(path.resolve())
        if path in within:
            clips = [clip for clip in clips if clip.path not in made] or clips
        elif results is not None:
            clips = [clip for clip in clips if not lies_within(clip.path, results)]
        if not clips:
            raise InputError(
                f"{path}: expected files of {source.title} at or below it, such as "
                f"{', '.join(source.reader().patterns)}, got none; give a folder as the data set "
                "unpacks, or choose another source"
            )
        found.update({clip.path: clip for clip in clips})
    return with_distinct_names(list(found.values()))


def with_distinct_names(clips: list[SourceClip], taken: Iterable[str] = ()) -> list[SourceClip]:
    """Clips with equal names made distinct, also from names `taken`: by the ending of files that
    differ in it alone, and by as many parent folders as are needed."""
    taken = list(taken)
    longest = max((len(clip.path.resolve().parts) for clip in clips), default=0)
    count = Counter([*taken, *(clip.name for clip in clips)])
    alike = Counter(clip_name(clip.path, longest) for clip in clips if count[clip.name] > 1)

    def longer(clip: SourceClip, parts: int) -> str:
        front = clip.name if parts == 1 else clip_name(clip.path, parts)
        ending = clip.path.name.partition(".")[2]
        is_twin = alike[clip_name(clip.path, longest)] > 1
        return front + (fit_for_name(f"_{ending}") if ending and is_twin else "")

    names = [clip.name for clip in clips]
    for parts in range(1, longest + 1):
        count = Counter([*taken, *names])
        named = zip(clips, names, strict=True)
        names = [longer(clip, parts) if count[name] > 1 else name for clip, name in named]
    count = Counter([*taken, *names])
    for clip, name in zip(clips, names, strict=True):
        if count[name] > 1:
            raise InputError(f"{clip.path}: two clips are both called {clip.name}; rename one")
    return [replace(clip, name=name) for clip, name in zip(clips, names, strict=True)]


def read_clip(source: Source, clip: SourceClip, options: ReaderOptions) -> list[Recording]:
    """The recordings of one clip, of those with one hand each the ones of the side asked for.

    Raises:
        ConfigError: the source does not accept one of the options.
        InputError: a file of the clip cannot be read; the message names it.
        MissingAssetError: a file that the user must supply is missing.
    """
    return chosen(all_recordings(source, clip, options), clip, options)


def all_recordings(source: Source, clip: SourceClip, options: ReaderOptions) -> list[Recording]:
    """The recordings of one clip, whatever side is asked for; raises what `read_clip` does."""
    refuse_unused(source, options)
    recordings = source.reader().read(clip, options)
    for hand in (hand for recording in recordings for hand in recording.sequence.hands):
        # frames can be left out where they are not finite, betas cannot
        if hand.betas is not None and not bool(hand.betas.isfinite().all()):
            raise InputError(
                f"{clip.path}: the betas of the {hand.side} hand must be finite, got "
                f"{hand.betas.tolist()}; copy its files again"
            )
    return [without_idle_hand(recording) for recording in recordings]


def chosen(found: list[Recording], clip: SourceClip, options: ReaderOptions) -> list[Recording]:
    """Recordings of a clip with the caller's choices kept; `InputError` where none of them fits."""
    of_side = [recording for recording in found if options.side in sides_of(recording)]
    return [with_choices(recording, clip, options) for recording in of_side or found]


def refuse_unused(source: Source, options: ReaderOptions) -> None:
    """Raise `ConfigError` if an option is passed that the source does not accept."""
    plain, takes = ReaderOptions(), source.reader().takes
    for name in OF_SOME:
        value = getattr(options, name)
        if name not in takes and value != getattr(plain, name):
            option = name.replace("_", "-")
            raise ConfigError(f"--{option}: {source.title} makes no use of it, got one; drop it")


def without_idle_hand(recording: Recording) -> Recording:
    """The recording without the hand that never comes near the object, if the other one does."""
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
    return _with_hands(recording, sides_of(recording) - idle, note)


def with_choices(recording: Recording, clip: SourceClip, options: ReaderOptions) -> Recording:
    """The recording with only the caller's side; `InputError` if side or mesh do not fit it."""
    meshes = recording.sequence.object.meshes
    own = [each for mesh in options.meshes[:1] for each in (mesh, *mesh.parts)]
    if own and not any(mesh is each for mesh in meshes for each in own):
        raise InputError(f"{clip.path}: the source has its own object, got --obj as well; drop it")
    if options.side is None or sides_of(recording) == {options.side}:
        return recording
    if options.side not in sides_of(recording):
        got = " and ".join(sides_of(recording))
        raise InputError(f"{clip.path}: expected a {options.side} hand, got {got}; drop --side")
    return _with_hands(recording, {options.side})


def sides_of(recording: Recording) -> set[Side]:
    """The sides of the hands in it."""
    return {hand.side for hand in recording.sequence.hands}


def _with_hands(recording: Recording, sides: set[Side], *notes: str) -> Recording:
    """Only the hands of some sides, with notes on why."""
    sequence = recording.sequence
    hands = tuple(hand for hand in sequence.hands if hand.side in sides)
    source, assumed = "; ".join([sequence.source, *notes]), (*sequence.assumed, *notes)
    sequence = replace(sequence, hands=hands, source=source, assumed=assumed)
    return replace(recording, sequence=sequence)


def read_one(name: str, path: Path, options: ReaderOptions, clip: str | None = None) -> Recording:
    """The only recording at a path, or that named `clip`; if there are several, they are listed."""
    source = source_named(name)
    there = find_clips(source, [path])
    clips = [one for one in there if clip is None or clip.startswith(one.name)]
    found = []
    if len(clips) == 1 or clip is not None:
        read_all = ((one, each) for one in clips for each in all_recordings(source, one, options))
        named = [(one, each) for one, each in read_all if clip in (None, each.name, one.name)]
        named = [(one, each) for one, each in named if each.name == clip] or named
        for one in clips:
            found += chosen([each for of, each in named if of is one], one, options)
    if len(found) == 1:
        return found[0]
    names = ", ".join(one.name for one in (found or there)[:8])
    names = names if found or clip is None else f"none of the name {clip} but {names}"
    raise InputError(
        f"{path}: expected one recording, got {names}; choose one with --clip NAME, or convert "
        "all of them with `geneoh convert`"
    )
