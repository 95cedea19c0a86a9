"""The trained denoisers: where the shipped weights lie and how networks are rebuilt from files."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from geneoh.denoisers.motion import MotionConfig, MotionDenoiser
from geneoh.denoisers.spatial import SpatialConfig, SpatialDenoiser
from geneoh.denoisers.temporal import TemporalConfig, TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.errors import CheckpointError
from geneoh.nn.checkpoint import load_checkpoint

SHIPPED = Path(__file__).parent / "assets"
"""Folder of the weights inside the package, STAGE.safetensors."""
STAGES = ("motion", "spatial", "temporal", "trajectory")

Network = TypeVar("Network", bound=nn.Module)


@dataclass(frozen=True)
class Denoisers:
    """The three stages, and MotionDiff in the paper's form, ready to run."""

    motion: MotionDenoiser
    spatial: SpatialDenoiser
    temporal: TemporalDenoiser
    trajectory: TrajectoryDenoiser
    records: dict[str, dict[str, Any]]
    """How each stage was trained, by stage."""


def load_denoisers(folder: Path | None = None, *, device: torch.device | str = "cpu") -> Denoisers:
    """All three stages from one folder, the shipped weights by default.

    Raises:
        CheckpointError: a file is missing or does not fit its network.
    """
    folder = folder or SHIPPED
    saved = {stage: load_checkpoint(folder / f"{stage}.safetensors") for stage in STAGES}

    def rebuilt(stage: str, build: Callable[[dict[str, Any]], Network]) -> Network:
        try:
            network = build(saved[stage].record["config"][stage])
            network.load_state_dict(saved[stage].tensors)
        except (RuntimeError, KeyError, TypeError) as error:
            raise CheckpointError(
                f"{folder / stage}.safetensors: expected weights of this version's {stage} "
                f"network, got others ({str(error).splitlines()[-1].strip()}); train them again"
            ) from error
        return network.to(device).eval().requires_grad_(False)

    return Denoisers(
        rebuilt("motion", lambda sizes: MotionDenoiser(MotionConfig(**sizes))),
        rebuilt("spatial", lambda sizes: SpatialDenoiser(SpatialConfig(**sizes))),
        rebuilt("temporal", lambda sizes: TemporalDenoiser(TemporalConfig(**sizes))),
        rebuilt("trajectory", lambda sizes: TrajectoryDenoiser(TrajectoryConfig(**sizes))),
        {stage: checkpoint.record for stage, checkpoint in saved.items()},
    )
