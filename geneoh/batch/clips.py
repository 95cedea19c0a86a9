"""The clips of a batch: files, folders, globs, manifests, and copies of data sets.

A manifest is a CSV with the column `input` and the optional columns `name`, `meshes`, `source` and
`options`. Its paths are relative to its folder. Several meshes or options are separated by
semicolons: `preset=fast; side=left`.
"""

import csv
import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from glob import glob, has_magic
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import OF_SOURCES
from geneoh.config import closest_name, parse_setting
from geneoh.errors import ConfigError, InputError, numbered
from geneoh.files.journal import CLEANED, is_journal, results_in
from geneoh.files.outputs import lies_within
from geneoh.files.reading import open_text, refuse_missing, table_in
from geneoh.pipeline.options import Options
from geneoh.readers.base import SourceClip, below, place_in
from geneoh.readers.column_names import coordinate_in
from geneoh.readers.foreign_files import number_in
from geneoh.readers.meshes import mesh_beside
from geneoh.readers.recordings import find_clips as find_source_clips
from geneoh.readers.recordings import source_named, with_distinct_names

LOG = logging.getLogger(__name__)

COLUMNS = ("input", "name", "meshes", "source", "options")
MANIFEST_LIMIT = 2**26  # largest size of a manifest, bytes
SETTINGS = tuple(field.name for field in fields(Options))
FOR_NPZ = ("side", "fps", "unit", "joint_order", "keypoint_unit", "object_pose", "camera")
FOR_NPZ += ("camera_pose",)
READING = (*FOR_NPZ, *OF_SOURCES)
"""Names of the options of `geneoh.read`; `geneoh.load` has those of `FOR_NPZ`."""
PATHS = ("object_pose", "camera_pose", "objects", "body", "weights", "mano_dir")


@dataclass(frozen=True)
class BatchClip:
    """One input of a batch, with the options that it has in addition to those of the batch."""

    name: str  # path of its result below the output folder, without ending; unique in a batch
    path: Path
    source: str | None = None  # name of its reader; None for files that `geneoh.load` reads
    meshes: tuple[Path, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)  # fields of `geneoh.Options` by name
    reading: dict[str, Any] = field(default_factory=dict)  # options of `geneoh.read` by name
    problem: str = ""  # error message if there is nothing to read, in one sentence
    is_named: bool = False  # whether a manifest sets the name, which is then not changed

    def described(self) -> dict[str, Any]:
        """A JSON-compatible description of the clip; a clip is cleaned again when it changes."""
        plain = asdict(self) | {"path": str(self.path), "meshes": list(map(str, self.meshes))}
        for name in ("settings", "reading"):
            plain[name] = {key: str(value) for key, value in plain[name].items()}
        del plain["is_named"]
        return plain


def find_batch_clips(
    inputs: Iterable[Path], source: str | None, folder: Path, meshes: tuple[Path, ...] = ()
) -> list[BatchClip]:
    """Every clip of the inputs.

    Args:
        inputs: files, folders, globs and manifests; with a source, its files and folders.
        source: name of the reader of files that are not npz files.
        folder: the output folder, whose results are not used as inputs.
        meshes: of the object in all clips; by default, the mesh file beside a clip with its name.

    Raises:
        InputError: an input is not there or holds no clip, a manifest cannot be read, two clips
            have one name, or a result would replace an input.
        ConfigError: a manifest names an option or a source that does not exist.
    """
    meshes = tuple(mesh.absolute() for mesh in meshes)  # as the journal names them
    inputs, found = list(inputs), []
    paths = [path for given in inputs for path in expanded(given, folder)]
    made = results_in(folder, CLEANED)
    # a pattern, of this command or of the shell, matches them when a run is started again
    paths = [path for path in paths if path.resolve() not in made] or paths
    if source is not None:
        found += _clips_of_source(paths, source, folder)
    for path in paths if source is None else ():
        found += clips_of_manifest(path, folder) if is_manifest(path) else _clips_of(path, folder)
    if not found:
        raise InputError(f"{', '.join(map(str, inputs))}: lists no clip; add lines to the manifest")
    clips = [
        replace(
            clip, meshes=clip.meshes or meshes or (() if clip.source else mesh_beside(clip.path))
        )
        for clip in _distinct(found)
    ]
    _check_places(clips, folder)
    return clips


