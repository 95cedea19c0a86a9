"""A hand that does not fit its object even after it was cleaned against it."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np


@dataclass(frozen=True)
class Misfit(ABC):
    """How badly a hand fits the object that it was cleaned against."""

    size: float
    """Metres."""
    bounds: ClassVar[tuple[float, float]]
    """Sizes in metres: up to the first the object is relied on, from the second on it is not."""

    @property
    def evidence(self) -> float:
        """Whether the object may be relied on, 1 to 0."""
        return float(np.interp(self.size, self.bounds, (1.0, 0.0)))

    def note(self) -> Iterator[str]:
        """A sentence for the user if the object is not fully relied on."""
        if self.evidence < 1:
            mostly = "mostly " if self.evidence > 0 else ""
            yield self.sentence(f"the hand is cleaned {mostly}by the prior of hand motion alone")

    @abstractmethod
    def sentence(self, consequence: str) -> str:
        """What does not fit, with its consequence and the remedy."""
