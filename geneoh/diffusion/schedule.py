"""Noise schedules as plain tensors of noise-to-signal ratios.

Everywhere in geneoh a diffused sample is kept as x_n / sqrt(abar_n) = x_0 + sigma_n * eps, which is
eq. (6) of the paper divided by its signal scale, so sigma has the unit of the data and is relative
to data of unit variance here: sigma_n = sqrt((1 - abar_n) / abar_n).
"""

from functools import cache

import torch
from jaxtyping import Float
from torch import Tensor

PAPER_STEPS = 1000
NOISIEST, CLEAREST = 992, 7
"""Levels of `cosine_sigmas` beyond which answers hardly change: noise of 80, with which Karras et
al. 2022 start, and of 0.02."""
COSINE_OFFSET = 0.008  # of the cosine schedule, against steps of hardly any noise


def linear_sigmas(
    steps: int = PAPER_STEPS, first: float = 1e-4, last: float = 0.02
) -> Float[Tensor, " N"]:
    """Noise-to-signal ratio of levels 0 to `steps` under linear betas (paper, appendix C.5).

    The result is float64 and increasing, with 0 at level 0; level n has seen betas 1 to n.
    """
    betas = torch.linspace(first, last, steps, dtype=torch.float64)
    signal = torch.cat([torch.ones(1, dtype=torch.float64), (1 - betas).cumprod(0)])
    return ((1 - signal) / signal).sqrt()


def cosine_sigmas() -> Float[Tensor, " N"]:
    """The same under the cosine schedule, with betas of at most 0.999.

    Source: Nichol and Dhariwal 2021, eq. (17); Text2HOI diffuses with it.
    """
    time = torch.linspace(0, 1, PAPER_STEPS + 1, dtype=torch.float64)
    signal = torch.cos((time + COSINE_OFFSET) / (1 + COSINE_OFFSET) * torch.pi / 2).square()
    kept = (signal[1:] / signal[:-1]).clamp(min=1e-3).cumprod(0)
    signal = torch.cat([torch.ones(1, dtype=torch.float64), kept])
    return ((1 - signal) / signal).sqrt()


@cache
def cosine_levels(device: torch.device) -> Float[Tensor, " N"]:
    """`cosine_sigmas` of all levels in single precision, kept on a device."""
    return cosine_sigmas().float().to(device)


def descending_sigmas(
    level: int, steps: int, sigmas: Float[Tensor, " N"] | None = None
) -> Float[Tensor, " M"]:
    """Noise levels of a sampler from `level` (at most PAPER_STEPS) to 0 in `steps` even steps.

    They are for unit variance; `level` steps visit every level, as in the paper, and so do more.
    `sigmas` are those of all levels, `linear_sigmas` where they are not given.
    """
    sigmas = linear_sigmas() if sigmas is None else sigmas
    levels = torch.linspace(level, 0, min(steps, level) + 1, dtype=torch.float64).round().long()
    return sigmas[levels].to(torch.float32)


def logarithmic_sigmas(steps: int, sigmas: Float[Tensor, " N"]) -> Float[Tensor, " M"]:
    """Noise levels of a sampler from `NOISIEST` to `CLEAREST`, even in their logarithm, and then 0.

    It asks a network `steps` times; `sigmas` are the noise of all levels of that.
    """
    most, least = (float(sigmas[level].log10()) for level in (NOISIEST, CLEAREST))
    levels = torch.logspace(most, least, steps, dtype=torch.float64)
    return torch.cat([levels, torch.zeros(1, dtype=torch.float64)]).to(torch.float32)
