"""The trained denoisers: where the shipped weights lie and how networks are rebuilt from files."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import torch
from torch import nn
from typing_extensions import assert_never

from geneoh.denoisers.motion import MotionConfig, MotionDenoiser
from geneoh.denoisers.regression import RegressionConfig, RegressionDenoiser
from geneoh.denoisers.spatial import SpatialConfig, SpatialDenoiser
from geneoh.denoisers.temporal import TemporalConfig, TemporalDenoiser
from geneoh.denoisers.toch import TochAutoencoder, TochConfig
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.errors import CheckpointError
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint

SHIPPED = Path(__file__).parent / "assets"
"""Folder of the weights inside the package, STAGE.safetensors, and those of the baselines."""
STAGES = ("motion", "spatial", "temporal", "trajectory")

Baseline = TochAutoencoder | RegressionDenoiser
BaselineName = Literal["toch", "regression"]
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
        path = folder / f"{stage}.safetensors"
        return restored(saved[stage], stage, build, path).to(device)

    return Denoisers(
        rebuilt("motion", lambda sizes: MotionDenoiser(MotionConfig(**sizes))),
        rebuilt("spatial", lambda sizes: SpatialDenoiser(SpatialConfig(**sizes))),
        rebuilt("temporal", lambda sizes: TemporalDenoiser(TemporalConfig(**sizes))),
        rebuilt("trajectory", lambda sizes: TrajectoryDenoiser(TrajectoryConfig(**sizes))),
        {stage: checkpoint.record for stage, checkpoint in saved.items()},
    )


def load_motion(folder: Path) -> MotionDenoiser:
    """MotionDiff from a folder that holds its weights, else the shipped one: what the stages after
    it are trained on."""
    path = folder / "motion.safetensors"
    path = path if path.exists() else SHIPPED / path.name
    saved = load_checkpoint(path)
    return restored(saved, "motion", lambda sizes: MotionDenoiser(MotionConfig(**sizes)), path)


def load_baseline(name: BaselineName, folder: Path | None = None) -> Baseline:
    """The network of a baseline that `geneoh eval` scores, the shipped one by default.

    Raises:
        CheckpointError: the file is missing or does not fit its network.
    """
    path = (folder or SHIPPED) / f"{name}.safetensors"
    saved = load_checkpoint(path)
    match name:
        case "toch":
            return restored(saved, name, lambda sizes: TochAutoencoder(TochConfig(**sizes)), path)
        case "regression":
            return restored(
                saved, name, lambda sizes: RegressionDenoiser(RegressionConfig(**sizes)), path
            )
        case _:
            assert_never(name)


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
