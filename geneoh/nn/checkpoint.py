"""Weights and the settings of their training in one safetensors file, without pickle."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from geneoh.errors import CheckpointError
from geneoh.files.atomic import write_whole

HALVES = (torch.float16, torch.bfloat16)
"""Types that weights are stored in to save space; nothing computes with them."""


@dataclass(frozen=True)
class Checkpoint:
    """Tensors by name and a JSON record of how they were made."""

    tensors: dict[str, Tensor]
    record: dict[str, Any]


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint whole or not at all.

    Raises:
        InputError: the place cannot be written to.
    """
    tensors = {n: tensor.detach().cpu().contiguous() for n, tensor in checkpoint.tensors.items()}
    data = save(tensors, metadata={"record": json.dumps(checkpoint.record)})
    write_whole(path, data, parents=True)


def load_checkpoint(
    path: Path, *, remedy: str = "train or download the weights again"
) -> Checkpoint:
    """Read a checkpoint to the CPU; float16 and bfloat16 become float32, other types are kept.

    Args:
        path: the file.
        remedy: what the user can do about a damaged file.

    Raises:
        CheckpointError: the file is missing, is not safetensors or carries no record.
    """
    try:
        with safe_open(path, framework="pt") as file:
            record = json.loads((file.metadata() or {})["record"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except FileNotFoundError as error:
        raise CheckpointError(
            f"{path}: expected weights there, found no file; "
            "train them with `geneoh train` or reinstall geneoh"
        ) from error
    except (SafetensorError, KeyError, ValueError) as error:
        raise CheckpointError(
            f"{path}: expected a safetensors file with a geneoh record, got {error}; {remedy}"
        ) from error
    return Checkpoint(
        {n: t.float() if t.dtype in HALVES else t for n, t in tensors.items()}, record
    )
