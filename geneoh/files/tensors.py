"""Tensors in a safetensors file, with a JSON record in its header of how they were made."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from geneoh.errors import shortened
from geneoh.files.atomic import write_whole

MESSAGE = 200
"""Most characters of a message that are quoted from a damaged file."""


class DamagedTensorsError(ValueError):
    """A file is no safetensors file with a record, or lacks an entry that its reader needs."""


def write_tensors(
    path: Path, tensors: Mapping[str, Tensor], record: Mapping[str, Any], *, parents: bool = False
) -> None:
    """Write tensors and record to a file in one step; with `parents`, make its folder."""
    held = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    # one metadata entry, because safetensors writes several in no fixed order
    write_whole(path, save(held, metadata={"record": json.dumps(record)}), parents=parents)


@contextmanager
def opened_tensors(path: Path) -> Iterator[tuple[Any, dict[str, Any]]]:
    """An opened file, which maps tensors into memory on access, and its record.

    Raises:
        DamagedTensorsError: the file is damaged, or the block raises an error of a lookup, a type
            or a value, which counts as damage of the file.
        OSError: the file cannot be read.
    """
    try:
        with safe_open(path, framework="pt") as file:
            yield file, dict(json.loads((file.metadata() or {})["record"]))
    except (
        SafetensorError,
        LookupError,
        ArithmeticError,
        TypeError,
        ValueError,
        RecursionError,  # lists in lists in lists
    ) as error:
        raise DamagedTensorsError(shortened(str(error), MESSAGE)) from error


def all_tensors(file: Any) -> dict[str, Tensor]:
    """Every tensor of an opened file."""
    return {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
