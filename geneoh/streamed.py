"""Clips of several shards that are loaded into memory only when they are taken."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import accumulate
from pathlib import Path
from typing import Generic, TypeVar

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from geneoh.bundle import Bundle, Index, concatenated, gathered
from geneoh.errors import InputError

Clips = TypeVar("Clips", bound=Bundle)


@dataclass(frozen=True, eq=False)
class Streamed(Generic[Clips]):
    """B clips in shards; `take` copies only the clips that it returns.

    Tensors of a shard may be memory-mapped from its file: the system then reads their pages on
    first use, drops them when memory is short, and shares them between processes.
    """

    shards: tuple[Clips, ...]  # clips are along the axis B, the first axis of every field
    places: Int[Tensor, "B 2"]  # of each clip: the number of its shard, and its row there
    fitted: Callable[[Clips], Clips] | None = None
    """Brings taken clips to a common shape, where the shapes of shards differ."""

    @classmethod
    def of(cls, shards: Iterable[Clips]) -> "Streamed[Clips]":
        """All clips of shards, one shard after the other."""
        held = tuple(shards)
        rows = [torch.arange(len(getattr(shard, fields(shard)[0].name))) for shard in held]
        places = [torch.stack([torch.full_like(r, n), r], dim=1) for n, r in enumerate(rows)]
        return Streamed(held, torch.cat(places))

    @classmethod
    def of_files(cls, paths: Sequence[Path], read: Callable[[Path], Clips]) -> "Streamed[Clips]":
        """All clips of the shards in files; each file is read and checked once, here.

        Raises:
            InputError: a shard is broken, or its clips have other shapes than those of the first.
        """
        shards = [read(path) for path in paths]
        for path, shard in zip(paths, shards, strict=True):
            if _shapes(shard) != _shapes(shards[0]):
                raise InputError(
                    f"{path}: holds clips of another shape than {paths[0].name}; "
                    "keep the shards of one run in a folder"
                )
        return cls.of(shards)

    @classmethod
    def joined(cls, several: Iterable["Streamed[Clips]"]) -> "Streamed[Clips]":
        """All clips of several, in their order."""
        parts = tuple(several)
        firsts = accumulate((len(part.shards) for part in parts), initial=0)
        places = [
            part.places + torch.tensor([first, 0])
            for part, first in zip(parts, firsts, strict=False)
        ]
        return Streamed(tuple(s for part in parts for s in part.shards), torch.cat(places))

    def __len__(self) -> int:
        """How many clips there are."""
        return len(self.places)

    def take(self, index: Index) -> Clips:
        """Copies of some clips, in the order of the index."""
        places = self.places[index]
        if self.fitted is None:
            return gathered(self.shards, places)
        clips = (gathered(self.shards, place[None]) for place in places)
        return concatenated(map(self.fitted, clips), "B")

    def only(self, index: Index) -> "Streamed[Clips]":
        """Some of the clips, without copying them."""
        return replace(self, places=self.places[index])

    def each(self, of: Callable[[Clips], Tensor]) -> Shaped[Tensor, "B ..."]:
        """A value for every clip, from a function that computes it for all clips of a shard."""
        told = {n: of(self.shards[n]) for n in self.places[:, 0].unique().tolist()}
        return torch.stack([told[number][row] for number, row in self.places.tolist()])


def _shapes(shard: Bundle) -> list[torch.Size]:
    """Shapes of the tensors of a clip."""
    return [value.shape[1:] for value in vars(shard).values() if isinstance(value, Tensor)]
