import math

import pytest
import torch
from draws import seeded

from geneoh.metrics.features import (
    diversity,
    frechet_distance,
    interval,
    multimodality,
    retrieval,
    top_accuracy,
)


def whitened(count: int, width: int) -> torch.Tensor:
    """Vectors whose mean is exactly zero and whose covariance is exactly one."""
    drawn = torch.randn(count, width, generator=seeded(), dtype=torch.float64)
    drawn = drawn - drawn.mean(0)
    return torch.linalg.solve_triangular(
        torch.linalg.cholesky(drawn.T.cov()), drawn.T, upper=False
    ).T


def test_frechet_distance_of_equal_sets_is_zero():
    features = torch.randn(50, 8, generator=seeded())
    assert frechet_distance(features, features) == pytest.approx(0, abs=1e-9)


def test_frechet_distance_of_shifted_sets_is_the_squared_shift():
    features = torch.randn(50, 3, generator=seeded())
    shifted = features + torch.tensor([1.0, 2.0, -2.0])
    assert frechet_distance(features, shifted) == pytest.approx(9, rel=1e-5)


def test_frechet_distance_of_normal_distributions_that_share_axes():
    # (s1 - s2)^2 summed over the axes, for standard deviations s1 and s2
    base = whitened(40, 3)
    one = base * torch.tensor([1.0, 2.0, 3.0])
    other = base * torch.tensor([2.0, 2.0, 7.0])
    assert frechet_distance(one, other) == pytest.approx(1 + 16)


def test_frechet_distance_of_normal_distributions_with_other_axes():
    # of the covariances diag(4, 1) and diag(1, 4): 10 - 2 tr(diag(2, 2))
    base = whitened(40, 2)
    one, other = base * torch.tensor([2.0, 1.0]), base.flip(1) * torch.tensor([1.0, 2.0])
    assert frechet_distance(one, other) == pytest.approx(2)
    turn = torch.tensor([[0.6, -0.8], [0.8, 0.6]], dtype=torch.float64)
    assert frechet_distance(one @ turn, other @ turn) == pytest.approx(2)


def test_frechet_distance_of_fewer_clips_than_features_is_finite():
    one, other = torch.randn(2, 4, 64, generator=seeded())
    assert math.isfinite(frechet_distance(one, other))
    assert math.isnan(frechet_distance(one[:1], other))


def test_diversity_of_two_clips_is_their_distance():
    two = torch.tensor([[0.0, 0.0], [3.0, 4.0]])
    assert diversity(two, generator=seeded()) == pytest.approx(5)
    assert math.isnan(diversity(two[:1], generator=seeded()))


def test_diversity_of_a_normal_distribution_is_known():
    # the distance of two standard normal vectors of 3 numbers has the mean 4 / sqrt(pi)
    drawn = torch.randn(4000, 3, generator=seeded())
    found = diversity(drawn, generator=seeded(1), pairs=20000)
    assert found == pytest.approx(4 / math.sqrt(math.pi), rel=0.02)


def test_multimodality_is_of_pairs_with_the_same_label():
    features = torch.tensor([[0.0], [1.0], [10.0], [13.0], [100.0]])
    labels = torch.tensor([0, 0, 1, 1, 2])  # distances 1 and 3; the last label has one clip
    assert multimodality(features, labels, generator=seeded()) == pytest.approx(2)
    assert math.isnan(multimodality(features[[0, 2]], labels[[0, 2]], generator=seeded()))


def test_top_accuracy_counts_labels_among_the_best():
    scores = torch.tensor([[4.0, 3.0, 2.0, 1.0]] * 4)
    labels = torch.arange(4)
    assert [top_accuracy(scores, labels, count) for count in (1, 3, 9)] == [0.25, 0.75, 1]


def test_interval_is_of_the_mean():
    found = interval(torch.tensor([1.0, 2.0, 3.0, 4.0]))
    assert found.mean == pytest.approx(2.5)
    assert found.half == pytest.approx(1.96 * math.sqrt(5 / 3))
    assert math.isnan(interval(torch.tensor([1.0])).half)


def test_interval_over_halves_of_the_clips_holds_the_mean_of_all_clips_in_95_percent_of_cases():
    generator, held = seeded(), 0
    for _ in range(1000):
        clips = torch.randn(64, generator=generator)
        halves = torch.stack(
            [clips[torch.randperm(64, generator=generator)[:32]] for _ in range(20)]
        )
        found = interval(halves.mean(1))
        held += abs(found.mean) <= found.half
    assert held / 1000 == pytest.approx(0.94, abs=0.03)


def test_one_seed_draws_the_same_pairs_and_two_others():
    features = torch.randn(30, 4, generator=seeded())
    labels = torch.arange(30) % 3
    for draw in (
        lambda seed: diversity(features, generator=seeded(seed)),
        lambda seed: multimodality(features, labels, generator=seeded(seed)),
    ):
        assert draw(3) == draw(3) != draw(4)


def test_sentences_find_their_own_clip_in_a_pool_and_by_chance_where_nothing_is_told():
    own = whitened(96, 8)
    assert retrieval(own, own, 1, pool=32, generator=seeded()) == 1.0
    told = torch.zeros(96 * 20, 8, dtype=torch.float64)
    random = torch.randn(96 * 20, 8, generator=seeded(), dtype=torch.float64)
    found = retrieval(told, random, 3, pool=32, generator=seeded())
    assert found == pytest.approx(3 / 32, abs=0.03)
    assert math.isnan(retrieval(own[:31], own[:31], 1, pool=32, generator=seeded()))
