"""Load the trained denoisers from checkpoints: the shipped ones, or a user's."""

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
PAPER_STAGES = ("trajectory", "relations", "latent")
"""The three stages in the paper's form; the preset `paper` needs these alone."""
NETWORKS: dict[str, tuple[Any, Any]] = {
    "motion": (MotionDenoiser, MotionConfig),
    "spatial": (SpatialDenoiser, SpatialConfig),
    "temporal": (TemporalDenoiser, TemporalConfig),
    "trajectory": (TrajectoryDenoiser, TrajectoryConfig),
    "relations": (RelationDenoiser, RelationConfig),
    "latent": (LatentDenoiser, LatentConfig),
}
"""Network class and configuration class of each stage."""


@dataclass(frozen=True)
class Denoisers:
    """The networks of the three stages with their weights."""

    motion: MotionDenoiser
    spatial: SpatialDenoiser
    temporal: TemporalDenoiser
    trajectory: TrajectoryDenoiser | None = None
    """MotionDiff in the paper's form; None if not loaded."""
    relations: RelationDenoiser | None = None
    """SpatialDiff in the paper's form; None if not loaded."""
    latent: LatentDenoiser | None = None
    """TemporalDiff in the paper's form; None if not loaded."""


def load_denoisers(
    folder: Path | None = None, *, device: torch.device | str = "cpu", paper: bool = True
) -> Denoisers:
    """The networks from a folder of STAGE.safetensors files, by default the shipped ones.

    The folder must have those of `CLEANING_STAGES`, or for `paper` those of `PAPER_STAGES`. For
    `paper` the others are loaded, too, the shipped ones where the folder has none.

    Raises:
        CheckpointError: a file is missing or does not fit its network.
    """
    paths = [stage_weights(name, folder) for name in (PAPER_STAGES if paper else CLEANING_STAGES)]
    if paper:
        paths += [file_or_shipped(name, folder, SHIPPED) for name in CLEANING_STAGES]
    place = torch.device(device)
    files = tuple((path, version_of(path)) for path in paths)
    return kept_denoisers(files, place, cleaning_precision(place))


def version_of(path: Path) -> tuple[int, int]:
    """Modification time and size of a file, which detect a changed file; zeros if it is missing."""
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=2)
def kept_denoisers(
    files: tuple[tuple[Path, tuple[int, int]], ...], device: torch.device, precision: torch.dtype
) -> Denoisers:
    """The networks of some files, cached for the next clips: loading takes a tenth of a second."""
    networks = {path.stem: load_network(path, *NETWORKS[path.stem]) for path, _ in files}
    for network in networks.values():
        multiply_in(network.to(device), precision)
    return Denoisers(**networks)


def load_motion(folder: Path) -> MotionDenoiser:
    """MotionDiff for the training of later stages: from the folder if it has one, else shipped."""
    return load_network(file_or_shipped("motion", folder, SHIPPED), *NETWORKS["motion"])


def stage_weights(name: str, folder: Path | None) -> Path:
    """Path of a stage's weights: in the folder if given, else the shipped file."""
    return (folder or SHIPPED) / f"{name}.safetensors"


def all_weights(folder: Path | None) -> list[Path]:
    """Paths of the weights of all stages, which cleaning may read; a folder may lack some."""
    return [stage_weights(name, folder) for name in (*CLEANING_STAGES, *PAPER_STAGES)]
