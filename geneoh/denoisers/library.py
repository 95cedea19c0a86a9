"""The trained denoisers: where the shipped weights are and how networks are rebuilt from files."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import torch

from geneoh.denoisers.latent import LatentConfig, LatentDenoiser
from geneoh.denoisers.motion import MotionConfig, MotionDenoiser
from geneoh.denoisers.relations import RelationConfig, RelationDenoiser
from geneoh.denoisers.spatial import SpatialConfig, SpatialDenoiser
from geneoh.denoisers.temporal import TemporalConfig, TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.nn.precision import cleaning_precision, multiply_in
from geneoh.nn.weights import file_or_shipped, load_network

SHIPPED = Path(__file__).parent / "assets"  # the weights in the package, STAGE.safetensors
CLEANING_STAGES = ("motion", "spatial", "temporal")
"""Stages whose weights a user's folder must hold to clean with it."""
PAPER_STAGES = ("trajectory", "relations", "latent")
"""The three stages in the paper's form, which only the preset `paper` needs."""
NETWORKS: dict[str, tuple[Any, Any]] = {
    "motion": (MotionDenoiser, MotionConfig),
    "spatial": (SpatialDenoiser, SpatialConfig),
    "temporal": (TemporalDenoiser, TemporalConfig),
    "trajectory": (TrajectoryDenoiser, TrajectoryConfig),
    "relations": (RelationDenoiser, RelationConfig),
    "latent": (LatentDenoiser, LatentConfig),
}
"""The network of each stage, and the settings of its size."""


@dataclass(frozen=True)
class Denoisers:
    """The networks of the three stages with their weights."""

    motion: MotionDenoiser
    spatial: SpatialDenoiser
    temporal: TemporalDenoiser
    trajectory: TrajectoryDenoiser | None = None
    """MotionDiff in the paper's form, as `relations` is SpatialDiff and `latent` TemporalDiff; None
    where they are not asked for."""
    relations: RelationDenoiser | None = None
    latent: LatentDenoiser | None = None


def load_denoisers(
    folder: Path | None = None, *, device: torch.device | str = "cpu", paper: bool = True
) -> Denoisers:
    """The networks from a folder of STAGE.safetensors; None is for the shipped. `paper` asks for
    those in the paper's form as well.

    Raises:
        CheckpointError: a file is missing or does not fit its network.
    """
    names = (*CLEANING_STAGES, *(PAPER_STAGES if paper else ()))
    paths = [(folder or SHIPPED) / f"{name}.safetensors" for name in names]
    place = torch.device(device)
    files = tuple((path, version_of(path)) for path in paths)
    return kept_denoisers(files, place, cleaning_precision(place))


def version_of(path: Path) -> tuple[int, int]:
    """Time of change and size of a file, which tell that it is another one; zeros without it."""
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=2)
def kept_denoisers(
    files: tuple[tuple[Path, tuple[int, int]], ...], device: torch.device, precision: torch.dtype
) -> Denoisers:
    """The networks of some files, kept for the next clips: they are read in a tenth of a second."""
    networks = {path.stem: load_network(path, *NETWORKS[path.stem]) for path, _ in files}
    for network in networks.values():
        multiply_in(network.to(device), precision)
    return Denoisers(**networks)


def load_motion(folder: Path) -> MotionDenoiser:
    """MotionDiff for the training of later stages: from the folder if it is there, else shipped."""
    return load_network(file_or_shipped("motion", folder, SHIPPED), *NETWORKS["motion"])


def stage_weights(name: str, folder: Path | None) -> Path:
    """The file of weights in a folder, where those of cleaning stages must be, else the shipped."""
    if folder is not None and name in CLEANING_STAGES:
        return folder / f"{name}.safetensors"
    return file_or_shipped(name, folder, SHIPPED)


def all_weights(folder: Path | None) -> list[Path]:
    """The files of weights that cleaning may read, of all stages."""
    return [stage_weights(name, folder) for name in (*CLEANING_STAGES, *PAPER_STAGES)]
