"""Shards on disk for the clips of recordings, made again where settings or files have changed."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor

from geneoh.errors import GeneOHError, InputError
from geneoh.files.fingerprints import are_as_recorded, files_at, records_of
from geneoh.files.reading import noted_reads
from geneoh.files.tensors import DamagedTensorsError, opened_tensors, write_tensors
from geneoh.hand.mano import mano_files
from geneoh.progress import OnStep, steps
from geneoh.readers.base import ReaderOptions, SourceClip

PICTURES = (".jpg", ".jpeg", ".png", ".mp4", ".avi", ".mkv")
"""Endings of files from which no reader reads hands."""

NamedFiles = list[tuple[str, Path]]
Contents = tuple[Mapping[str, Tensor], dict[str, Any]]  # tensors of a shard, and a record of them


def kept_shards(
    clips: Sequence[SourceClip],
    folder: Path,
    settings: Mapping[str, Any],
    files_of: Callable[[SourceClip], NamedFiles],
    make: Callable[[SourceClip], Contents],
    on_step: OnStep | None,
) -> tuple[list[Path], list[str]]:
    """The shard of each clip in `folder`, and a message for each clip that could not be read.

    `make` is called where there is no shard with these `settings`, or where the files of `files_of`
    and all others that were read have changed since. Settings and files are in the record.

    Raises:
        InputError: no clip can be read; the message is that of the first clip.
    """
    shards: list[Path] = []
    problems: list[str] = []
    for clip in steps(clips, on_step):
        # clip names contain no dot, so that no two clips share a file
        shard = folder / f"{clip.name.replace('/', '.')}.safetensors"
        try:
            files = files_of(clip)
            if not is_fresh(shard, settings, files):
                with noted_reads() as read:
                    tensors, about = make(clip)
                record = {**settings, "files": records_of(with_reads(files, read)), **about}
                write_tensors(shard, tensors, record, parents=True)
            shards.append(shard)
        except GeneOHError as error:
            problems.append(f"{clip.name}: not read, {error}")
    if not shards:
        more = f" (none of {len(problems)} clips can be read)" if len(problems) > 1 else ""
        raise InputError(problems[0] + more)
    return shards, problems


def is_fresh(shard: Path, settings: Mapping[str, Any], files: NamedFiles) -> bool:
    """Whether an undamaged shard exists that was made with these settings from the files as they
    are. Files that are newer than the shard are compared by content, others only by size."""
    try:
        with opened_tensors(shard) as (_, record):
            if any(record.get(name) != value for name, value in settings.items()):
                return False
            known = {name: (size, content) for name, (size, content) in record["files"].items()}
            return are_as_recorded(files, known, shard)
    except (OSError, DamagedTensorsError):
        return False


def files_of_clip(clip: SourceClip, options: ReaderOptions) -> NamedFiles:
    """The files on which the hands of a clip may depend: those of the clip except pictures, named
    by their path below its folder, and the user's MANO files."""
    models = [] if options.mano_dir is None else mano_files(options.mano_dir)
    base = clip.path if clip.path.is_dir() else clip.path.parent
    files = ((file.relative_to(base).as_posix(), file) for file in files_at(clip.path))
    kept = ((name, file) for name, file in files if file.suffix.lower() not in PICTURES)
    return [*kept, *((file.name, file) for file in models)]


def with_reads(files: NamedFiles, read: set[Path]) -> NamedFiles:
    """Named files, and by path those that were read besides."""
    known = {file.absolute() for _, file in files}
    others = sorted(file for file in read - known if file.is_file())
    return [*files, *((str(file), file) for file in others)]
