"""What is scored: one clip of a data set, its noisy twin, and where both come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from geneoh.sequence.sequence import Sequence


@dataclass(frozen=True)
class Case:
    """One noisy clip to clean, with the clip it was made from where that is known.

    `clean` is None where a data set has no ground truth (real noise): such a case is scored by
    plausibility alone. `seed` is the one its noise was drawn with.
    """

    dataset: str
    clip: str
    noise: str
    seed: int
    clean: Sequence | None
    noisy: Sequence


@runtime_checkable
class Pending(Protocol):
    """A case that is known by name and read where it is needed."""

    @property
    def dataset(self) -> str:
        """Name of the data set."""
        ...

    @property
    def clip(self) -> str:
        """Name of the clip."""
        ...

    @property
    def noise(self) -> str:
        """Name of the noise."""
        ...

    @property
    def seed(self) -> int:
        """Of the noise, and of the cleaner."""
        ...

    def load(self) -> Case:
        """Read the clip and its noisy twin."""
        ...
