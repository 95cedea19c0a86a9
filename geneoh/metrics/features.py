"""Scores of sets of feature vectors, by which generated clips are compared with real ones.

Features are embeddings of N clips by an action classifier, with D dimensions; labels are its
classes. All sums are in double precision.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

PAIRS = 200  # random pairs of the diversity (MDM, Tevet et al. 2023)
LABEL_PAIRS = 20  # random pairs of each label of the multimodality (Action2Motion, Guo et al. 2020)
NORMAL_95 = 1.96  # standard errors to either side of a mean that hold it in 95% of cases


@dataclass(frozen=True)
class Interval:
    """The mean of a score with its 95% interval, mean ± half."""

    mean: float
    half: float


def interval(values: Float[Tensor, " R"]) -> Interval:
    """Mean of a score over R random halves of the clips, and its 95% interval over other clips.

    The half width is NaN for R < 2. The standard deviation over halves estimates the standard error
    over other clips: a half has twice the variance of the whole set, and half of that variance
    comes from which clips were drawn. More halves do not make it smaller.
    """
    half = NORMAL_95 * values.double().std() if len(values) > 1 else torch.nan
    return Interval(float(values.double().mean()), float(half))


def frechet_distance(real: Float[Tensor, "N D"], made: Float[Tensor, "M D"]) -> float:
    """Fréchet distance of the normal distributions of two sets: zero for equal ones.

    The squared difference of the means plus tr(A + B - 2 (AB)^½), with covariances A and B. Small
    sets make it larger: compare it with the distance of two real sets of the same sizes.

    Source: Heusel et al., GANs Trained by a Two Time-Scale Update Rule, 2017, equation (6).
    """
    if min(len(real), len(made)) < 2:
        return float("nan")
    a, b = (x.double().T.cov().reshape(x.shape[1], x.shape[1]) for x in (real, made))
    values, axes = torch.linalg.eigh(a)
    root = axes * values.clamp(min=0).sqrt() @ axes.T
    # (AB)^½ and (A^½ B A^½)^½ have the same trace, and the second is symmetric
    shared = torch.linalg.eigvalsh(root @ b @ root).clamp(min=0).sqrt().sum()
    apart = (real.double().mean(0) - made.double().mean(0)).square().sum()
    return float((apart + a.trace() + b.trace() - 2 * shared).clamp(min=0))


def diversity(
    features: Float[Tensor, "N D"], *, generator: torch.Generator, pairs: int = PAIRS
) -> float:
    """Mean distance of random pairs of different clips; NaN for fewer than two clips."""
    count = len(features)
    if count < 2:
        return float("nan")
    first = torch.randint(count, (pairs,), generator=generator)
    second = first + torch.randint(1, count, (pairs,), generator=generator)
    one, other = (features[at.to(features.device) % count] for at in (first, second))
    return float((one - other).double().norm(dim=-1).mean())


def multimodality(
    features: Float[Tensor, "N D"], labels: Int[Tensor, " N"], *, generator: torch.Generator
) -> float:
    """Mean over labels of the mean distance of random pairs with that label.

    Labels with a single clip do not count; NaN where all labels are such.
    """
    groups = [features[labels == label] for label in labels.unique()]
    found = [
        diversity(each, generator=generator, pairs=LABEL_PAIRS) for each in groups if len(each) > 1
    ]
    return float(torch.tensor(found, dtype=torch.float64).mean())


def top_accuracy(scores: Float[Tensor, "N C"], labels: Int[Tensor, " N"], count: int) -> float:
    """Share of the clips whose label is among the `count` classes with the highest scores."""
    best = scores.topk(min(count, scores.shape[1]), dim=-1).indices
    return float((best == labels[:, None]).any(-1).double().mean())


def retrieval(
    texts: Float[Tensor, "N D"],
    features: Float[Tensor, "N D"],
    count: int,
    *,
    pool: int,
    generator: torch.Generator,
) -> float:
    """R-precision: share of `texts` whose clip is among the `count` nearest of its pool.

    Clips are divided at random into pools of size `pool`; a remainder is left out. NaN for fewer
    clips than one pool. Chance level is `count` / `pool`.

    Source: Guo et al., Generating Diverse and Natural 3D Human Motions from Text, 2022.
    """
    pools = len(texts) // pool
    order = torch.randperm(len(texts), generator=generator)[: pools * pool].view(pools, pool)
    if not pools:
        return float("nan")
    apart = torch.cdist(texts[order].double(), features[order].double())
    right = torch.arange(pool).repeat(pools)
    return top_accuracy(-apart.flatten(0, 1), right, count)
