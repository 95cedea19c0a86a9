"""Shards that are read back, and what only damage makes of the numbers in them."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jaxtyping import Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.errors import InputError
from geneoh.files.tensors import DamagedTensorsError, opened_tensors
from geneoh.synthesis.data_config import ShardConfig

LARGEST = 1000.0  # largest number in a shard, in metres or radians; larger ones are damage


@contextmanager
def whole_shard(path: Path, kind: ShardConfig) -> Iterator[tuple[Any, dict[str, Any]]]:
    """An opened shard of a kind and its record; `InputError` where the file, or the block, finds
    damage."""
    try:
        with opened_tensors(path) as opened:
            yield opened
    except (OSError, DamagedTensorsError) as error:
        raise InputError(
            f"{path}: expected a whole shard of {kind.kind}, got {error}; delete it and run "
            f"`{kind.command}` again, which makes what is missing"
        ) from error


def refuse_damage(clips: Bundle, ranges: Mapping[str, int]) -> None:
    """Refuse what only damage makes: no clips or points, numbers that are no index, or NaN.

    `ranges` has the number of things that a field of indices is about.
    """
    for name, value in vars(clips).items():
        if not isinstance(value, Tensor):
            continue
        if not value.numel():
            raise ValueError(f"nothing in '{name}'")
        if value.is_floating_point() and not bool((value.abs() <= LARGEST).all()):
            raise ValueError(f"numbers beyond {LARGEST:g} in '{name}'")  # or NaN
        if name in ranges and not bool(((value >= 0) & (value < ranges[name])).all()):
            raise ValueError(f"numbers in '{name}' that are not from 0 to {ranges[name] - 1}")


def refuse_lengths(length: Int[Tensor, " B"], frames: int) -> None:
    """Refuse clips of less than two frames, or of more than there are."""
    if not bool(((length >= 2) & (length <= frames)).all()):
        raise ValueError(f"numbers in 'length' that are not from 2 to {frames}")