def _distinct(found: list[BatchClip]) -> list[BatchClip]:
    """The clips without duplicates, with the names set in manifests, or else distinct ones."""
    resolved = cache(Path.resolve)  # most clips share a folder

    def work_of(clip: BatchClip) -> str:
        """A key that duplicates share: the same file, however its path is written, and options."""
        path = resolved(clip.path.parent) / clip.path.name
        return repr(replace(clip, name="", path=path, is_named=False))

    works = list(map(work_of, found))
    named = {work for clip, work in zip(found, works, strict=True) if clip.is_named}
    once: dict[tuple[str, str], BatchClip] = {}
    for clip, work in zip(found, works, strict=True):
        if clip.is_named or work not in named:
            once.setdefault((clip.name if clip.is_named else "", work), clip)
    kept = Counter(clip.name for clip in once.values() if clip.is_named)
    if twice := [name for name, count in kept.items() if count > 1]:
        raise InputError(f"two manifests name a clip '{twice[0]}'; rename one")
    bare = [SourceClip(each.name, each.path) for each in once.values() if not each.is_named]
    others = iter(with_distinct_names(bare, kept))
    return [
        clip if clip.is_named else replace(clip, name=next(others).name) for clip in once.values()
    ]


def expanded(path: Path, folder: Path) -> list[Path]:
    """The absolute paths that match a glob, without the output folder; an existing path is returned
    as it is."""
    if path.exists() or not has_magic(str(path)):
        return [path.absolute()]
    found = sorted(Path(each).absolute() for each in glob(str(path), recursive=True))
    if not found:
        raise InputError(f"{path}: no file or folder has such a name; check the pattern")
    return [each for each in found if each.resolve() != folder.resolve()] or found


def _clips_of_source(paths: list[Path], source: str, folder: Path) -> list[BatchClip]:
    """The clips of a source at or below some paths; `InputError` for a path without any."""
    clips = find_source_clips(source_named(source), paths, folder)
    return [BatchClip(clip.name, clip.path, source) for clip in clips]


def _clips_of(path: Path, folder: Path) -> list[BatchClip]:
    """The npz clips at or below one path; `InputError` if there is none."""
    if path.is_dir():
        there = [each for each in sorted(below(path, "*.npz")) if each.is_file()]
        runs = {each.parent for each in below(path, CLEANED) if is_journal(each)} - {path}
        others = [each for each in there if not lies_within(each, folder)]
        found = [each for each in others if runs.isdisjoint(each.parents)]
        if earlier := len(others) - len(found):
            LOG.warning("%s: %s of earlier runs left out", path, numbered(earlier, "result"))
        if there and not found:
            raise InputError(
                f"{path}: expected npz files outside of folders for results, got {len(there)} "
                "within them; choose another --out, or name a folder of results itself"
            )
        if not found:
            raise InputError(
                f"{path}: expected npz files at or below it, found none; name the source of other "
                "files with --from, or list them in a manifest"
            )
        return [
            BatchClip(each.relative_to(path).with_suffix("").as_posix(), each) for each in found
        ]
    refuse_missing(path)
    return [BatchClip(path.stem, path)]


def is_manifest(path: Path) -> bool:
    """Whether a file is a CSV with a column that only manifests have, `input` or `meshes`, or with
    names of which none is that of a coordinate, as a table of points has."""
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    with open_text(path, MANIFEST_LIMIT) as file:
        lines, separator = table_in(file)
        heading = next(csv.reader([next(lines)], delimiter=separator), [])
    has_points = any(coordinate_in(name) or np.isfinite(number_in(name)) for name in heading)
    return not {"input", "meshes"}.isdisjoint(names_in(iter([heading]))) or not has_points


def names_in(rows: Iterator[list[str]]) -> list[str]:
    """The column names in the first row of a table, lower case."""
    names = [name.strip().strip('"').lower() for name in next(rows, [])]
    while names and not names[-1]:  # empty columns that Excel saved
        names.pop()
    return names


def columns_of(rows: Iterator[list[str]], path: Path) -> list[str]:
    """The column names of a manifest; `InputError` if one is unknown, repeated or missing."""
    names = names_in(rows)
    if unknown := [name for name in names if name not in COLUMNS]:
        hint = closest_name(unknown[0], COLUMNS)
        raise InputError(f"{path}: '{unknown[0]}' is no column of a manifest; {hint}")
    if len(set(names)) < len(names):
        raise InputError(
            f"{path}: a manifest has each column once, got {', '.join(names)}; leave one out"
        )
    if "input" not in names:
        raise InputError(
            f"{path}: a manifest needs the column 'input', got {', '.join(names) or 'none'}; add it"
        )
    return names


