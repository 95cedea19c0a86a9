"""Runs of the stages of the cleaner, as tests start them."""

from pathlib import Path
from typing import Any

from geneoh.training.loop import train
from geneoh.training.stages import StageTask


def train_stage(
    stage, config, data, validation, folder, *, motion_denoiser=None, made=None, **run: Any
) -> Path:
    """Train a stage and return the path of its weights."""
    task = StageTask(stage, config, data, validation, motion_denoiser, made)
    return train(task, folder, **run)
