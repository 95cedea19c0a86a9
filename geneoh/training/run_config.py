"""Settings that every training run has, of whichever network."""

import math
from dataclasses import dataclass

from geneoh.config import check_limits

LIMITS = {
    **dict.fromkeys(("steps", "batch", "accumulate", "warmup"), (1, math.inf)),
    **dict.fromkeys(("checkpoint_every", "validate_every", "validation_batches"), (1, math.inf)),
    **dict.fromkeys(("rate", "decay", "weight_decay", "ema"), (0, 1)),
    "clip": (1e-6, math.inf),
}
"""The least and the largest value of the settings."""


@dataclass(frozen=True)
class RunConfig:
    """Steps, rate and averaging of a run; every value is saved with the weights."""

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
    seed: int = 0  # of the first weights and of every batch
    checkpoint_every: int = 250  # steps between two saved states of the run
    validate_every: int = 250  # steps between two validations
    validation_batches: int = 8  # batches of each validation, the same ones every time

    def __post_init__(self) -> None:
        """Refuse numbers that no run can have."""
        check_limits(self, LIMITS)
