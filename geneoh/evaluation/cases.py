"""What is scored: one clip of a data set, its noisy twin, and where both come from."""

from __future__ import annotations

from dataclasses import dataclass

from geneoh.sequence.tracks import Sequence


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
