"""Interactions on disk: seeded shards that can be made in any order and read one at a time."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import as_dict, setting_differences, with_table
from geneoh.errors import ConfigError, InputError
from geneoh.files.atomic import make_folder
from geneoh.files.tensors import DamagedTensorsError, all_tensors, opened_tensors, write_tensors
from geneoh.hand.skeleton import LARGEST_HAND
from geneoh.progress import OnStep
from geneoh.seeds import seeded_generator
from geneoh.streamed import Streamed
from geneoh.synthesis.attempts import synthesize_shard
from geneoh.synthesis.data_config import ShardConfig, SynthesisConfig
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.shapes.families import FAMILIES
from geneoh.synthesis.shapes.scans import FILE, Scans, read_scans
from geneoh.workers.pool import in_processes


@runtime_checkable
class ShardSource(Protocol):
    """Data that shards are made of beside their config, such as scanned objects."""

    @property
    def fingerprint(self) -> str:
        """Hash that identifies the data."""
        ...


DEFAULTS = SynthesisConfig()
ANY_OBJECTS = "those of --objects"  # for scanned objects whose fingerprint is not known yet
KIND_MARKS = {"verb": "actions", "gesture": "bodies"}
"""Kinds of clips (see `ShardConfig.kind`) by a tensor that only they have."""
FORMER_FAMILIES = 32  # number of families of shards whose record does not hold it
LARGEST_NUMBER = 1000.0  # largest number in a shard, in metres or radians; larger ones are damage


@dataclass(frozen=True)
class ShardRecord:
    """What a shard was made with; saved in the shard."""

    config: ShardConfig
    seed: int
    objects: str = ""  # fingerprint of the scanned objects; empty without them
    families: int = len(FAMILIES)  # number of families, after which scanned objects are numbered


def shard_generator(seed: int, index: int) -> torch.Generator:
    """The random generator of one shard, independent of the order in which shards are made."""
    return seeded_generator(seed, "shard", index)


def write_shards(
    folder: Path,
    config: ShardConfig,
    *,
    seed: int,
    scans: ShardSource | None = None,
    jobs: int = 1,
    on_shard: OnStep | None = None,
    synthesize: Callable[..., Any] = synthesize_shard,
) -> int:
    """Make every shard (`val_00000.safetensors`, `train_00001.safetensors`) that is missing.

    Each is written whole or not at all, so an interrupted run continues with the next one. The
    bytes do not depend on `jobs`, the number of processes. `synthesize` makes the clips of a shard
    and takes the arguments of `synthesize_shard`. Returns the number of shards that were made.

    Raises:
        ConfigError: the shards are too large to make.
        InputError: the folder holds shards of another config or seed, or a broken one.
    """
    config.check_size()
    make_folder(folder)
    record = ShardRecord(config, seed, "" if scans is None else scans.fingerprint)
    refuse_other_shards(folder, record)
    named = {i: folder / f"{config.split_of(i)}_{i:05d}.safetensors" for i in range(config.shards)}
    missing = [(index, path) for index, path in named.items() if not path.exists()]
    make = partial(make_shard, record=record, scans=scans, synthesize=synthesize)
    # A single process uses all its threads; workers have one thread each.
    making = map(make, missing) if jobs == 1 else in_processes(missing, make, jobs, _lost)
    for done, _ in enumerate(making, config.shards - len(missing) + 1):
        if on_shard is not None:
            on_shard(done, config.shards)
    return len(missing)


def refuse_other_shards(folder: Path, asked: ShardRecord) -> None:
    """`InputError` where a folder holds shards that were made with something else than is asked."""
    for path in sorted(folder.glob("*_*.safetensors")):
        found = shard_record(path, asked.config)
        known = found.objects if found.objects and asked.objects == ANY_OBJECTS else asked.objects
        if differs := record_differences(found, replace(asked, objects=known)):
            raise InputError(
                f"{path}: was made with {differs}; use the same settings, or name another folder"
            )


def make_shard(
    place: tuple[int, Path],
    record: ShardRecord,
    scans: ShardSource | None,
    synthesize: Callable[..., Any],
) -> None:
    """Make the shard at `place`, its number and path, and write it."""
    index, path = place
    generator, names = shard_generator(record.seed, index), record.config.families_of(index, scans)
    made = synthesize(record.config, names, generator=generator, scans=scans)
    write_clips(path, made, record)


def write_clips(path: Path, clips: Bundle, record: ShardRecord) -> None:
    """Write the clips of a shard: tensors as tensors, arrays of strings in the JSON record."""
    held = {field.name: getattr(clips, field.name) for field in fields(clips)}
    texts = {name: value.tolist() for name, value in held.items() if isinstance(value, np.ndarray)}
    tensors = {name: value for name, value in held.items() if name not in texts}
    write_tensors(path, tensors, as_dict(record) | texts)


def _lost(place: tuple[int, Path], why: str) -> None:
    """End the run with an `InputError`: the shard at `place` killed its worker processes."""
    raise InputError(f"{place[1]}: {why}")


def record_differences(found: ShardRecord, wanted_record: ShardRecord) -> str:
    """The settings that differ between two records, as text; empty if there are none."""
    was, wanted = (as_dict(record) for record in (found, wanted_record))
    return setting_differences(was.pop("config") | was, wanted.pop("config") | wanted)


@contextmanager
def whole_shard(path: Path, kind: ShardConfig) -> Iterator[tuple[Any, dict[str, Any]]]:
    """An opened shard and its record. Damage becomes `InputError`, whether opening the file or the
    body of the `with` finds it."""
    try:
        with opened_tensors(path) as opened:
            yield opened
    except (OSError, DamagedTensorsError) as error:
        raise InputError(
            f"{path}: expected a whole shard of {kind.kind}, got {error}; delete it and run "
            f"`{kind.command}` again, which makes what is missing"
        ) from error


def refuse_damage(clips: Bundle, ranges: Mapping[str, tuple[int, int]]) -> None:
    """`ValueError` for values that only damage explains: empty tensors, NaN, too large numbers, or
    numbers outside the `ranges` of fields."""
    for name, value in vars(clips).items():
        if not isinstance(value, Tensor):
            continue
        if not value.numel():
            raise ValueError(f"nothing in '{name}'")
        if value.is_floating_point() and not bool((value.abs() <= LARGEST_NUMBER).all()):
            raise ValueError(f"numbers beyond {LARGEST_NUMBER:g} in '{name}'")  # or NaN
        least, most = ranges.get(name, (-torch.inf, torch.inf))
        if not bool(((value >= least) & (value <= most)).all()):
            raise ValueError(f"numbers in '{name}' that are not from {least} to {most}")


def shard_record(path: Path, defaults: ShardConfig = DEFAULTS) -> ShardRecord:
    """The record of a shard; a setting that the file does not name has its default.

    Raises:
        InputError: the file is no whole shard, holds other clips than those of `defaults`, or has
            settings of another version.
    """
    with whole_shard(path, defaults) as (shard, record):
        names = frozenset(shard.keys())
        table, seed = dict(record["config"]), int(record["seed"])
        objects = str(record.get("objects", ""))
        families = int(record.get("families", FORMER_FAMILIES))
    found = next((kind for mark, kind in KIND_MARKS.items() if mark in names), DEFAULTS.kind)
    if found != defaults.kind:
        raise InputError(
            f"{path}: expected {defaults.kind}, got {found}; name another folder, such as one that "
            f"`{defaults.command}` made"
        )
    try:
        return ShardRecord(with_table(defaults, table, str(path)), seed, objects, families)
    except ConfigError as error:
        raise InputError(
            f"{path}: was made by another version of geneoh ({error}); make the data again"
        ) from error


def unfinished(folder: Path, config: ShardConfig) -> tuple[str, ...]:
    """A note if a folder has fewer shards than its data set is meant to have."""
    there = len(list(folder.glob("*_*.safetensors")))
    if there >= config.shards:
        return ()
    return (
        f"{folder}: {there} of {config.shards} shards are there; `{config.command}` with the same "
        "options makes the others",
    )


def find_shards(folder: Path, split: str, defaults: ShardConfig = DEFAULTS) -> list[Path]:
    """The files of one split in the order of their numbers.

    Raises:
        InputError: the folder holds no shard of that split, or shards that do not belong together.
    """
    paths = sorted(folder.glob(f"{split}_*.safetensors"))
    if not paths:
        raise InputError(
            f"{folder}: expected {split}_*.safetensors, found none; "
            f"make some with `{defaults.command} -o {folder}`"
        )
    first = shard_record(paths[0], defaults)
    for path in paths[1:]:
        if differs := record_differences(shard_record(path, defaults), first):
            raise InputError(
                f"{path}: was made with other settings than {paths[0].name} ({differs}); "
                "keep the shards of one run in a folder"
            )
    return paths


def read_shard(path: Path) -> Interactions:
    """One shard, memory-mapped: pages of the file are read when they are used.

    `InputError` if the file is no whole shard.
    """
    with whole_shard(path, DEFAULTS) as (shard, _):
        found = all_tensors(shard)
        if "scan" not in found:  # made before there were scanned objects
            found["scan"] = torch.full((len(found["wrist"]),), -1)
        clips = Interactions(**found)
        refuse_damage(clips, {"part": (0, clips.rotation.shape[2] - 1)})
        _check_hands_and_motion(clips)
        return clips


def _check_hands_and_motion(clips: Interactions) -> None:
    """`ValueError` for bone lengths and rotation matrices that only damage explains."""
    axes, bones = clips.rotation.norm(dim=-1), clips.offsets.norm(dim=-1)
    if not bool(((axes - 1).abs() < 1e-2).all()):
        raise ValueError("rotations whose rows are not of length 1")
    if not bool(((bones > 1e-4) & (bones < LARGEST_HAND)).all()):
        raise ValueError(f"bones of {float(bones.min()):.3g} to {float(bones.max()):.3g} metres")


def scans_of(path: Path, defaults: SynthesisConfig = DEFAULTS) -> Scans | None:
    """The scanned objects of a shard, from a file beside it; None if the shard has none.

    `InputError` if that file is missing, broken or has another fingerprint.
    """
    if not (wanted := shard_record(path, defaults).objects):
        return None
    scans = read_scans(path.parent / FILE)
    if scans.fingerprint != wanted:
        raise InputError(f"{path.parent / FILE}: holds other objects than {path.name} was made of")
    return scans


def read_shards(folder: Path, split: str) -> Streamed[Interactions]:
    """The interactions of one split ("train" or "val"), memory-mapped; raises as `find_shards`."""
    return Streamed.of_files(find_shards(folder, split), read_shard)
