"""Interactions on disk: seeded shards that can be made in any order and read one at a time."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.config import as_dict, check_limits, setting_differences, with_table
from geneoh.errors import ConfigError, InputError
from geneoh.files.atomic import make_folder
from geneoh.files.tensors import all_tensors, write_tensors
from geneoh.geometry.mesh import edges_of
from geneoh.geometry.thin_walls import goes_through
from geneoh.hand.library import load_hand
from geneoh.hand.model import ShapedHand
from geneoh.hand.skeleton import LARGEST_HAND
from geneoh.progress import OnStep
from geneoh.seeds import seeded_generator
from geneoh.streamed import Streamed
from geneoh.synthesis.bimanual import (
    BimanualConfig,
    bimanual_objects,
    grasp_directions,
    pair_hands,
)
from geneoh.synthesis.damage import refuse_damage, whole_shard
from geneoh.synthesis.grasps import GraspConfig, Grasps, shifted_grips, synthesize_grasps
from geneoh.synthesis.motion import AnimationConfig, Interactions, animate
from geneoh.synthesis.objects import FAMILIES, draw_objects, family_named
from geneoh.synthesis.scans import FILE, Scans, read_scans
from geneoh.synthesis.solids import Solids
from geneoh.workers.pool import in_processes

MOST_FRAMES = 9000
"""Frames of the longest clip: five minutes, in which a body walks 500 m; a shard whose numbers are
beyond `damage.LARGEST` (1000) is taken for damaged."""
MOST_IN_SHARD = 1_000_000
"""Frames of all clips of the largest shard. They are made at once and take 7 to 15 KB each."""


@runtime_checkable
class Source(Protocol):
    """What shards are made of beside their config, such as scanned objects."""

    @property
    def fingerprint(self) -> str:
        """What tells it from others."""
        ...


@dataclass(frozen=True)
class ShardConfig:
    """How many clips a data set has, in which files; saved in every shard."""

    kind: ClassVar[str] = "interactions"  # what the clips are
    command: ClassVar[str] = "geneoh synthesize"  # what makes them

    count: int = 4096  # clips in all; rounded up to whole shards
    frames: int = 150  # length of each, at 30 frames a second
    shard: int = 128  # clips per file
    validation: float = 0.05  # share of the shards that are for validation

    def __post_init__(self) -> None:
        """Refuse sizes below one, clips without motion or too long, and a share that is none."""
        check_limits(self, dict.fromkeys(("count", "shard"), (1, math.inf)))
        check_limits(self, {"frames": (2, MOST_FRAMES), "validation": (0, 1)})

    def check_size(self) -> None:
        """Refuse shards that are too large to make; `ConfigError` says by how much.

        Each setting alone may be right, so that this is checked when all of them are known.
        """
        if self.shard * self.frames > MOST_IN_SHARD:
            raise ConfigError(
                f"{type(self).__name__}: 'shard' times 'frames' must be at most {MOST_IN_SHARD}, "
                f"got {self.shard} clips of {self.frames} frames; lower one of them"
            )

    @property
    def shards(self) -> int:
        """Files in all, those for validation first."""
        return max(2, -(-self.count // self.shard))

    def split_of(self, index: int) -> str:
        """What the shard of this number is for: "val" or "train", of each of which there is one."""
        first = min(max(1, round(self.validation * self.shards)), self.shards - 1)
        return "val" if index < first else "train"

    def families_of(self, index: int, scans: Any = None) -> list[str]:
        """Names of what the shard of this number may show."""
        raise NotImplementedError


@dataclass(frozen=True)
class SynthesisConfig(ShardConfig):
    """What a synthetic data set of interactions is made of."""

    count: int = 20480
    frames: int = 120
    shard: int = 256
    points: int = 512  # surface points kept of each object
    shape_std: float = 0.8  # deviation of the hands' shape coefficients
    bone_std: float = 0.04  # relative deviation of bone lengths beyond what shape coefficients make
    held_out: tuple[str, ...] = ("mug", "loop_tool", "spoon", "kettle", "drawer")
    """Families that appear in validation shards only."""
    validation: float = 0.03  # share of the shards of held-out families and scanned objects
    scanned: float = 0.5  # share of the attempts on scanned objects, where there are any
    grasps: GraspConfig = field(default_factory=GraspConfig)
    bimanual: BimanualConfig = field(default_factory=BimanualConfig)
    animation: AnimationConfig = field(default_factory=AnimationConfig)

    def __post_init__(self) -> None:
        """Refuse such sizes, and held-out families that are unknown, none or all."""
        super().__post_init__()
        check_limits(self, {"points": (1, math.inf), "scanned": (0, 1)})
        check_limits(self, dict.fromkeys(("shape_std", "bone_std"), (0, math.inf)))
        for family in self.held_out:
            family_named(family)
        if not self.held_out or not self.common:
            raise ConfigError(
                "held_out must name some object families for validation and leave some for "
                f"training, got {len(set(self.held_out))} of {len(FAMILIES)}; name a few"
            )

    @property
    def common(self) -> list[str]:
        """Families of the training shards."""
        return [name for name in FAMILIES if name not in self.held_out]

    def families_of(self, index: int, scans: Scans | None = None) -> list[str]:
        """Object families of the shard of this number, then the names of its scanned objects."""
        held_out = self.split_of(index) == "val"
        found = list(self.held_out) if held_out else self.common
        if scans is not None:
            found += [n for n in scans.names if (n in scans.held_out) == held_out]
        return found


@dataclass(frozen=True)
class Attempts:
    """Hands and objects between which grasps are searched, before any is kept."""

    families: list[str]
    solids: Solids
    hands: ShapedHand  # hands with bone lengths of their own in `offsets`
    shared: Int[Tensor, " C"]  # first hands on the objects of the last C attempts, the second hands

    def take(self, which: Int[Tensor, " N"]) -> "Attempts":
        """Some of the attempts, each by itself."""
        families = [self.families[i] for i in which.tolist()]
        solids, hands = self.solids.take(which, "B"), self.hands.take(which, "B")
        return Attempts(families, solids, hands, self.shared[:0])


FORMER_FAMILIES = 32  # of shards that do not say how many there were


@dataclass(frozen=True)
class ShardRecord:
    """What a shard was made with; saved in it."""

    config: ShardConfig
    seed: int
    objects: str = ""  # fingerprint of the scanned objects; empty without them
    families: int = len(FAMILIES)  # how many there were; scanned objects are numbered after them


def shard_generator(seed: int, index: int) -> torch.Generator:
    """The random generator of one shard, independent of the order in which shards are made."""
    return seeded_generator(seed, "shard", index)


def draw_attempts(
    config: SynthesisConfig,
    families: list[str],
    missing: int,
    *,
    generator: torch.Generator,
    scans: Scans | None = None,
) -> Attempts:
    """First hands on objects of the families, then second hands on some of the objects."""
    count = 2 * missing + 4  # more than half fail, but second hands are added
    named = draw_names(families, count, config.scanned, generator=generator)
    alone = draw_objects(named, generator=generator, scans=scans)
    shared = bimanual_objects(alone, count, config.bimanual)
    mirrored = alone.take(shared, "B").mirrored()
    solids = concatenated([alone, mirrored], "B")
    betas = config.shape_std * torch.randn(count, 10, generator=generator)
    stretch = 1 + config.bone_std * torch.randn(count, 20, 1, generator=generator)
    differ = torch.randn(len(shared), 20, 1, generator=generator)
    stretch = torch.cat([stretch, stretch[shared] * (1 + config.bimanual.bone_std * differ)])
    hands = load_hand("right").shaped(torch.cat([betas, betas[shared]]))
    named += [named[i] for i in shared.tolist()]
    return Attempts(named, solids, replace(hands, offsets=hands.offsets * stretch), shared)


def draw_names(
    families: list[str], count: int, scanned_share: float, *, generator: torch.Generator
) -> list[str]:
    """Names of families, and of scanned objects in their share, at random."""

    def drawn(names: list[str]) -> list[str]:
        return [names[i] for i in torch.randint(len(names), (count,), generator=generator)]

    named = drawn([name for name in families if name in FAMILIES])
    if scanned := [name for name in families if name not in FAMILIES]:
        take = torch.rand(count, generator=generator) < scanned_share
        named = [b if t else a for a, b, t in zip(named, drawn(scanned), take, strict=True)]
    return named


def synthesize_shard(
    config: SynthesisConfig,
    families: list[str],
    *,
    generator: torch.Generator,
    scans: Scans | None = None,
) -> Interactions:
    """Interactions of the given families that passed the grasp checks, `config.shard` of them."""
    kept: list[Interactions] = []
    while (missing := config.shard - sum(len(part.wrist) for part in kept)) > 0:
        tried = draw_attempts(config, families, missing, generator=generator, scans=scans)
        kept.append(interactions_of(tried, config, generator=generator))
    return concatenated(kept, "B").take(slice(config.shard), "B")


def interactions_of(
    tried: Attempts, config: SynthesisConfig, *, generator: torch.Generator
) -> Interactions:
    """Clips of the attempts whose grasp is kept."""
    grasps = tried_grasps(tried, config, grasp_directions(tried.solids, tried.shared), generator)
    kept, solids = grasps.take(grasps.kept, "B"), tried.solids.take(grasps.kept, "B")
    return animate(
        kept,
        solids,
        config.frames,
        config.points,
        config.animation,
        generator=generator,
        pairs=pair_hands(grasps, tried.shared, config.bimanual),
        grips=shifted_grips(solids, kept, config.grasps, generator=generator),
    )


def tried_grasps(
    tried: Attempts,
    config: SynthesisConfig,
    toward: Float[Tensor, "B 3"],
    generator: torch.Generator,
) -> Grasps:
    """A grasp of every attempt; those in which the skin is too deep or goes through a thin wall,
    where it is never deep, are not kept either."""
    solids, offsets = tried.solids, tried.hands.offsets
    grasps = synthesize_grasps(solids, offsets, config.grasps, generator=generator, toward=toward)
    skin = tried.hands.posed(grasps.pose, grasps.wrist).verts
    distance, normal = solids.distance_and_normal(skin)
    shallow = -distance.amin(-1) < config.grasps.checks.depth + config.grasps.checks.skin
    through = goes_through(skin, distance, normal, edges_of(tried.hands.model.faces))
    return replace(grasps, kept=grasps.kept & shallow & ~through)


def write_shards(
    folder: Path,
    config: ShardConfig,
    *,
    seed: int,
    scans: Source | None = None,
    jobs: int = 1,
    on_shard: OnStep | None = None,
    synthesize: Callable[..., Any] = synthesize_shard,
) -> int:
    """Make every shard (`val_00000.safetensors`, `train_00001.safetensors`) that is missing.

    Each is written whole or not at all, so that an interrupted run goes on with the next one.
    Several processes (`jobs`) write the same bytes as this one alone. Returns how many were made.
    What is in them is what `synthesize` makes, with the arguments of `synthesize_shard`.

    Raises:
        ConfigError: the shards are too large to make.
        InputError: the folder holds shards of another config or seed, or a broken one.
    """
    config.check_size()
    make_folder(folder)
    record = ShardRecord(config, seed, "" if scans is None else scans.fingerprint)
    for path in sorted(folder.glob("*_*.safetensors")):
        if differs := differences(shard_record(path, config), record):
            raise InputError(
                f"{path}: was made with {differs}; ask for the same or name another folder"
            )
    named = {i: folder / f"{config.split_of(i)}_{i:05d}.safetensors" for i in range(config.shards)}
    missing = [(index, path) for index, path in named.items() if not path.exists()]
    make = partial(make_shard, record=record, scans=scans, synthesize=synthesize)
    # Alone, this process makes use of all its threads; workers have one each.
    making = map(make, missing) if jobs == 1 else in_processes(missing, make, jobs, lost)
    for done, _ in enumerate(making, config.shards - len(missing) + 1):
        if on_shard is not None:
            on_shard(done, config.shards)
    return len(missing)


def make_shard(
    place: tuple[int, Path],
    record: ShardRecord,
    scans: Source | None,
    synthesize: Callable[..., Any],
) -> None:
    """Make the shard of a number and write it to its path."""
    index, path = place
    generator, names = shard_generator(record.seed, index), record.config.families_of(index, scans)
    made = synthesize(record.config, names, generator=generator, scans=scans)
    write_clips(path, made, record)


def write_clips(path: Path, clips: Bundle, record: ShardRecord) -> None:
    """Write the clips of a shard: tensors as such, and texts in the record."""
    held = {field.name: getattr(clips, field.name) for field in fields(clips)}
    texts = {name: value.tolist() for name, value in held.items() if isinstance(value, np.ndarray)}
    tensors = {name: value for name, value in held.items() if name not in texts}
    write_tensors(path, tensors, as_dict(record) | texts)


def lost(place: tuple[int, Path], why: str) -> None:
    """A shard that killed its workers ends the run."""
    raise InputError(f"{place[1]}: {why}")


def differences(found: ShardRecord, asked: ShardRecord) -> str:
    """What differs between two records of how shards were made, in words; empty when nothing."""
    was, wanted = (as_dict(record) for record in (found, asked))
    return setting_differences(was.pop("config") | was, wanted.pop("config") | wanted)


def shard_record(path: Path, defaults: ShardConfig = SynthesisConfig()) -> ShardRecord:
    """What a shard was made with; a setting that it does not name has its default.

    Raises:
        InputError: the file is no whole shard, holds other clips than those of `defaults`, or has
            settings of another version.
    """
    with whole_shard(path, defaults.kind, defaults.command) as (shard, record):
        found = kind_of(shard.keys())
        table, seed = dict(record["config"]), int(record["seed"])
        objects = str(record.get("objects", ""))
        families = int(record.get("families", FORMER_FAMILIES))
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


def kind_of(names: Iterable[str]) -> str:
    """What clips are whose tensors have these names; see `ShardConfig.kind`."""
    marks = {"verb": "actions", "gesture": "bodies"}
    return next((marks[name] for name in names if name in marks), SynthesisConfig.kind)


def unfinished(folder: Path, config: ShardConfig) -> tuple[str, ...]:
    """A note where a folder lacks shards of the data set that it was begun with."""
    there = len(list(folder.glob("*_*.safetensors")))
    if there >= config.shards:
        return ()
    return (
        f"{folder}: {there} of {config.shards} shards are there; `{config.command}` with the same "
        "options makes the others",
    )


def find_shards(folder: Path, split: str, defaults: ShardConfig = SynthesisConfig()) -> list[Path]:
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
        if differs := differences(shard_record(path, defaults), first):
            raise InputError(
                f"{path}: was made with {differs} as in {paths[0].name}; "
                "keep the shards of one run in a folder"
            )
    return paths


def read_shard(path: Path) -> Interactions:
    """One shard, mapped from its file: pages are read when they are used.

    `InputError` if the file is no whole shard.
    """
    with whole_shard(path, SynthesisConfig.kind, SynthesisConfig.command) as (shard, _):
        found = all_tensors(shard)
        if "scan" not in found:  # made before there were scanned objects
            found["scan"] = torch.full((len(found["wrist"]),), -1)
        clips = Interactions(**found)
        refuse_damage(clips, {"part": clips.rotation.shape[2]})
        _check_hands_and_motion(clips)
        return clips


def _check_hands_and_motion(clips: Interactions) -> None:
    """Refuse bones and rotations of impossible lengths, which damage makes of them."""
    axes, bones = clips.rotation.norm(dim=-1), clips.offsets.norm(dim=-1)
    if not bool(((axes - 1).abs() < 1e-2).all()):
        raise ValueError("rotations whose rows are not of length 1")
    if not bool(((bones > 1e-4) & (bones < LARGEST_HAND)).all()):
        raise ValueError(f"bones of {float(bones.min()):.3g} to {float(bones.max()):.3g} metres")


def scans_of(path: Path, defaults: SynthesisConfig = SynthesisConfig()) -> Scans | None:
    """The scanned objects of a shard, which are in a file beside it; None where it has none.

    `InputError` if that file is missing, broken or another one.
    """
    if not (wanted := shard_record(path, defaults).objects):
        return None
    scans = read_scans(path.parent / FILE)
    if scans.fingerprint != wanted:
        raise InputError(f"{path.parent / FILE}: holds other objects than {path.name} was made of")
    return scans


def read_shards(folder: Path, split: str) -> Streamed[Interactions]:
    """The interactions of one split ("train" or "val"), mapped from files; as `find_shards`."""
    return Streamed.of_files(find_shards(folder, split), read_shard)
