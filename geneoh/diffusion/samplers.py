"""Samplers: steps of the reverse process, from a noisy sample and the model's clean estimate of it.

They work on any tensors. Samples and noise levels are in the same unit, which the caller chooses so
that the data have about unit variance. Noise is drawn on the CPU and moved, so it is the same on
every device.
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
"""From a noisy sample and its noise level to an estimate of the clean sample."""
Step = Callable[[Tensor, Tensor, float, float], Tensor]
"""From a noisy sample, the model's clean estimate of it, its noise level and the next lower level
to the sample at that lower level."""
SamplerName = Literal["ancestral", "ddim", "direct"]
"""Sampler of the reverse process; "direct" is a single call on the input without added noise."""


def normal_like(x: Float[Tensor, "*S"], *, generator: torch.Generator) -> Float[Tensor, "*S"]:
    """Standard normal noise of the shape, type and device of `x`, drawn on the CPU."""
    return torch.randn(x.shape, generator=generator).to(x)


def antithetic_noise(
    x: Float[Tensor, "*S"], *, samples: int, generator: torch.Generator
) -> Float[Tensor, "*S"]:
    """Standard normal noise: the second half of the samples has the negated noise of the first.

    Odd functions of the noise cancel in the mean. Samples lie along the first axis of `x`.
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
    """The clean sample: `x`, of noise level sigmas[0], after all steps of a sampler."""
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

    Each step extrapolates the change of the clean estimate since the previous step. With few steps,
    `ddim` leaves samples too close to the mean of the data; this solver does not.
    """
    last: tuple[Tensor, float] | None = None

    def step(x: Tensor, clean: Tensor, sigma: float, after: float) -> Tensor:
        nonlocal last
        ahead = clean
        if after > 0:
            width = math.log(sigma / after)  # step size in log sigma
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

    Samples lie along the first axis and start from the standard normal `noise`, or from
    `antithetic_noise` if it is None. "direct", an ablation, is a single call of the model on the
    input without added noise, at level sigmas[0].
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
