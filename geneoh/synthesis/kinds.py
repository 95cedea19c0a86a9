"""The kinds of data that `geneoh synthesize` makes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geneoh.choices import Unit
from geneoh.errors import ConfigError
from geneoh.progress import OnStep
from geneoh.synthesis import action_shards, shards
from geneoh.synthesis.attempts import synthesize_shard
from geneoh.synthesis.data_config import ShardConfig
from geneoh.synthesis.gestures import shards as gesture_shards
from geneoh.synthesis.gestures.manipulation import ActionSource
from geneoh.synthesis.shapes.scans import find_scans
from geneoh.synthesis.shards import ShardSource


@dataclass(frozen=True)
class DataKind:
    """One kind of data set: its default configuration and the functions that make it."""

    defaults: ShardConfig
    synthesize: Callable[..., Any]
    source: Callable[[Path, Unit, OnStep], ShardSource | None]
    """Loads scanned objects or actions that clips need, if any, from the output folder, the unit of
    meshes and a progress callback."""


def kind_of_data(
    actions: bool, bodies: bool, meshes: Path | None, holding: Path | None
) -> DataKind:
    """The kind of data that the command's options select.

    Raises:
        ConfigError: the options select two kinds, or include one that the kind does not use.
        InputError: there are no shards of actions in `holding`.
    """
    if actions and bodies:
        raise ConfigError("--bodies: expected no --actions with it, got both; leave one out")
    if meshes is not None and bodies:
        raise ConfigError("--objects: expected none with --bodies, got one; leave it out")
    if holding is not None and not bodies:
        raise ConfigError("--with-actions: expected --bodies with it, got none; add it")
    if bodies:
        held = None if holding is None else ActionSource.of(holding)
        made = gesture_shards.synthesize_gestures
        return DataKind(gesture_shards.DEFAULTS, made, lambda *_: held)

    def scans(folder: Path, unit: Unit, on_mesh: OnStep) -> ShardSource | None:
        return find_scans(folder, meshes, unit, on_mesh=on_mesh)

    if actions:
        made = action_shards.synthesize_actions
        return DataKind(action_shards.DEFAULTS, made, scans)
    return DataKind(shards.DEFAULTS, synthesize_shard, scans)
