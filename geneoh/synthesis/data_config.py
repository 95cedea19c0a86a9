"""Settings of synthetic data sets: how many clips, in which files, and what they show."""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

from geneoh.config import check_limits
from geneoh.errors import ConfigError
from geneoh.synthesis.grasping.bimanual import BimanualConfig
from geneoh.synthesis.grasping.grasps import GraspConfig
from geneoh.synthesis.motions.motion import AnimationConfig
from geneoh.synthesis.shapes.families import FAMILIES, family_named
from geneoh.synthesis.shapes.scans import Scans

MOST_FRAMES = 9000
"""Frames of the longest clip: five minutes, in which a body walks 500 m. A shard with coordinates
beyond `shards.LARGEST_NUMBER` (1000) would count as damaged."""
MOST_IN_SHARD = 1_000_000
"""Frames of all clips of the largest shard: all are in memory together, 7 to 15 KB per frame."""


@dataclass(frozen=True)
class ShardConfig:
    """Number, length and files of a data set's clips; saved in every shard."""

    kind: ClassVar[str] = "interactions"  # what the clips are
    command: ClassVar[str] = "geneoh synthesize"  # what makes them

    count: int = 4096  # clips in all; rounded up to whole shards
    frames: int = 150  # length of each, at 30 frames a second
    shard: int = 128  # clips per file
    validation: float = 0.05  # share of the shards that are for validation

    def __post_init__(self) -> None:
        """Refuse sizes below 1, clips of too few or too many frames, and shares beyond 0 to 1."""
        check_limits(self, dict.fromkeys(("count", "shard"), (1, math.inf)))
        check_limits(self, {"frames": (2, MOST_FRAMES), "validation": (0, 1)})

    def check_size(self) -> None:
        """Refuse shards that are too large to make; `ConfigError` says by how much.

        The limit is on a product of settings, so it is checked when all of them are final.
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
        """Split of shard number `index`, "val" or "train"; each split has at least one shard."""
        first = min(max(1, round(self.validation * self.shards)), self.shards - 1)
        return "val" if index < first else "train"

    def families_of(self, index: int, scans: Any = None) -> list[str]:
        """Names of the objects or gestures that shard number `index` may show."""
        raise NotImplementedError


@dataclass(frozen=True)
class SynthesisConfig(ShardConfig):
    """Settings of a synthetic data set of interactions."""

    count: int = 20480
    frames: int = 120
    shard: int = 256
    points: int = 512  # surface points stored per object
    shape_std: float = 0.8  # standard deviation of the hands' betas
    bone_std: float = 0.04  # relative standard deviation of bone lengths, on top of the betas
    held_out: tuple[str, ...] = ("mug", "loop_tool", "spoon", "kettle", "drawer")
    """Families that appear in validation shards only."""
    validation: float = 0.03  # share of validation shards: held-out families and scans only
    scanned: float = 0.5  # share of attempts on scanned objects, if there are any
    grasps: GraspConfig = field(default_factory=GraspConfig)
    bimanual: BimanualConfig = field(default_factory=BimanualConfig)
    animation: AnimationConfig = field(default_factory=AnimationConfig)

    def __post_init__(self) -> None:
        """Also refuse shares and deviations out of range, and unknown, no or all families in
        `held_out`."""
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
        """Object families of shard number `index`, then the names of its scanned objects."""
        held_out = self.split_of(index) == "val"
        found = list(self.held_out) if held_out else self.common
        if scans is not None:
            found += [n for n in scans.names if (n in scans.held_out) == held_out]
        return found
