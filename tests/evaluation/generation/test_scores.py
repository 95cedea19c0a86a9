import math
from dataclasses import fields

import pytest
import torch

from geneoh.evaluation.generation.measures import ClipMeasures
from geneoh.evaluation.generation.scores import (
    MEASURES,
    SCORES,
    RowScores,
    ScoredClips,
    mean_scores,
    repeat,
)


def scored(features: torch.Tensor, verb: torch.Tensor, **measures: float) -> ScoredClips:
    """Clips whose scores are best for the verb; measures are the same for all."""
    count = len(verb)
    values = {f.name: torch.full((count,), measures.get(f.name, 1.0)) for f in fields(ClipMeasures)}
    answers = torch.nn.functional.one_hot(verb, 13).float()
    return ScoredClips(features, verb, answers, ClipMeasures(**values))


def drawn(count: int = 400, shift: float = 0.0, seed: int = 0) -> torch.Tensor:
    return shift + torch.randn(count, 3, generator=torch.Generator().manual_seed(seed))


VERBS = torch.arange(400) % 4


def test_every_column_of_the_table_has_a_score():
    assert [measure.key for measure in MEASURES] == list(SCORES)


def test_shifted_row_is_as_far_as_the_shift_and_real_clips_near():
    real, other = scored(drawn(), VERBS), scored(drawn(shift=2.0, seed=1), VERBS)
    found = repeat({"real": real, "shifted": other}, seed=0, repetitions=5, scores=SCORES)
    assert found["real"].cells["fid"].mean < 0.1
    assert found["shifted"].cells["fid"].mean == pytest.approx(12, rel=0.1)
    assert len(found["real"].values["fid"]) == 5


def test_shares_are_percentages_and_depths_millimetres():
    real = scored(drawn(), VERBS, realism=0.5, depth_mm=2.0, moved_alone=math.nan)
    cells = repeat({"real": real}, seed=0, repetitions=3, scores=SCORES)["real"].cells
    assert cells["accuracy"].mean == 100
    assert cells["realism"].mean == pytest.approx(50)
    assert cells["depth_mm"].mean == pytest.approx(2)
    assert math.isnan(cells["moved_alone"].mean)


def test_one_seed_gives_the_same_scores_and_another_seed_others():
    real = scored(drawn(), VERBS)

    def once(seed: int) -> list[float]:
        return repeat({"real": real}, seed=seed, repetitions=2, scores=SCORES)["real"].values[
            "diversity"
        ]

    assert once(1) == once(1) != once(2)


def test_scores_under_several_classifiers_are_averaged_within_each_repetition():
    under = [{"a": RowScores({"fid": values})} for values in ([1.0, 2.0], [3.0, 8.0])]
    assert mean_scores(under)["a"].values == {"fid": [2.0, 5.0]}


def test_multimodality_is_less_than_diversity_where_verbs_differ():
    apart = drawn() + 5 * VERBS[:, None]
    rows = {"a": scored(apart, VERBS)}
    cells = repeat(rows, seed=0, repetitions=4, scores=SCORES)["a"].cells
    assert cells["multimodality"].mean < 0.5 * cells["diversity"].mean
