"""Clips from noise alone, by the reverse diffusion process of both generators; their smoothing."""

from collections.abc import Callable
from typing import Literal

import torch
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from geneoh.diffusion.samplers import ancestral, multistep, normal_like, reverse_process
from geneoh.diffusion.schedule import PAPER_STEPS, descending_sigmas, logarithmic_sigmas
from geneoh.progress import OnStep

Answer = Callable[[Tensor, Float[Tensor, ""]], Tensor]
"""A denoiser: from noisy features and the index of their noise level, 0 to 1,000, to clean ones."""
Sampler = Literal["multistep", "ancestral"]
"""Sampler: "multistep", with few steps and no new noise, or "ancestral", as in the papers' code."""


def from_noise(
    answer: Answer,
    shape: tuple[int, ...],
    levels: Float[Tensor, " N"],
    *,
    sampler: Sampler,
    steps: int,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "*S"]:
    """A sample of a shape, on the device of `levels`, the noise's standard deviation at each level.

    The denoiser runs `steps` times, each time at the level nearest to the current noise.
    """

    def clean(x: Tensor, sigma: float) -> Tensor:
        return answer(x, (levels - sigma).abs().argmin().float())

    known = levels.double().cpu()
    if sampler == "multistep":
        sigmas, step = logarithmic_sigmas(steps, known), multistep()
    else:
        sigmas, step = descending_sigmas(PAPER_STEPS, steps, known), ancestral(generator)
    noise = normal_like(torch.zeros(shape, device=levels.device), generator=generator)
    return reverse_process(clean, sigmas[0] * noise, sigmas, step, on_step=on_step)


def smoothed_clips(
    clips: Float[Tensor, "B T N"], deviation: float, lengths: Int[Tensor, " B"] | None = None
) -> Float[Tensor, "B T N"]:
    """Each feature smoothed over time; `deviation` is the Gaussian's, in frames, 0 for none.

    A clip is padded with its first and last frame; frames after its length repeat the last one.
    """
    if not deviation:
        return clips
    if lengths is not None:
        frames = torch.arange(clips.shape[1], device=clips.device)
        frames = frames.minimum(lengths[:, None] - 1)
        clips = clips[torch.arange(len(clips), device=clips.device)[:, None], frames]
    smooth = gaussian_filter1d(clips.cpu().numpy(), deviation, axis=1, mode="nearest")
    return torch.from_numpy(smooth).to(clips)
