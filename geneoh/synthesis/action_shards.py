"""Actions on disk, in the shards of `geneoh.synthesis.shards`."""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import ClassVar

import torch

from geneoh.bundle import concatenated
from geneoh.errors import ConfigError, InputError
from geneoh.files.tensors import all_tensors
from geneoh.streamed import Streamed
from geneoh.synthesis.actions.acting import ActingConfig, act
from geneoh.synthesis.actions.action import LONGEST, VERBS, Actions
from geneoh.synthesis.actions.setups import stands_upright
from geneoh.synthesis.attempts import draw_attempts, tried_grasps
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.grasping.bimanual import BimanualConfig, grasp_directions, pair_hands
from geneoh.synthesis.motions.object_motion import ObjectMotionConfig
from geneoh.synthesis.shapes.families import FAMILIES, JOINTED_FAMILIES
from geneoh.synthesis.shapes.scans import Scans
from geneoh.synthesis.shards import find_shards, refuse_damage, scans_of, shard_record, whole_shard


@dataclass(frozen=True)
class ActionSynthesisConfig(SynthesisConfig):
    """Settings of a data set of actions: mean-shape hands, and more surface points per object."""

    kind: ClassVar[str] = "actions"
    command: ClassVar[str] = "geneoh synthesize --actions"

    count: int = 8192
    frames: int = LONGEST
    points: int = 1024
    shard: int = 128
    shape_std: float = 0.0
    bone_std: float = 0.0
    bimanual: BimanualConfig = field(
        default_factory=lambda: BimanualConfig(share=0.2, bone_std=0.0)
    )
    acting: ActingConfig = field(default_factory=ActingConfig)
    favoured: int = 5
    """Factor by which jointed and large objects are drawn more often than others: few grasps of
    them are on the moving part, or leave room for a second hand."""

    def check_size(self) -> None:
        """Also refuse other values of `frames`: all actions are padded to `LONGEST` frames."""
        super().check_size()
        if self.frames != LONGEST:
            raise ConfigError(
                f"{type(self).__name__}: 'frames' must be {LONGEST}, which all actions have, got "
                f"{self.frames}; leave it out"
            )


DEFAULTS = ActionSynthesisConfig()
GRIPS = (
    *("grip_share", "grip_frames", "restless_share", "restless_period", "restless_size"),
    *("regrasp_width", "regrasp_distance", "regrasp_opening"),
)
HELD = ("touch", "skin", "joint_states")  # settings of moving objects that tell which part is held
UNREAD = (
    "animation",
    *(f"grasps.grip{end}" for end in ("s", "_steps", "_turn_std", "_shift_std", "_habit_std")),
    *(f"acting.hand.{name}" for name in GRIPS),
    *(f"acting.setup.parts.{f.name}" for f in fields(ObjectMotionConfig) if f.name not in HELD),
)
"""Settings of how hands carry objects about and change their grip, which they do in interactions
alone."""
TRIED_AT_ONCE = 32  # actions for which grasps are tried at once; fewer take nearly as long
MOST_NAMES = 100_000  # no data set has more objects
LARGE = ("carton", "board", "pan", "bowl", "plate", "box")
"""Families with room for two hands on a table."""


def names_of(scans: Scans | None, families: int = len(FAMILIES)) -> list[str]:
    """The first `families` family names, then scanned objects; `Actions.name` is an index here."""
    return [*list(FAMILIES)[:families], *(() if scans is None else scans.names)]


def synthesize_actions(
    config: ActionSynthesisConfig,
    families: list[str],
    *,
    generator: torch.Generator,
    scans: Scans | None = None,
) -> Actions:
    """Actions with objects of the given families, `config.shard` of them."""
    numbers = {name: index for index, name in enumerate(names_of(scans))}
    favoured = [name for name in families if name in (*JOINTED_FAMILIES, *LARGE)]
    drawn = families + favoured * (config.favoured - 1)
    kept: list[Actions] = []
    while (missing := config.shard - sum(len(part.verb) for part in kept)) > 0:
        wanted = max(missing, TRIED_AT_ONCE)
        tried = draw_attempts(config, drawn, wanted, generator=generator, scans=scans)
        standing = torch.tensor([stands_upright(name) for name in tried.families])
        toward = grasp_directions(tried.solids, tried.shared, standing)
        grasps = tried_grasps(tried, config, toward, generator)
        pairs = pair_hands(grasps, tried.shared, config.bimanual)
        which = torch.nonzero(grasps.kept)[:, 0]
        kept.append(
            act(
                grasps.take(which, "B"),
                tried.solids.take(which, "B"),
                tried.families[which].tolist(),
                numbers,
                config.points,
                config.acting,
                generator=generator,
                pairs=pairs,
            )
        )
    return concatenated(kept, "B").take(slice(config.shard), "B")


def action_shard(path: Path) -> Actions:
    """One shard; `InputError` if the file is no whole shard of actions."""
    with whole_shard(path, DEFAULTS) as (shard, _):
        actions = Actions(**all_tensors(shard))
        names = {"verb": (0, len(VERBS) - 1), "name": (0, MOST_NAMES - 1), "part": (0, 1)}
        refuse_damage(actions, names | {"length": (2, actions.joint.shape[1])})
        return actions


def names_of_shard(path: Path) -> list[str]:
    """Object names of a shard without file endings, indexed by `Actions.name`."""
    families = shard_record(path, DEFAULTS).families
    return [Path(name).stem for name in names_of(scans_of(path, DEFAULTS), families)]


def read_actions(folder: Path, split: str) -> tuple[Streamed[Actions], tuple[str, ...]]:
    """The actions of one split ("train" or "val"), and object names without file endings.

    Raises:
        InputError: the folder holds none, or files that are no whole shards of actions.
    """
    paths = find_shards(folder, split, DEFAULTS)
    names, actions = names_of_shard(paths[0]), Streamed.of_files(paths, action_shard)
    if (last := int(actions.each(lambda shard: shard.name).max())) >= len(names):
        raise InputError(
            f"{paths[0]}: expected names of {len(names)} objects, got number {last}; "
            "make the folder again"
        )
    return actions, tuple(names)
