"""Noise schedules as plain tensors of noise-to-signal ratios.

Everywhere in geneoh a diffused sample is stored as x_n / sqrt(abar_n) = x_0 + sigma_n * eps: eq.
(6) of the paper divided by its signal scale. Sigma therefore has the unit of the data; the
schedules here are for data of unit variance: sigma_n = sqrt((1 - abar_n) / abar_n).
"""

from functools import cache

import torch
from jaxtyping import Float
from torch import Tensor

PAPER_STEPS = 1000
NOISIEST, CLEAREST = 992, 7
"""Levels of `cosine_sigmas` beyond which a network's output hardly changes: sigma 80, the largest
of Karras et al. 2022, and 0.02."""
COSINE_OFFSET = 0.008  # s of the cosine schedule, against too small betas at the first levels


def linear_sigmas(
    steps: int = PAPER_STEPS, first: float = 1e-4, last: float = 0.02
) -> Float[Tensor, " N"]:
    """Noise-to-signal ratio of levels 0 to `steps` under linear betas.

    The result is float64 and increasing, with 0 at level 0; level n has seen betas 1 to n.

    Source: paper, appendix A.2, but with the first beta of the public code; the text has 0.001.
    """
    betas = torch.linspace(first, last, steps, dtype=torch.float64)
    signal = torch.cat([torch.ones(1, dtype=torch.float64), (1 - betas).cumprod(0)])
    return ((1 - signal) / signal).sqrt()


def cosine_sigmas() -> Float[Tensor, " N"]:
    """As `linear_sigmas`, under the cosine schedule with betas of at most 0.999.

    Source: Nichol and Dhariwal 2021, eq. (17); the schedule of Text2HOI.
    """
    time = torch.linspace(0, 1, PAPER_STEPS + 1, dtype=torch.float64)
    signal = torch.cos((time + COSINE_OFFSET) / (1 + COSINE_OFFSET) * torch.pi / 2).square()
    kept = (signal[1:] / signal[:-1]).clamp(min=1e-3).cumprod(0)
    signal = torch.cat([torch.ones(1, dtype=torch.float64), kept])
    return ((1 - signal) / signal).sqrt()


@cache
def cosine_levels(device: torch.device) -> Float[Tensor, " N"]:
    """`cosine_sigmas` in float32, cached per device."""
    return cosine_sigmas().float().to(device)


def descending_sigmas(
    level: int, steps: int, sigmas: Float[Tensor, " N"] | None = None
) -> Float[Tensor, " M"]:
    """Noise levels of a sampler from `level` (at most PAPER_STEPS) to 0 in `steps` even steps.

    With `steps` of at least `level`, every level is visited once, as in the paper. `sigmas` are
    those of all levels, for data of unit variance; `linear_sigmas` by default.
    """
    sigmas = linear_sigmas() if sigmas is None else sigmas
    levels = torch.linspace(level, 0, min(steps, level) + 1, dtype=torch.float64).round().long()
    return sigmas[levels].to(torch.float32)


def logarithmic_sigmas(steps: int, sigmas: Float[Tensor, " N"]) -> Float[Tensor, " M"]:
    """Noise levels of a sampler: `steps` from `NOISIEST` to `CLEAREST`, even in log sigma, then 0.

    The sampler calls the network `steps` times; `sigmas` are those of all levels of its schedule.
    """
    most, least = (float(sigmas[level].log10()) for level in (NOISIEST, CLEAREST))
    levels = torch.logspace(most, least, steps, dtype=torch.float64)
    return torch.cat([levels, torch.zeros(1, dtype=torch.float64)]).to(torch.float32)
