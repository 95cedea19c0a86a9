"""Weights and the settings of their training in one safetensors file, without pickle."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from geneoh.errors import CheckpointError
from geneoh.files.tensors import DamagedTensorsError, all_tensors, opened_tensors, write_tensors

HALVES = (torch.float16, torch.bfloat16)  # storage types, converted to float32 when loaded


@dataclass(frozen=True)
class Checkpoint:
    """Tensors by name and a JSON record of how they were made."""

    tensors: dict[str, Tensor]
    record: dict[str, Any]


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint whole or not at all; `InputError` where the place cannot be written to."""
    write_tensors(path, checkpoint.tensors, checkpoint.record, parents=True)


def load_checkpoint(
    path: Path, *, remedy: str = "train or download the weights again"
) -> Checkpoint:
    """Read a checkpoint to the CPU; float16 and bfloat16 become float32, other types are kept.

    `remedy` is what the user can do about a damaged file.

    Raises:
        CheckpointError: the file cannot be read, is not safetensors or carries no record.
    """
    try:
        with opened_tensors(path) as (file, record):
            tensors = all_tensors(file)
    except FileNotFoundError as error:
        raise CheckpointError(
            f"{path}: expected weights there, found no file; "
            "train them with `geneoh train` or reinstall geneoh"
        ) from error
    except DamagedTensorsError as error:
        raise CheckpointError(
            f"{path}: expected a safetensors file with a geneoh record, got {error}; {remedy}"
        ) from error
    except OSError as error:
        raise CheckpointError(
            f"{path}: expected a file of weights that you may read, got '{error}'; check that it "
            "is no folder, and its permissions"
        ) from error
    return Checkpoint(
        {n: t.float() if t.dtype in HALVES else t for n, t in tensors.items()}, record
    )


def finite_output(values: Tensor) -> Tensor:
    """A network's output, unchanged; `CheckpointError` where it holds NaN or infinity, which
    damaged weights cause."""
    if not bool(values.isfinite().all()):
        raise CheckpointError(
            "expected finite numbers from the networks, got NaN or infinity; their weights are "
            "damaged, train or download them again"
        )
    return values
