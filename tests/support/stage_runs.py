"""Runs of the stages of the cleaner, as tests start and stop them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from geneoh.training.loop import Progress, train
from geneoh.training.stages import StageTask


def train_stage(
    stage, config, data, validation, folder, *, motion_denoiser=None, made=None, **run: Any
) -> Path:
    """Train a stage and return the path of its weights."""
    task = StageTask(stage, config, data, validation, motion_denoiser, made)
    return train(task, folder, **run)


class Interrupted(Exception):
    """What `stop_after` raises."""


def stop_after(step: int) -> Callable[[Progress], None]:
    """Ends a run after so many steps, without its state being saved."""

    def listen(progress: Progress) -> None:
        if progress.step == step:
            raise Interrupted

    return listen
