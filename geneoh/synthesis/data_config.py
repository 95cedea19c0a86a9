"""What data sets of made clips are made of: how many clips, in which files, and what they show."""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

from geneoh.config import check_limits
from geneoh.errors import ConfigError
from geneoh.synthesis.grasping.bimanual import BimanualConfig
from geneoh.synthesis.grasping.grasps import GraspConfig
from geneoh.synthesis.motions.motion import AnimationConfig
from geneoh.synthesis.shapes.objects import FAMILIES, family_named
from geneoh.synthesis.shapes.scans import Scans

MOST_FRAMES = 9000
"""Frames of the longest clip: five minutes, in which a body walks 500 m; a shard whose numbers are
beyond `shards.LARGEST` (1000) is taken for damaged."""
MOST_IN_SHARD = 1_000_000
"""Frames of all clips of the largest shard. They are made at once and take 7 to 15 KB each."""


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
