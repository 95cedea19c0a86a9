"""Files of weights: which file to read, and the network built from it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from geneoh.config import with_table
from geneoh.errors import CheckpointError
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint

NetConfig = TypeVar("NetConfig")
Network = TypeVar("Network", bound=nn.Module)


def load_network(
    path: Path,
    network: Callable[[NetConfig], Network],
    config: Callable[..., NetConfig],
    saved: Checkpoint | None = None,
) -> Network:
    """A network of the saved size with the saved weights, frozen for inference. The stem of the
    file's name is the key of the network's configuration in the record; `saved` is what the file
    holds where it was already read.

    Raises:
        CheckpointError: the file is missing or holds another network.
    """
    saved, name = saved or load_checkpoint(path), path.stem
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
    """`ValueError` for a depth above `most`, the file's number of tensors: a damaged record could
    make building the network endless."""
    for name, value in size.items():
        if isinstance(value, Mapping):
            refuse_depths(value, most)
        elif name.endswith("depth") and isinstance(value, int) and value > most:
            raise ValueError(f"{name} must be at most {most}, got {value}")


def file_or_shipped(name: str, folder: Path | None, shipped: Path) -> Path:
    """The weights `name` in `folder` if they are there, else those in the folder `shipped`."""
    own = None if folder is None else folder / f"{name}.safetensors"
    return own if own is not None and own.is_file() else shipped / f"{name}.safetensors"


def refuse_none_of(names: Sequence[str], folder: Path | None) -> None:
    """`CheckpointError` for a folder with none of the named weights: without it, the shipped
    weights would be used unnoticed."""
    if folder is not None and not any((folder / f"{name}.safetensors").is_file() for name in names):
        raise CheckpointError(
            f"{folder}: expected weights of {', '.join(names)} (NAME.safetensors), one or more, "
            "found none; name the folder that `geneoh train` wrote to, or leave it out"
        )
