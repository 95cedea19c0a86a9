"""Scores of rows of clips over repetitions: by the classifier's features, and by measures of clips.

Each repetition splits the conditions randomly into two halves: a row is scored by its clips for the
first half, and their Fréchet distance is to the real clips of the second. The real clips therefore
also have a Fréchet distance, between their halves, which is the best that a row can expect.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.evaluation.generation.measures import ClipMeasures
from geneoh.evaluation.scores import Measure
from geneoh.metrics.features import (
    Interval,
    diversity,
    frechet_distance,
    interval,
    multimodality,
    top_accuracy,
)
from geneoh.seeds import seeded_generator

TOP = 3  # the k of the top-k accuracy (paper)
REPETITIONS = 20  # random splits of the conditions (paper: 20 experiments)
CLIPS = 256  # held-out clips that are scored unless the user limits them
REAL = "real"  # name of the row of real clips


OF_FEATURES = (
    Measure("accuracy", "top-3", "%", "more", "clips whose verb is among the classifier's best 3"),
    Measure("fid", "FID", "", "less", "Fréchet distance of the features to those of real clips", 3),
    Measure("diversity", "div.", "", "as real", "mean distance of 200 random pairs of features", 2),
    Measure("multimodality", "mm.", "", "as real", "the same of 20 pairs with each verb", 2),
)
OF_CLIPS = (
    Measure("realism", "realism", "%", "more", "frames in which contacts can carry the object"),
    Measure("moved_alone", "alone", "%", "less", "moving frames with no keypoint within 2 cm"),
    Measure("depth_mm", "depth", "mm", "less", "depth of each frame's deepest vertex, mean", 2),
    Measure("deepest_mm", "deepest", "mm", "less", "the same, largest of a clip"),
    Measure("contact", "contact", "%", "as real", "frames with skin at most 5 mm off the object"),
    Measure(
        "acceleration_mm", "accel.", "mm/f²", "as real", "mean acceleration of the keypoints", 2
    ),
)
MEASURES = (*OF_FEATURES, *OF_CLIPS)


@dataclass(frozen=True)
class ClipFeatures(Bundle):
    """Features of B clips of a row."""

    features: Float[Tensor, "B F"]


@dataclass(frozen=True)
class ScoredClips(ClipFeatures):
    """Features, scores and measures of B clips of a row."""

    verb: Int[Tensor, " B"]  # verb of the condition
    scores: Float[Tensor, "B C"]  # classifier score of each verb
    measures: ClipMeasures


@dataclass(frozen=True)
class RowScores:
    """A row of the table: every measure in every repetition."""

    values: dict[str, list[float]]

    @property
    def cells(self) -> dict[str, Interval]:
        """Mean over the repetitions, and its 95% interval with respect to the choice of clips."""
        return {key: interval(torch.tensor(values)) for key, values in self.values.items()}


Scored = TypeVar("Scored", bound=ClipFeatures)


def repeat(
    rows: Mapping[str, Scored],
    *,
    seed: int,
    repetitions: int,
    scores: Mapping[str, Callable[[Scored, Scored, torch.Generator], float]],
) -> dict[str, RowScores]:
    """The scores of all rows over repetitions.

    The first row holds the real clips; every row has one clip per condition, in the same order.
    """
    real = next(iter(rows.values()))
    values = {name: {key: [] for key in scores} for name in rows}
    for number in range(repetitions):
        order = torch.randperm(len(real.features), generator=_drawn(seed, number))
        other, own = order.tensor_split(2)
        for name, row in rows.items():
            part = row.take(own, "B")
            for measure, score in scores.items():
                value = score(part, real.take(other, "B"), _drawn(seed, number, measure))
                values[name][measure].append(value)
    return {name: RowScores(found) for name, found in values.items()}


def mean_scores(tables: Sequence[Mapping[str, RowScores]]) -> dict[str, RowScores]:
    """The mean of tables with the same rows and repetitions, one per classifier."""

    def mean(name: str, key: str) -> list[float]:
        found = [table[name].values[key] for table in tables]
        return torch.tensor(found, dtype=torch.float64).mean(0).tolist()

    return {
        name: RowScores({key: mean(name, key) for key in row.values})
        for name, row in tables[0].items()
    }


def _drawn(*parts: object) -> torch.Generator:
    return seeded_generator("generation", *parts)


Score = Callable[[ScoredClips, ScoredClips, torch.Generator], float]
"""A score as a function of clips, other real clips, and a generator for random pairs."""


def _mean(measure: Measure) -> Score:
    """The mean of a measure over the clips in which it is not NaN; shares as percentages."""
    scale = 100.0 if measure.unit == "%" else 1.0
    return lambda part, _, __: scale * float(getattr(part.measures, measure.key).nanmean())


SCORES: dict[str, Score] = {
    "accuracy": lambda part, _, __: 100 * top_accuracy(part.scores, part.verb, TOP),
    "fid": lambda part, other, _: frechet_distance(other.features, part.features),
    "diversity": lambda part, _, drawn: diversity(part.features, generator=drawn),
    "multimodality": lambda part, _, drawn: multimodality(
        part.features, part.verb, generator=drawn
    ),
    **{measure.key: _mean(measure) for measure in OF_CLIPS},
}
"""The function of each measure of the table, by its key."""
