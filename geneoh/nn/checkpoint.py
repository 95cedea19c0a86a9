"""Weights and the settings that made them in one safetensors file; no pickle anywhere."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from geneoh.errors import CheckpointError

HALVES = (torch.float16, torch.bfloat16)
"""Types that weights are kept small in; nothing here computes with them."""


@dataclass(frozen=True)
class Checkpoint:
    """Tensors by name and a JSON record of how they came about."""

    tensors: dict[str, Tensor]
    record: dict[str, Any]


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write the checkpoint beside `path` and rename, so a good file is never left half written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".part")
    tensors = {name: tensor.detach().contiguous() for name, tensor in checkpoint.tensors.items()}
    save_file(tensors, temporary, metadata={"record": json.dumps(checkpoint.record)})
    os.replace(temporary, path)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint; float16 and bfloat16 come back as float32, all else as it was saved.

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
    except (SafetensorError, KeyError, json.JSONDecodeError) as error:
        raise CheckpointError(
            f"{path}: expected a safetensors file with a geneoh record, got {error}; "
            "train or download the weights again"
        ) from error
    return Checkpoint(
        {n: t.float() if t.dtype in HALVES else t for n, t in tensors.items()}, record
    )
