"""Runs of the stages of the cleaner, as tests start and stop them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

from geneoh.progress import OnStep
from geneoh.training import loop
from geneoh.training.loop import train
from geneoh.training.stages import StageTask


def train_stage(
    stage, config, data, validation, folder, *, motion_denoiser=None, made=None, **run: Any
) -> Path:
    """Train a stage and return the path of its weights."""
    task = StageTask(stage, config, data, validation, motion_denoiser, made)
    return train(task, folder, **run)


class Interrupted(Exception):
    """What `stop_after` raises."""


def stop_after(step: int) -> OnStep:
    """Ends a run after so many steps, without its state being saved."""

    def listen(done: int, total: int) -> None:
        if done == step:
            raise Interrupted

    return listen


@contextmanager
def heard_losses() -> Iterator[tuple[list[float], list[float]]]:
    """The loss of each step, and the error of each validation, of the runs in a block."""
    losses: list[float] = []
    errors: list[float] = []
    update, validate = loop.update, loop.validate

    def heard_update(state, *given):
        stopped = update(state, *given)
        losses.append(state.recent[-1])
        return stopped

    def heard_validate(*given):
        errors.append(validate(*given))
        return errors[-1]

    with mock.patch.multiple(loop, update=heard_update, validate=heard_validate):
        yield losses, errors
