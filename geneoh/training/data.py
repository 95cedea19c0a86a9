"""The data of a training run: synthetic interactions and clips of recordings, mixed by weight.

Recordings are split by whole objects, so that training and validation share no object.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from geneoh.bundle import spread
from geneoh.config import as_dict, flat, parse_setting, setting_differences
from geneoh.errors import ConfigError, InputError, numbered
from geneoh.progress import OnProgress
from geneoh.readers.base import ReaderOptions
from geneoh.readers.registry import SOURCES
from geneoh.streamed import Streamed
from geneoh.synthesis.data_config import ShardConfig, SynthesisConfig
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.shapes.scans import FILE
from geneoh.synthesis.shards import (
    DEFAULTS,
    ShardRecord,
    find_shards,
    read_shard,
    read_shards,
    shard_record,
    unfinished,
    write_shards,
)
from geneoh.training import recordings
from geneoh.training.config import TrainConfig
from geneoh.training.held_out import held_out
from geneoh.training.recordings import SEQUENCES, ClipRecord
from geneoh.training.windows import WeightedInteractions

Clips = TypeVar("Clips")


@dataclass(frozen=True)
class DataSource:
    """A folder of training data."""

    path: Path
    source: str = ""  # name of a reader, or "sequences"; empty for synthetic interactions
    weight: float = 1.0  # share of the windows, relative to the other sources

    def shards_in(self, cache: Path, kind: str = "") -> Path:
        """The folder in `cache` for the shards that are cut out of its recordings."""
        digest = hashlib.sha256(str(self.path.resolve()).encode()).hexdigest()[:8]
        return cache / f"{kind}{self.source}_{digest}"


@dataclass(frozen=True)
class Learned:
    """What a network of a generator learns from, and the files that its training starts from."""

    data: DataSource  # a folder of synthetic clips, or recordings
    folder: Path  # with the networks of earlier stages, and for shards of recordings
    text_encoder: Path | None = None  # folder of one to use instead of the network's own
    start: Path | None = None  # weights to start from, whose vocabulary is used
    readers: ReaderOptions = field(default_factory=ReaderOptions)  # of recorded actions
    skeleton: Path | None = None  # SMPL-H or SMPL-X model of recorded bodies


@dataclass(frozen=True)
class TrainingData(Generic[Clips]):
    """The training and validation clips of a run."""

    training: Clips
    validation: Clips
    record: dict[str, Any]  # how the data was made, for the record of the weights
    notes: tuple[str, ...] = ()  # messages for the user: what was found and what was left out


@dataclass(frozen=True)
class Portion:
    """Clips of one source in one split."""

    clips: Streamed[Interactions]
    lengths: Int[Tensor, " B"]  # frames of each clip without padding
    weight: float  # of the source


@dataclass(frozen=True)
class CutClips:
    """Clips that were cut out of the recordings of one source."""

    source: DataSource
    clips: Streamed[Interactions]
    records: list[ClipRecord]
    left_out: str  # numbers of unused frames with reasons, in words

    def split(self, held: Bool[Tensor, " B"]) -> list[Portion]:
        """Training and validation clips; all clips for both if none are held out."""
        lengths = torch.tensor([record.length for record in self.records])
        return [
            Portion(self.clips.only(kept), lengths[kept], self.source.weight)
            for kept in ((~held, held) if bool(held.any()) else (~held, ~held))
        ]

    def words(self, by: str) -> str:
        """A message on the clips and unused frames; `by` describes the validation split."""
        objects = len({record.object for record in self.records})
        of = "one object" if objects == 1 else f"{objects} objects"
        found = f"{self.source.source}: {len(self.records)} clips of {of}, {by}"
        return f"{found}; frames left out: {self.left_out or 'none'}"


def parsed_source(text: str, known: Sequence[str] = (SEQUENCES, *SOURCES)) -> DataSource:
    """Parse a source as written on the command line: `[SOURCE=]PATH[:WEIGHT]`.

    Raises:
        ConfigError: there is no path, the source is not `known`, or the weight is not above zero.
    """
    if not text.rpartition("=")[2]:
        raise ConfigError(f"--data {text}: expected a path, got none; name a folder")
    source, _, rest = text.partition("=") if "=" in text else ("", "", text)
    path, _, weight = rest.rpartition(":")
    try:
        number = float(weight) if path else 1.0
    except ValueError:  # the colon belongs to the path
        if Path(path).exists() and not Path(rest).exists():
            raise ConfigError(
                f"--data {text}: expected a weight after ':', got {weight}; give a number above 0"
            ) from None
        path, number = rest, 1.0
    if source and source not in known:
        names = ", ".join(known)
        raise ConfigError(f"--data {text}: expected one of {names} before '=', got {source}")
    if not 0 < number < float("inf"):
        raise ConfigError(f"--data {text}: the weight must be above 0, got {number:g}; raise it")
    return DataSource(Path(path or rest), source, number)


def training_data(
    sources: Sequence[DataSource],
    cache: Path,
    config: TrainConfig,
    options: ReaderOptions | None = None,
    *,
    on_progress: OnProgress | None = None,
) -> TrainingData[Streamed[Interactions]]:
    """Read the data of a run, after making the shards that are missing.

    Shards that are cut out of recordings are kept in the folder `cache`. `on_progress` is called
    with "interactions", or the name of a source, and the numbers done and in total.

    Raises:
        InputError: a source holds no usable clips, or its files cannot be read.
    """
    found: list[list[Portion] | CutClips] = []
    made: list[dict[str, Any]] = []
    problems: list[str] = []
    for one in sources:
        report = on_progress and partial(on_progress, one.source or "interactions")
        if not one.source:
            write_missing(one.path, config.synthesis, report)
            read = made_data(one.path, read_shards, DEFAULTS)
            found.append([whole(clips, one.weight) for clips in (read.training, read.validation)])
            problems += read.notes
            made.append(read.record)
        else:
            folder, readers = one.shards_in(cache), options or ReaderOptions()
            shards, unread = recordings.make_shards(
                one.source, one.path, folder, config.clips, readers, on_step=report
            )
            found.append(cut_clips(one, shards, unread))
            problems += unread
            made.append({"source": one.source, "weight": one.weight, "clips": asdict(config.clips)})
    portions, notes = _split(found)
    record = made[0] if len(made) == 1 else {"sources": made}
    training, validation = (mixed(each) for each in zip(*portions, strict=True))
    return TrainingData(training, validation, record, (*notes, *problems))


def made_data(
    folder: Path, read: Callable[[Path, str], Clips], defaults: ShardConfig
) -> TrainingData[Clips]:
    """The clips of both splits in a folder of synthetic shards, by `read(folder, split)`.

    Raises:
        InputError: the folder lacks shards of a split, or they are not of the kind of `defaults`.
    """
    training, validation = (read(folder, split) for split in ("train", "val"))
    record = shard_record(find_shards(folder, "train", defaults)[0], defaults)
    return TrainingData(training, validation, as_dict(record), unfinished(folder, record.config))


def write_missing(folder: Path, config: SynthesisConfig, on_step: Any) -> None:
    """Synthesize the missing shards of a folder, unless it holds those of another config.

    Raises:
        InputError: the path is a file, or a folder of other files, such as recordings.
    """
    there = sorted(folder.glob("*_*.safetensors"))
    if not there and (folder / FILE).exists():  # prepared for clips with scans, not made here
        return
    if not there:
        refuse_other_files(folder)
    if not there or shard_record(there[0]) == ShardRecord(config, 0):
        write_shards(folder, config, seed=0, on_shard=on_step)


def refuse_other_files(folder: Path) -> None:
    """Raise where interactions would be made among other files, or in place of one."""
    if not folder.exists():
        return
    found = sorted(folder.iterdir()) if folder.is_dir() else [folder]
    others = [path.name for path in found if not path.name.startswith(".")]
    if others:
        raise InputError(
            f"{folder}: expected interactions that `geneoh synthesize` made, or an empty folder to "
            f"make them in, got {others[0]}; name recordings with their source, such as "
            f"sequences={folder}, or another folder"
        )


def refuse_other_making(
    record: Mapping[str, Any], config: SynthesisConfig, settings: Iterable[str]
) -> None:
    """Refuse `a.b=c` settings of the synthesis that differ from those of existing shards."""
    names = {name for setting in settings for name in flat(parse_setting(setting))}
    known = flat({"synthesis": as_dict(config)})
    named = {name.partition(".")[2]: known[name] for name in names & known.keys()}
    for made in record.get("sources", [record]):
        if "seed" in made and (differs := setting_differences(made["config"], named)):
            raise ConfigError(
                f"--set synthesis: the interactions are there and were made with {differs}; leave "
                "that out, or name another folder as --data"
            )


def whole(clips: Streamed[Interactions], weight: float) -> Portion:
    """Synthetic clips as a portion; they have no padding."""
    return Portion(clips, torch.full((len(clips),), clips.shards[0].wrist.shape[1]), weight)


def cut_clips(source: DataSource, shards: Iterable[Path], unread: Sequence[str]) -> CutClips:
    """The clips in the shards of a source; `InputError` if there are none.

    `unread` are messages about clips that could not be read; the error quotes the first.
    """
    clips: list[Interactions] = []
    records: list[ClipRecord] = []
    left_out: Counter[str] = Counter()
    for shard in shards:
        record = recordings.recorded_shard(shard)
        left_out.update(record.left_out)
        if record.clips:
            clips.append(read_shard(shard))
            records += record.clips
    reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items() if count)
    if not records:
        others = ""
        if unread:
            others = f"; {numbered(len(unread), 'clip')} could not be read, such as {unread[0]}"
        raise InputError(
            f"{source.path}: expected clips of {source.source} with hand and object near each "
            f"other, got none ({reasons or 'no frames'}); a smaller clips.shortest or a larger "
            f"clips.reach keeps more{others}"
        )
    return CutClips(source, Streamed.of(clips), records, reasons)


def _split(found: Sequence[list[Portion] | CutClips]) -> tuple[list[list[Portion]], list[str]]:
    """The training and validation portion of each source, and a message per recorded source."""
    splits = iter(held_out([each.records for each in found if isinstance(each, CutClips)]))
    portions: list[list[Portion]] = []
    notes: list[str] = []
    for each in found:
        if isinstance(each, CutClips):
            held, by = next(splits)
            notes.append(each.words(by))
            each = each.split(held)
        portions.append(each)
    return portions, notes


def mixed(portions: Sequence[Portion]) -> Streamed[Interactions]:
    """All clips joined, drawn by the weights of their sources; one unpadded source is unchanged."""
    together = Streamed.joined(portion.clips for portion in portions)
    shapes = {(shard.wrist.shape[1], shard.points.shape[1]) for shard in together.shards}
    frames, points = max(shape[0] for shape in shapes), min(shape[1] for shape in shapes)
    if len(portions) == 1 and bool((portions[0].lengths == frames).all()):
        return portions[0].clips
    return WeightedInteractions(
        together.shards,
        together.places,
        partial(evened, frames=frames, points=points) if len(shapes) > 1 else None,
        length=torch.cat([portion.lengths for portion in portions]),
        weight=torch.cat([p.weight * p.lengths / p.lengths.sum() for p in portions]),
    )


def evened(clips: Interactions, frames: int, points: int) -> Interactions:
    """The clips padded to `frames` with their last frame, with `points` of their surface points."""
    last = clips.wrist.shape[1] - 1
    some = spread(clips.points.shape[1], points)
    return clips.take(torch.arange(frames).clamp(max=last), "T").take(some, "P")