def clips_of_manifest(path: Path, folder: Path) -> Iterator[BatchClip]:
    """The clips of all rows; a row with missing files becomes a clip with a `problem`."""
    with open_text(path, MANIFEST_LIMIT) as file:
        lines, separator = table_in(file)
        rows = csv.reader(lines, delimiter=separator, skipinitialspace=True)
        names = columns_of(rows, path)
        named: dict[str, int] = {}  # line number by clip name
        for row in filter(any, rows):
            where = f"{path}, line {rows.line_num}"
            row = row[: len(names)] if not any(row[len(names) :]) else row
            if len(row) != len(names) or not (cells := dict(zip(names, row, strict=True)))["input"]:
                raise InputError(
                    f"{where}: expected {len(names)} values ({', '.join(names)}), of which 'input' "
                    f"is not empty, got {len(row)}; correct the line"
                )
            name = cells["name"] = cells.get("name", "").strip().removesuffix(".npz")
            if name in named:
                raise InputError(
                    f"{where}: 'name' must be another one in each line, got {name!r} in line "
                    f"{named[name]} too; rename one"
                )
            named |= {name: rows.line_num} if name else {}
            yield from clips_of_row(cells, where, path.parent, folder)


def clips_of_row(
    cells: dict[str, str], where: str, base: Path, folder: Path
) -> Iterator[BatchClip]:
    """The clip, or the clips of a source, that one row of a manifest names."""
    path, name = base / cells["input"].strip(), cells["name"]
    if name and (name.endswith("/") or not Path(name).name or "\0" in name):
        raise InputError(
            f"{where}: 'name' must be the name of a file, got {name!r}; choose another"
        )
    source = cells.get("source", "").strip() or None
    meshes = tuple(base / each for each in listed(cells.get("meshes", "")))
    settings, reading = options_of(cells.get("options", ""), where, base)
    if source is not None:
        source_named(source)
    elif unused := [option for option in reading if option not in FOR_NPZ]:
        raise ConfigError(
            f"{where}: the option '{unused[0]}' needs a source, got none; name one in the column "
            "'source', or drop the option"
        )
    try:
        clips = _clips_of_source([path], source, folder) if source else _clips_of(path, folder)
    except InputError as error:
        clips = [BatchClip(path.stem, path, source, problem=str(error))]
    if name and len(clips) > 1:
        raise InputError(f"{where}: 'name' is for one clip, got {len(clips)}; leave it empty")
    for clip in clips:
        complete = replace(clip, meshes=meshes, settings=settings, reading=reading)
        yield replace(complete, name=name, is_named=True) if name else complete


def listed(text: str) -> list[str]:
    """The parts of a cell between semicolons."""
    return [part.strip() for part in text.split(";") if part.strip()]


def options_of(text: str, where: str, base: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options in a cell: fields of `Options`, and options of `geneoh.read`."""
    settings, reading = {}, {}
    for part in listed(text):
        if "=" not in part:
            raise ConfigError(
                f"{where}: expected NAME=VALUE in 'options', separated by semicolons, got "
                f"{part!r}; correct the line"
            )
        ((name, value),) = parse_setting(part).items()
        if name not in (*SETTINGS, *READING):
            hint = closest_name(name, (*SETTINGS, *READING))
            raise ConfigError(f"{where}: '{name}' is no option; {hint}")
        value = base / str(value) if name in PATHS else value
        if name == "camera" and isinstance(value, str):
            try:
                value = place_in(value)
            except InputError as error:
                raise ConfigError(f"{where}: camera: {error}") from None
        (settings if name in SETTINGS else reading)[name] = value
    return settings, reading


def _check_places(clips: list[BatchClip], folder: Path) -> None:
    """`InputError` if a result would lie outside the output folder, or replace an input or another
    result."""
    inputs = {clip.path.resolve() for clip in clips}
    taken: dict[Path, str] = {}
    for clip in clips:
        place = (folder / f"{clip.name}.npz").resolve()
        if not place.is_relative_to(folder.resolve()):
            raise InputError(f"'{clip.name}': expected a name within {folder}; choose another one")
        if place in inputs:
            raise InputError(f"{place}: is an input and never replaced; choose another folder")
        if place in taken:
            raise InputError(f"'{clip.name}': is the file of '{taken[place]}' too; rename one")
        taken[place] = clip.name
