"""Mean, width and samples of a density that is known up to a factor, by importance sampling.

A stage whose unknown has few dimensions needs no chain of noise levels: places are drawn from a
wide density, weighed by the one that is asked for, and drawn again where it is large, as the levels
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
"""From M places of each item of a batch to the logarithm of their density, up to a constant."""
CAUTION = 0.05
"""How strongly shifts that are smaller than their own uncertainty are drawn to zero: they may be no
errors of the hand. On held-out made clips this halves what clean hands are moved by; ten times as
much takes back half of what is won under lasting errors."""
FLOOR = 1e-8
"""Least variance along any direction, in the square of the unit of the places."""
WIDEN = 1.2
"""A round draws from a density that is wider by this factor than what the round before found."""


@dataclass(frozen=True)
class Posterior:
    """Mean of a density and a square root of its covariance, for each item of a batch."""

    mean: Float[Tensor, "B D"]
    root: Float[Tensor, "B D D"]
    """Lower triangular."""

    def cautious(self, size: int) -> "Posterior":
        """The same width around a mean that is drawn to zero where it is smaller than the width.

        Groups of `size` numbers are scaled by z² / (z² + CAUTION), where z is the distance of their
        mean from zero in units of their own deviation.
        """
        covariance = self.root @ self.root.mT
        groups = torch.arange(self.mean.shape[-1], device=self.mean.device).view(-1, size)
        blocks = covariance[:, groups[:, :, None], groups[:, None, :]]
        means = self.mean.unflatten(-1, (-1, size))
        square = (means * torch.linalg.solve(blocks, means)).sum(-1, keepdim=True)
        return Posterior((means * square / (square + CAUTION)).flatten(1), self.root)

    def samples(self, count: int, *, generator: torch.Generator) -> Float[Tensor, "S B D"]:
        """Normal samples whose mean is exactly the mean: each has an opposite; one is the mean.

        The opposite ones are scaled so that their mean squared distance from the mean is that of
        the density: that of a few draws says little of its width.
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
    """The posterior of all W windows of a track together, of W D numbers, window by window.

    Each window was judged with its own prior around zero included. This is taken out of each; what
    is left is scaled by `fresh`, because overlapping windows see the same frames; and one normal
    prior for all windows, in which any two correlate by `agreement`, is put back.
    """
    total = each.mean.numel()
    prior_root, agreement = prior_root.double(), agreement.double()
    known = torch.cholesky_inverse(each.root.double())
    beyond, axes = torch.linalg.eigh(known - torch.linalg.inv(prior_root @ prior_root.mT))
    # along some axes a window may say less than the prior: that is nothing
    said = torch.block_diag(*(axes * (fresh * beyond.clamp(min=0))[:, None] @ axes.mT))
    toward = (
        axes * (fresh * (beyond > 0))[:, None] @ axes.mT @ known @ each.mean[..., None].double()
    )
    prior = torch.einsum("vij,vw,wkj->viwk", prior_root, agreement, prior_root)
    prior = prior.reshape(total, total)
    eye = torch.eye(total).to(prior)
    covariance = torch.linalg.solve(eye + prior @ said, prior)
    mean = covariance @ toward.reshape(total)
    covariance = 0.5 * (covariance + covariance.mT) + FLOOR * eye
    root = torch.linalg.cholesky(covariance)
    return Posterior(mean[None].to(each.mean), root[None].to(each.mean))


@dataclass(frozen=True)
class Proposal:
    """A normal density that places are drawn from."""

    mean: Float[Tensor, "B D"]
    root: Float[Tensor, "B D D"]
    count: int
    """Places drawn for each item."""

    def draw(self, generator: torch.Generator) -> Float[Tensor, "B M D"]:
        """Places of this density."""
        shape = self.mean.new_zeros(len(self.mean), self.count, self.mean.shape[-1])
        return self.mean[:, None] + normal_like(shape, generator=generator) @ self.root.mT

    def log_density(self, places: Float[Tensor, "B M D"]) -> Float[Tensor, "B M"]:
        """Logarithm of this density times its count, without the constant of the normal."""
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
    """Mean and width of a density over places around zero, which is known up to a factor.

    In each round so many places of every item are drawn where those before were probable, the first
    with the covariance whose square root is given.
    """
    start = torch.linalg.cholesky(prior_root @ prior_root.mT)
    zero = start.new_zeros(start.shape[:-1])
    upcoming = [
        Proposal(zero, WIDEN * start, places - places // 2),
        Proposal(zero, 0.4 * start, places // 2),
    ]
    used: list[Proposal] = []
    drawn, asked = zero[:, None, :][:, :0], zero[:, :0]
    found = Posterior(zero, start)
    for index in steps(range(rounds), on_step):
        new = torch.cat([proposal.draw(generator) for proposal in upcoming], dim=1)
        drawn = torch.cat([drawn, new], dim=1)
        asked = torch.cat([asked, log_density(new)], dim=1)
        used += upcoming
        mixture = torch.stack([proposal.log_density(drawn) for proposal in used]).logsumexp(0)
        share = (index + 1) / rounds  # a flatter density first: its few best places may mislead
        found = _weighed(drawn, (share * asked - mixture).softmax(1))
        upcoming = [Proposal(found.mean, WIDEN * found.root, places)]
    return found


def _weighed(places: Float[Tensor, "B M D"], weight: Float[Tensor, "B M"]) -> Posterior:
    """Mean and covariance of weighed places."""
    mean = (weight[..., None] * places).sum(1)
    apart = places - mean[:, None]
    covariance = (weight[..., None] * apart).mT @ apart
    covariance = covariance + FLOOR * torch.eye(places.shape[-1]).to(places)
    return Posterior(mean, torch.linalg.cholesky(covariance))
