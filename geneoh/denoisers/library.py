"""The trained denoisers: where the shipped weights are and how networks are rebuilt from files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from geneoh.config import with_table
from geneoh.denoisers.latent import LatentConfig, LatentDenoiser
from geneoh.denoisers.motion import MotionConfig, MotionDenoiser
from geneoh.denoisers.relations import RelationConfig, RelationDenoiser
from geneoh.denoisers.spatial import SpatialConfig, SpatialDenoiser
from geneoh.denoisers.temporal import TemporalConfig, TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.errors import CheckpointError
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.nn.precision import cleaning_precision, multiply_in

SHIPPED = Path(__file__).parent / "assets"  # the weights in the package, STAGE.safetensors
CLEANING_STAGES = ("motion", "spatial", "temporal")
"""Stages whose weights a user's folder must hold to clean with it."""
PAPER_STAGES = ("trajectory", "relations", "latent")
"""The three stages in the paper's form, which only the preset `paper` needs."""

NetConfig = TypeVar("NetConfig")
Network = TypeVar("Network", bound=nn.Module)


@dataclass(frozen=True)
class Denoisers:
    """The networks of the three stages with their weights."""

    motion: MotionDenoiser
    spatial: SpatialDenoiser
    temporal: TemporalDenoiser
    trajectory: TrajectoryDenoiser | None
    """MotionDiff in the paper's form, as `relations` is SpatialDiff and `latent` TemporalDiff; None
    where they are not asked for."""
    relations: RelationDenoiser | None
    latent: LatentDenoiser | None


def load_denoisers(
    folder: Path | None = None, *, device: torch.device | str = "cpu", paper: bool = True
) -> Denoisers:
    """The networks of all three stages from a folder of STAGE.safetensors; None is for the shipped.

    `paper` asks for the networks in the paper's form as well, for the preset `paper`.

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
    paths = {path.stem: path for path, _ in files}

    def loaded(
        stage: str, network: Callable[[NetConfig], Network], config: Callable[..., NetConfig]
    ) -> Network:
        made = load_network(paths[stage], network, config).to(device)
        multiply_in(made, precision)
        return made

    paper = "trajectory" in paths
    return Denoisers(
        loaded("motion", MotionDenoiser, MotionConfig),
        loaded("spatial", SpatialDenoiser, SpatialConfig),
        loaded("temporal", TemporalDenoiser, TemporalConfig),
        loaded("trajectory", TrajectoryDenoiser, TrajectoryConfig) if paper else None,
        loaded("relations", RelationDenoiser, RelationConfig) if paper else None,
        loaded("latent", LatentDenoiser, LatentConfig) if paper else None,
    )


def load_motion(folder: Path) -> MotionDenoiser:
    """MotionDiff for the training of later stages: from the folder if it is there, else shipped."""
    return load_network(file_or_shipped("motion", folder, SHIPPED), MotionDenoiser, MotionConfig)


def load_network(
    path: Path, network: Callable[[NetConfig], Network], config: Callable[..., NetConfig]
) -> Network:
    """A network of the saved size with the saved weights, for use without training.

    The file is named as its config is in its record.

    Raises:
        CheckpointError: the file is missing or holds another network.
    """
    saved, name = load_checkpoint(path), path.stem
    try:
        with torch.device("meta"):  # draws no random numbers, and takes the type of the weights
            size = dict(saved.record["config"][name])
            refuse_depths(size, len(saved.tensors))
            built = network(with_table(config(), size, str(path)))
        built.load_state_dict(saved.tensors, assign=True)
    except (RuntimeError, KeyError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"{path}: expected weights of this version's {name} "
            f"network, got others ({str(error).splitlines()[-1].strip()}); train them again"
        ) from error
    return built.eval().requires_grad_(False)


def refuse_depths(size: Mapping[str, Any], most: int) -> None:
    """`ValueError` for more blocks than a file has tensors, which would not end being built."""
    for name, value in size.items():
        if isinstance(value, Mapping):
            refuse_depths(value, most)
        elif name.endswith("depth") and isinstance(value, int) and value > most:
            raise ValueError(f"{name} must be at most {most}, got {value}")


def weights_of(name: str, folder: Path | None) -> Path:
    """The file of weights in a folder, where those of cleaning stages must be, else the shipped."""
    if folder is not None and name in CLEANING_STAGES:
        return folder / f"{name}.safetensors"
    return file_or_shipped(name, folder, SHIPPED)


def file_or_shipped(name: str, folder: Path | None, shipped: Path) -> Path:
    """The file of weights in a folder that has it, else the one in the folder of shipped ones."""
    given = None if folder is None else folder / f"{name}.safetensors"
    return given if given is not None and given.is_file() else shipped / f"{name}.safetensors"


def refuse_none_of(names: Sequence[str], folder: Path | None) -> None:
    """Refuse a folder without weights of any name, for which the shipped ones would be taken.

    Raises:
        CheckpointError: none is there.
    """
    if folder is not None and not any((folder / f"{name}.safetensors").is_file() for name in names):
        raise CheckpointError(
            f"{folder}: expected weights of {', '.join(names)} (NAME.safetensors), one or more, "
            "found none; name the folder that `geneoh train` wrote to, or leave it out"
        )


def all_weights(folder: Path | None) -> list[Path]:
    """The files of weights that cleaning may read, of all stages."""
    return [weights_of(name, folder) for name in (*CLEANING_STAGES, *PAPER_STAGES)]
