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
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint

SHIPPED = Path(__file__).parent / "assets"
"""Folder of the weights inside the package, STAGE.safetensors."""
CLEANING_STAGES = ("motion", "spatial", "temporal")
"""What a folder of weights must hold to clean with it."""

Network = TypeVar("Network", bound=nn.Module)


@dataclass(frozen=True)
class Denoisers:
    """The three stages, ready to run."""

    motion: MotionDenoiser
    spatial: SpatialDenoiser
    temporal: TemporalDenoiser
    trajectory: TrajectoryDenoiser | None
    """MotionDiff in the paper's form, where it was asked for."""
    records: dict[str, dict[str, Any]]
    """How each stage was trained, by stage."""


def load_denoisers(
    folder: Path | None = None, *, device: torch.device | str = "cpu", trajectory: bool = True
) -> Denoisers:
    """All three stages from one folder, the shipped weights by default.

    Args:
        folder: of STAGE.safetensors.
        device: where they run.
        trajectory: whether MotionDiff in the paper's form is loaded as well; the preset `paper`
            alone needs it.

    Raises:
        CheckpointError: a file is missing or does not fit its network.
    """
    folder = folder or SHIPPED
    names = (*CLEANING_STAGES, "trajectory") if trajectory else CLEANING_STAGES
    saved = {name: load_checkpoint(folder / f"{name}.safetensors") for name in names}

    def rebuilt(stage: str, build: Callable[[dict[str, Any]], Network]) -> Network:
        path = folder / f"{stage}.safetensors"
        return restored(saved[stage], stage, build, path).to(device)

    def of_trajectory(sizes: dict[str, Any]) -> TrajectoryDenoiser:
        return TrajectoryDenoiser(TrajectoryConfig(**sizes))

    return Denoisers(
        rebuilt("motion", motion_of),
        rebuilt("spatial", lambda sizes: SpatialDenoiser(SpatialConfig(**sizes))),
        rebuilt("temporal", lambda sizes: TemporalDenoiser(TemporalConfig(**sizes))),
        rebuilt("trajectory", of_trajectory) if trajectory else None,
        {name: checkpoint.record for name, checkpoint in saved.items()},
    )


def motion_of(sizes: dict[str, Any]) -> MotionDenoiser:
    """MotionDiff of the saved sizes, without its weights."""
    return MotionDenoiser(MotionConfig(**sizes))


def weights_of(name: str, folder: Path | None) -> Path:
    """The file of a network: in the folder that the user names, else the shipped one.

    What is no stage need not be in the user's folder.
    """
    given = None if folder is None else folder / f"{name}.safetensors"
    if given is not None and (name in CLEANING_STAGES or given.is_file()):
        return given
    return SHIPPED / f"{name}.safetensors"


def load_motion(folder: Path) -> MotionDenoiser:
    """MotionDiff from a folder that holds its weights, else the shipped one: what the stages after
    it are trained on."""
    path = folder / "motion.safetensors"
    path = path if path.exists() else SHIPPED / path.name
    return restored(load_checkpoint(path), "motion", motion_of, path)


def restored(
    saved: Checkpoint, stage: str, build: Callable[[dict[str, Any]], Network], path: Path
) -> Network:
    """The network that `build` makes of the saved sizes, with the saved weights, to be used."""
    try:
        network = build(saved.record["config"][stage])
        network.load_state_dict(saved.tensors)
    except (RuntimeError, KeyError, TypeError) as error:
        raise CheckpointError(
            f"{path}: expected weights of this version's {stage} "
            f"network, got others ({str(error).splitlines()[-1].strip()}); train them again"
        ) from error
    return network.eval().requires_grad_(False)
