"""Settings that every training run has, of whichever network."""

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
    """Steps, rate and averaging of a run; every value is saved with the weights."""

    LIMITS: ClassVar[Limits] = {
        **dict.fromkeys(("batch", "validation_batches"), (1, 1_000_000)),
        **dict.fromkeys(("rate", "decay", "weight_decay", "ema"), (0, 1)),
        **{"clip": (1e-6, math.inf), "seed": (-math.inf, math.inf)},
    }
    READ_BY: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    """The stages that read a field, by its name; all stages read the others."""

    steps: int = 8000  # optimiser steps in all, a batch each
    batch: int = 32  # samples in a batch, of all processes together
    accumulate: int = 1
    """Pieces that a process works off its part of a batch in, which takes less memory; the steps
    of the cleaner's stages stay the same, those of the generators nearly."""
    rate: float = 6e-4  # peak learning rate
    warmup: int = 200  # steps over which the learning rate rises linearly at the start
    decay: float = 0.3  # share of the steps, at the end, over which the rate falls linearly to zero
    weight_decay: float = 0.01  # decoupled weight decay, relative to the rate
    clip: float = 1.0  # largest norm of the gradient
    ema: float = 0.998  # decay of the averaged weights, which are the ones that are used
    start_share: float = 0.0
    """Share of the weights started from in those that are written (Wortsman et al., CVPR 2022): the
    network keeps more of what it could do before. Zero without such a start."""
    seed: int = 0  # of the first weights and of every batch
    checkpoint_every: int = 250  # steps between two saved states of the run
    validate_every: int = 250  # steps between two validations
    validation_batches: int = 8  # batches of each validation, the same ones every time

    def unread_by(self, stage: str) -> frozenset[str]:
        """Names of the fields that a stage does not read."""
        return frozenset(name for name, stages in self.READ_BY.items() if stage not in stages)


def stage_config(base: Run, stage: str, path: Path | None, settings: Iterable[str]) -> Run:
    """The configuration of a stage: of a file, which may serve several, and of `a.b=c` settings.

    Raises:
        ConfigError: the file cannot be read, or a setting is unknown, of the wrong type or, on the
            command line, of other stages alone.
    """
    chosen = configured(base, path, settings)
    for name in base.unread_by(stage):
        refuse_settings(name, settings, f"the stage {' or '.join(base.READ_BY[name])}")
    return chosen


def refuse_settings(name: str, settings: Iterable[str], of: str) -> None:
    """Refuse `a.b=c` settings of a field that a run does not read; `of` says what it is for."""
    for setting in settings:
        if name in parse_setting(setting):
            raise ConfigError(
                f"--set {setting}: expected a setting that this run reads, got one of {of}; "
                "leave it out"
            )


def refuse_replaced(config: RunConfig, path: Path | None, settings: Iterable[str]) -> None:
    """Refuse `a.b=c` settings that differ from what the weights or networks of a start ask for.

    Weights fix the size of a network, and a text encoder the width of its texts.
    """
    settings = list(settings)
    used = flat(as_dict(config))
    asked = flat(as_dict(configured(type(config)(), path, settings)))
    for setting in settings:
        for name in flat(parse_setting(setting)):
            if used[name] != asked[name]:
                raise ConfigError(
                    f"--set {setting}: expected {used[name]}, which the weights, the texts or the "
                    f"networks have that the run goes on from, got {asked[name]}; leave it out"
                )
