"""Samplers: what a step of the reverse process makes of a sample and a model's clean one of it.

They work on any tensors and know nothing of hands. Samples and noise levels are in the same unit,
which the caller chooses so that the data are of size one. Noise is drawn on the CPU and moved, so
it is the same on every device.
"""

import itertools
import math
from collections.abc import Callable
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.progress import OnStep, steps

Model = Callable[[Tensor, float], Tensor]
"""From a noisy sample and its noise level to the clean sample."""
Step = Callable[[Tensor, Tensor, float, float], Tensor]
"""From a noisy sample, the clean one behind it, its noise level and a lower one to the sample of
that level."""
SamplerName = Literal["ancestral", "ddim", "direct"]
"""Sampler of the reverse process; "direct" is a single call on the input without added noise."""


def normal_like(x: Float[Tensor, "*S"], *, generator: torch.Generator) -> Float[Tensor, "*S"]:
    """Standard normal noise of the shape, type and device of `x`, drawn on the CPU."""
    return torch.randn(x.shape, generator=generator).to(x)


def antithetic_noise(
    x: Float[Tensor, "*S"], *, samples: int, generator: torch.Generator
) -> Float[Tensor, "*S"]:
    """Standard normal noise whose second half of the samples is the negative of the first half.

    Odd functions of it cancel in the mean. Samples lie along the first axis of `x`.
    """
    half = normal_like(x[: len(x) // samples * ((samples + 1) // 2)], generator=generator)
    return torch.cat([half, -half])[: len(x)]


def reverse_process(
    model: Model,
    x: Float[Tensor, "*S"],
    sigmas: Float[Tensor, " M"],
    step: Step,
    *,
    on_step: OnStep | None = None,
) -> Float[Tensor, "*S"]:
    """A sample of noise level sigmas[0] after the steps of a sampler have taken its noise away."""
    for sigma, after in steps([*itertools.pairwise(sigmas.double().tolist())], on_step):
        x = step(x, model(x, sigma), sigma, after)
    return x


def ancestral(generator: torch.Generator) -> Step:
    """Ancestral sampling with the paper's variance beta_n (eq. 5; Ho et al. 2020, algorithm 2).

    In the scaled form x_n / sqrt(abar_n) the posterior mean is x0 + (s'/s)^2 (x - x0) and the
    variance beta_n becomes (s^2 - s'^2) (1 + s'^2) / (1 + s^2); no noise is added in the last step.
    """

    def step(x: Tensor, clean: Tensor, sigma: float, after: float) -> Tensor:
        x = clean + (after / sigma) ** 2 * (x - clean)
        if after > 0:
            spread = ((sigma**2 - after**2) * (1 + after**2) / (1 + sigma**2)) ** 0.5
            x = x + spread * normal_like(x, generator=generator)
        return x

    return step


def ddim(x: Tensor, clean: Tensor, sigma: float, after: float) -> Tensor:
    """A step of deterministic DDIM (Song et al. 2021, eq. 12 with eta 0), the Euler method."""
    return clean + after / sigma * (x - clean)


def multistep() -> Step:
    """Deterministic DPM-Solver++(2M) (Lu et al. 2022, algorithm 2): `ddim` of second order.

    Each step also looks at how the answer has changed since the step before. Few steps of `ddim`
    leave samples too close to the mean of the data; as few of this one do not.
    """
    last: tuple[Tensor, float] | None = None

    def step(x: Tensor, clean: Tensor, sigma: float, after: float) -> Tensor:
        nonlocal last
        ahead = clean
        if after > 0:
            width = math.log(sigma / after)  # of the step, in the logarithm of the noise
            if last is not None:
                ahead = clean + width / (2 * last[1]) * (clean - last[0])
            last = clean, width
        return ddim(x, ahead, sigma, after)

    return step


def denoise_via_diffusion(
    model: Model,
    x: Float[Tensor, "*S"],
    sigmas: Float[Tensor, " M"],
    *,
    sampler: SamplerName,
    samples: int,
    generator: torch.Generator,
    noise: Float[Tensor, "*S"] | None = None,
    on_step: OnStep | None = None,
) -> Float[Tensor, "*S"]:
    """Algorithm 1 of the paper: add noise of level sigmas[0], then run the reverse process.

    Samples lie along the first axis and start from antithetic noise (see `antithetic_noise`), or
    from the standard normal `noise` that is given. The ablation "direct" is the model's answer to
    the input itself, given the level sigmas[0].
    """
    if sampler == "direct":
        clean = model(x, float(sigmas[0]))
        if on_step is not None:
            on_step(1, 1)
        return clean
    if noise is None:
        noise = antithetic_noise(x, samples=samples, generator=generator)
    step = ancestral(generator) if sampler == "ancestral" else ddim
    return reverse_process(model, x + sigmas[0] * noise, sigmas, step, on_step=on_step)
