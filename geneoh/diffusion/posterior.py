"""Mean, covariance and samples of an unnormalised density, by importance sampling.

A stage whose unknown has few dimensions needs no chain of noise levels. Points are drawn from a
wide proposal, weighted by the target density, and drawn again where it is large, much as the levels
of a diffusion narrow from the input to the clean sample (population Monte Carlo, Cappé et al.
2004).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.diffusion.samplers import normal_like
from geneoh.progress import OnStep, steps

LogDensity = Callable[[Float[Tensor, "B M D"]], Float[Tensor, "B M"]]
"""Log density, up to a constant, at M points of each batch item."""
CAUTION = 0.05
"""Shrinkage towards zero of shifts smaller than their own uncertainty, which may not be errors of
the hand. On held-out synthetic clips it halves the displacement of clean hands; ten times the value
loses half of the gain under lasting errors."""
FLOOR = 1e-8
"""Variance that is added along every direction, in the squared unit of the points."""
WIDEN = 1.2
"""Factor by which a round's proposal is wider than the density found in the previous round."""


@dataclass(frozen=True)
class Posterior:
    """Mean of a normal density and Cholesky factor of its covariance, for each batch item."""

    mean: Float[Tensor, "B D"]
    root: Float[Tensor, "B D D"]
    """Lower triangular."""

    def cautious(self, size: int) -> "Posterior":
        """The same covariance around a mean that is shrunk to zero where it is uncertain.

        Each group of `size` coordinates is scaled by z² / (z² + CAUTION), where z is the
        Mahalanobis distance of the group's mean from zero.
        """
        covariance = self.root @ self.root.mT
        groups = torch.arange(self.mean.shape[-1], device=self.mean.device).view(-1, size)
        blocks = covariance[:, groups[:, :, None], groups[:, None, :]]
        means = self.mean.unflatten(-1, (-1, size))
        square = (means * torch.linalg.solve(blocks, means)).sum(-1, keepdim=True)
        return Posterior((means * square / (square + CAUTION)).flatten(1), self.root)

    def samples(self, count: int, *, generator: torch.Generator) -> Float[Tensor, "S B D"]:
        """Antithetic normal samples, whose average is exactly the mean; one is the mean itself if
        `count` is odd.

        Deviations are scaled so that their mean squared length is the trace of the covariance,
        which a few unscaled draws would miss.
        """
        half = self.mean.new_zeros(count // 2, *self.mean.shape)
        apart = (self.root @ normal_like(half, generator=generator)[..., None])[..., 0]
        if count > 1:
            width, drawn = self.root.square().sum((-1, -2)), apart.square().sum(-1).mean(0)
            apart = apart * (width / drawn).sqrt()[:, None]
        middle = half.new_zeros(count % 2, *self.mean.shape)
        return self.mean + torch.cat([apart, -apart, middle])


def along_a_track(
    each: Posterior,
    prior_root: Float[Tensor, "W D D"],
    agreement: Float[Tensor, "W W"],
    fresh: float,
) -> Posterior:
    """The joint posterior of all W windows of a track, over W D numbers in the order of windows.

    `each` has one posterior per window, with a zero-mean prior of its own. That prior is divided
    out; the precision that is left is scaled by `fresh`, because overlapping windows share frames;
    and a joint prior is multiplied in, in which windows have the correlations `agreement`.
    """
    total = each.mean.numel()
    prior_root, agreement = prior_root.double(), agreement.double()
    known = torch.cholesky_inverse(each.root.double())
    beyond, axes = torch.linalg.eigh(known - torch.linalg.inv(prior_root @ prior_root.mT))
    # along axes where the posterior is wider than the prior, the window has no information
    precision = torch.block_diag(*(axes * (fresh * beyond.clamp(min=0))[:, None] @ axes.mT))
    toward = (
        axes * (fresh * (beyond > 0))[:, None] @ axes.mT @ known @ each.mean[..., None].double()
    )
    prior = torch.einsum("vij,vw,wkj->viwk", prior_root, agreement, prior_root)
    prior = prior.reshape(total, total)
    eye = torch.eye(total).to(prior)
    covariance = torch.linalg.solve(eye + prior @ precision, prior)
    mean = covariance @ toward.reshape(total)
    covariance = 0.5 * (covariance + covariance.mT) + FLOOR * eye
    root = torch.linalg.cholesky(covariance)
    return Posterior(mean[None].to(each.mean), root[None].to(each.mean))


@dataclass(frozen=True)
class Proposal:
    """Normal proposal density of importance sampling."""

    mean: Float[Tensor, "B D"]
    root: Float[Tensor, "B D D"]
    count: int
    """Points drawn for each batch item."""

    def draw(self, generator: torch.Generator) -> Float[Tensor, "B M D"]:
        """Points drawn from this density."""
        shape = self.mean.new_zeros(len(self.mean), self.count, self.mean.shape[-1])
        return self.mean[:, None] + normal_like(shape, generator=generator) @ self.root.mT

    def log_density(self, places: Float[Tensor, "B M D"]) -> Float[Tensor, "B M"]:
        """Log of this density times `count`, without the normal's constant."""
        apart = (places - self.mean[:, None]).mT
        unit = torch.linalg.solve_triangular(self.root, apart, upper=False)
        volume = self.root.diagonal(dim1=-2, dim2=-1).log().sum(-1)
        return math.log(self.count) - 0.5 * unit.square().sum(1) - volume[:, None]


def importance_posterior(
    log_density: LogDensity,
    prior_root: Float[Tensor, "B D D"],
    *,
    rounds: int,
    places: int,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Posterior:
    """Mean and covariance of an unnormalised density around zero.

    Each of `rounds` rounds draws `places` points per item from a normal proposal that is fitted to
    all points so far; the first proposals have zero mean and multiples of the prior's covariance.
    """
    start = torch.linalg.cholesky(prior_root @ prior_root.mT)
    zero = start.new_zeros(start.shape[:-1])
    upcoming = [
        Proposal(zero, WIDEN * start, places - places // 2),
        Proposal(zero, 0.4 * start, places // 2),
    ]
    used: list[Proposal] = []
    drawn, densities = zero[:, None, :][:, :0], zero[:, :0]
    found = Posterior(zero, start)
    for index in steps(range(rounds), on_step):
        new = torch.cat([proposal.draw(generator) for proposal in upcoming], dim=1)
        drawn = torch.cat([drawn, new], dim=1)
        densities = torch.cat([densities, log_density(new)], dim=1)
        used += upcoming
        mixture = torch.stack([proposal.log_density(drawn) for proposal in used]).logsumexp(0)
        share = (index + 1) / rounds  # a tempered density first, else few points take all weight
        found = _weighed(drawn, (share * densities - mixture).softmax(1))
        upcoming = [Proposal(found.mean, WIDEN * found.root, places)]
    return found


def _weighed(places: Float[Tensor, "B M D"], weight: Float[Tensor, "B M"]) -> Posterior:
    """Mean and covariance of weighted points."""
    mean = (weight[..., None] * places).sum(1)
    apart = places - mean[:, None]
    covariance = (weight[..., None] * apart).mT @ apart
    covariance = covariance + FLOOR * torch.eye(places.shape[-1]).to(places)
    return Posterior(mean, torch.linalg.cholesky(covariance))
