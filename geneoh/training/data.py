"""The data of a training run: made interactions and clips of recordings, in shares that are asked.

Recordings are split by whole objects, so that validation sees none that a network learned from.
"""

import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from geneoh.config import as_dict
from geneoh.errors import ConfigError, InputError
from geneoh.hand.library import load_hand
from geneoh.progress import OnProgress
from geneoh.readers.base import ReaderOptions
from geneoh.readers.registry import SOURCES
from geneoh.streamed import Streamed
from geneoh.synthesis.motion import Interactions
from geneoh.synthesis.shards import (
    ShardRecord,
    SynthesisConfig,
    find_shards,
    read_shard,
    read_shards,
    seed_of,
    shard_record,
    write_shards,
)
from geneoh.training import recordings
from geneoh.training.config import TrainConfig
from geneoh.training.recordings import SEQUENCES, ClipRecord
from geneoh.training.windows import WeightedInteractions

Clips = TypeVar("Clips")

HELD_OUT = 0.1  # share of a source's clips that is held out for validation, in whole objects


@dataclass(frozen=True)
class DataSource:
    """A folder that a network learns from."""

    path: Path
    source: str = ""  # name of a reader, or "sequences"; empty for made interactions
    weight: float = 1.0  # share of the windows, relative to the other sources


@dataclass(frozen=True)
class TrainingData(Generic[Clips]):
    """What a run learns from and is validated on."""

    training: Clips
    validation: Clips
    record: dict[str, Any]  # how the data was made, for the record of the weights
    notes: tuple[str, ...] = ()  # what was found and what was left out, for people


@dataclass(frozen=True)
class Portion:
    """Clips of one source in one split, and how many frames of each are real."""

    clips: Streamed[Interactions]
    lengths: Int[Tensor, " B"]
    weight: float


def parsed_source(text: str, known: Sequence[str] = (SEQUENCES, *SOURCES)) -> DataSource:
    """A source as it is written on the command line: `[SOURCE=]PATH[:WEIGHT]`.

    Args:
        text: that a user wrote.
        known: names that a source may have.

    Raises:
        ConfigError: the source is unknown, or the weight is not above zero.
    """
    source, _, rest = text.partition("=") if "=" in text else ("", "", text)
    path, _, weight = rest.rpartition(":")
    try:
        number = float(weight) if path else 1.0
    except ValueError:  # the colon belongs to the path
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
    """Read the data of a run; what is not there yet is made first, and an interrupted one goes on.

    Shards that are cut out of recordings lie in the folder `cache`. `on_progress` is called with
    "interactions", or the name of a source, and what is done.

    Raises:
        InputError: a source holds nothing to learn from, or its files cannot be read.
    """
    portions: list[list[Portion]] = []
    made: list[dict[str, Any]] = []
    notes: list[str] = []
    for one in sources:
        report = on_progress and partial(on_progress, one.source or "interactions")
        if not one.source:
            write_missing(one.path, config.synthesis, report)
            found = [whole(read_shards(one.path, split), one.weight) for split in ("train", "val")]
            made.append(as_dict(shard_record(find_shards(one.path, "train")[0])))
        else:
            digest = hashlib.sha256(str(one.path.resolve()).encode()).hexdigest()[:8]
            folder, readers = cache / f"{one.source}_{digest}", options or ReaderOptions()
            shards, problems = recordings.make_shards(
                one.source, one.path, folder, config.clips, readers, on_step=report
            )
            found, words = split_recordings(one, shards)
            notes += [*words, *problems]
            made.append({"source": one.source, "weight": one.weight, "clips": asdict(config.clips)})
        portions.append(found)
    record = made[0] if len(made) == 1 else {"sources": made}
    training, validation = (mixed(split) for split in zip(*portions, strict=True))
    return TrainingData(training, validation, record, tuple(notes))


def write_missing(folder: Path, config: SynthesisConfig, on_step: Any) -> None:
    """Make what a folder lacks of this config's interactions; those of another are left alone."""
    there = sorted(folder.glob("*_*.safetensors"))
    if not there or shard_record(there[0]) == ShardRecord(config, 0):
        write_shards(folder, config, load_hand("right"), seed=0, on_shard=on_step)


def whole(clips: Streamed[Interactions], weight: float) -> Portion:
    """Made clips, all of whose frames are real."""
    return Portion(clips, torch.full((len(clips),), clips.shards[0].wrist.shape[1]), weight)


def split_recordings(source: DataSource, shards: Iterable[Path]) -> tuple[list[Portion], list[str]]:
    """The clips to learn from and those to validate on, and words; `InputError` without any."""
    clips: list[Interactions] = []
    records: list[ClipRecord] = []
    left_out: Counter[str] = Counter()
    for shard in shards:
        record = recordings.shard_record(shard)
        assert record is not None, "it was made or checked just now"
        left_out.update(record.left_out)
        if record.clips:
            clips.append(read_shard(shard))
            records += record.clips
    reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items() if count)
    if not records:
        raise InputError(
            f"{source.path}: expected clips of {source.source} with hand and object near each "
            f"other, got none ({reasons or 'no frames'}); a shorter windows.frames keeps more"
        )
    held, by = held_out(records)
    together = Streamed.of(clips)
    lengths = torch.tensor([record.length for record in records])
    parts = [
        Portion(together.only(kept), lengths[kept], source.weight)
        for kept in ((~held, held) if bool(held.any()) else (~held, ~held))
    ]
    objects = len({record.object for record in records})
    of = "one object" if objects == 1 else f"{objects} objects"
    words = f"{source.source}: {len(records)} clips of {of}, {by}"
    return parts, [f"{words}; frames left out: {reasons or 'none'}"]


def held_out(records: Sequence[ClipRecord]) -> tuple[Bool[Tensor, " B"], str]:
    """Which clips are held out for validation, and by what, in words.

    Whole objects; of one object whole people; of one person with one object none.
    """
    for kind in ("object", "person"):
        held, chosen = held_groups([getattr(record, kind) for record in records])
        if not chosen:
            continue
        words = {"object": "object" if chosen == 1 else "objects", "person": "people"}
        return held, f"{int(held.sum())} of {chosen} {words[kind]} held out for validation"
    none = torch.zeros(len(records), dtype=torch.bool)
    return none, "validated on what is learned: there is no other object"


def held_groups(of_clip: Sequence[str]) -> tuple[Bool[Tensor, " B"], int]:
    """Which clips are of random whole groups that hold a tenth of all, and how many groups.

    One group more stays to learn from; where there is only one, none is held out.
    """
    counts, chosen = Counter(of_clip), set[str]()
    for name in sorted(counts, key=lambda name: seed_of("held out", name))[:-1]:
        chosen.add(name)
        if sum(counts[one] for one in chosen) >= HELD_OUT * len(of_clip):
            break
    return torch.tensor([name in chosen for name in of_clip]), len(chosen)


def mixed(portions: Sequence[Portion]) -> Streamed[Interactions]:
    """All clips in one, drawn in the shares of their sources; one whole source stays as it is."""
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
    """The clips padded with their last frame, with so many of their surface points."""
    last = clips.wrist.shape[1] - 1
    some = torch.linspace(0, clips.points.shape[1] - 1, points).round().long()
    return clips.take(torch.arange(frames).clamp(max=last), "T").take(some, "P")
