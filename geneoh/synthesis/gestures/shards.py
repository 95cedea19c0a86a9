"""Clips of bodies with hands and sentences on disk, in the shards of `geneoh.synthesis.shards`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch

from geneoh.bundle import concatenated
from geneoh.config import check_limits
from geneoh.files.tensors import all_tensors
from geneoh.synthesis.data_config import ShardConfig
from geneoh.synthesis.gestures.clips import NAMES, Gestures
from geneoh.synthesis.gestures.manipulation import ActionSource
from geneoh.synthesis.gestures.one_handed import ONE_HANDED
from geneoh.synthesis.gestures.stance import BODIES
from geneoh.synthesis.gestures.synthesis import BodyConfig, gesturing, handling
from geneoh.synthesis.gestures.two_handed import TWO_HANDED
from geneoh.synthesis.gestures.variation import VARIANTS
from geneoh.synthesis.shards import find_shards, refuse_damage, whole_shard

TEXTS = ("left", "right", "joined")
"""Fields of `Gestures` that are text, which the record of a shard holds."""


@dataclass(frozen=True)
class GestureConfig(ShardConfig):
    """Settings of a data set of bodies with hands and sentences."""

    kind: ClassVar[str] = "bodies"
    command: ClassVar[str] = "geneoh synthesize --bodies"

    count: int = 16384
    held_out: int = 2  # number of the ten variants of each gesture that only validation shards show
    held_out_bodies: int = 40  # number of the 400 bodies that only validation shards show
    handling: float = 0.25
    """Share of the clips with hands that hold an object, if actions are available."""
    body: BodyConfig = field(default_factory=BodyConfig)

    def __post_init__(self) -> None:
        """Also refuse to hold out no or all variants, and no or all bodies, and shares beyond 0 to
        1."""
        super().__post_init__()
        check_limits(self, {"handling": (0, 1)})
        check_limits(self, {"held_out": (1, VARIANTS - 1), "held_out_bodies": (1, BODIES - 1)})

    def families_of(self, index: int, scans: Any = None) -> list[str]:
        """Variants of gestures, such as "wave 3", that shard number `index` may show."""
        first = VARIANTS - self.held_out
        numbers = range(first, VARIANTS) if self.split_of(index) == "val" else range(first)
        return [f"{name} {n}" for name in (*ONE_HANDED, *TWO_HANDED) for n in numbers]

    def bodies(self, split: str) -> range:
        """Indices of the bodies of a split."""
        first = BODIES - self.held_out_bodies
        return range(first, BODIES) if split == "val" else range(first)


DEFAULTS = GestureConfig()


def synthesize_gestures(
    config: GestureConfig,
    variants: list[str],
    *,
    generator: torch.Generator,
    scans: ActionSource | None = None,
) -> Gestures:
    """`config.shard` clips: variants of gestures, and actions from `scans` if there are any."""
    known = [(name, int(n)) for name, _, n in (each.rpartition(" ") for each in variants)]
    split = "val" if known[0][1] >= VARIANTS - config.held_out else "train"
    bodies = config.bodies(split)
    held = 0 if scans is None else round(config.handling * config.shard)

    def people(count: int) -> list[int]:
        return [bodies[i] for i in torch.randint(len(bodies), (count,), generator=generator)]

    drawn = people(config.shard - held)
    parts = []
    if drawn:
        parts.append(gesturing(known, drawn, config.frames, config.body, generator=generator))
    while scans is not None and (missing := config.shard - sum(len(p.body) for p in parts)) > 0:
        actions, names = scans.drawn(split, 2 * missing, generator=generator)
        drawn = people(len(actions.verb))
        made = handling(actions, names, drawn, config.frames, config.body, generator=generator)
        parts.append(made.take(slice(missing), "B"))
    return concatenated(parts, "B")


def gesture_shard(path: Path) -> Gestures:
    """One shard; `InputError` if the file is no whole shard of bodies."""
    with whole_shard(path, DEFAULTS) as (shard, record):
        held: dict[str, Any] = dict(all_tensors(shard))
        held |= {name: np.array(record[name]) for name in TEXTS}
        clips = Gestures(**held)
        lengths = (2, clips.root.shape[1])
        refuse_damage(clips, {"gesture": (0, len(NAMES) - 1), "length": lengths})
        return clips


def read_gestures(folder: Path, split: str) -> Gestures:
    """All clips of one split ("train" or "val"); raises as `find_shards` and `gesture_shard`."""
    return concatenated(map(gesture_shard, find_shards(folder, split, DEFAULTS)), "B")
