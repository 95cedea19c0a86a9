"""Settings that the training runs of all networks have."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, TypeVar

from geneoh.config import Limited, Limits, as_dict, configured, flat, parse_setting
from geneoh.errors import ConfigError

Run = TypeVar("Run", bound="RunConfig")


@dataclass(frozen=True)
class RunConfig(Limited):
    """Steps, learning rate and averaging of a run; every value is saved with the weights."""

    LIMITS: ClassVar[Limits] = {
        **dict.fromkeys(("batch", "validation_batches"), (1, 1_000_000)),
        **dict.fromkeys(("rate", "decay", "weight_decay", "ema"), (0, 1)),
        **{"clip": (1e-6, math.inf), "seed": (-math.inf, math.inf)},
    }
    READ_BY: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    """The stages that read a field, by its name; fields that are not listed are read by all."""

    steps: int = 8000  # optimiser steps, one batch each
    batch: int = 32  # samples in a batch, over all processes
    accumulate: int = 1
    """Pieces over which a process accumulates the gradients of its part of a batch, to save memory.
    The cleaner's stages train as without it up to rounding, the generators nearly so."""
    rate: float = 6e-4  # peak learning rate
    warmup: int = 200  # steps over which the learning rate rises linearly at the start
    decay: float = 0.3  # share of the steps, at the end, over which the rate falls linearly to zero
    weight_decay: float = 0.01  # decoupled weight decay, relative to the rate
    clip: float = 1.0  # largest norm of the gradient
    ema: float = 0.998  # decay of the averaged weights, which are used at inference
    start_share: float = 0.0
    """Weight of the initial weights in the mean with the trained ones that is written (Wortsman et
    al., CVPR 2022), so that the network forgets less. Zero for random initial weights."""
    seed: int = 0  # of the initial weights and of every batch
    checkpoint_every: int = 250  # steps between two saved states of the run
    validate_every: int = 250  # steps between two validations
    validation_batches: int = 8  # batches of each validation, the same ones every time

    def unread_by(self, stage: str) -> frozenset[str]:
        """Names of the fields that a stage does not read."""
        return frozenset(name for name, stages in self.READ_BY.items() if stage not in stages)


def stage_config(base: Run, stage: str, path: Path | None, settings: Iterable[str]) -> Run:
    """The configuration of a stage from a file, which may serve several, and `a.b=c` settings.

    Raises:
        ConfigError: the file cannot be read, or a setting is unknown or of the wrong type, or one
            of `settings` is read by other stages only.
    """
    chosen = configured(base, path, settings)
    for name in base.unread_by(stage):
        refuse_settings(name, settings, f"the stage {' or '.join(base.READ_BY[name])}")
    return chosen


def refuse_settings(name: str, settings: Iterable[str], of: str) -> None:
    """Refuse `a.b=c` settings of a field that a run does not read, `a` or `a.b`; `of` names its
    readers."""
    for setting in settings:
        asked = parse_setting(setting)
        if name in asked or name in flat(asked):
            raise ConfigError(
                f"--set {setting}: expected a setting that this run reads, got one of {of}; "
                "leave it out"
            )


def refuse_replaced(config: RunConfig, path: Path | None, settings: Iterable[str]) -> None:
    """Refuse `a.b=c` settings that contradict the weights or networks a run starts from.

    Weights fix the size of their network, and a text encoder the width of its features.
    """
    settings = list(settings)
    used = flat(as_dict(config))
    current = flat(as_dict(configured(type(config)(), path, settings)))
    for setting in settings:
        for name in flat(parse_setting(setting)):
            if used[name] != current[name]:
                raise ConfigError(
                    f"--set {setting}: expected {used[name]}, as in the weights, the texts or the "
                    f"networks that the run starts from, got {current[name]}; leave it out"
                )
