"""Random corruption to learn from: a mixture of what users' tracks suffer from, per sequence.

Offsets live on hand parameters (translation, global rotation, finger pose), as estimators err, with
some keypoint jitter on top. Sizes and time structure vary from sequence to sequence, from none at
all to worse than the paper's noises; the named noises of `geneoh.sequence.noise` are points in that
range.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

SMALLEST = (0.0005, 0.004, 0.02)
LARGEST = (0.014, 0.13, 0.6)
"""Range of the deviation of translation (m), global rotation (rad) and finger pose (rad)."""
CLEAN_SHARE = 0.1
LEFT_SIGNS = (-1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Corruption:
    """Additive parameter noise, observed frames and keypoint jitter of B sequences."""

    translation: Float[Tensor, "B T 3"]
    pose: Float[Tensor, "B T 16 3"]
    keep: Bool[Tensor, "B T"]
    jitter: Float[Tensor, "B T 21 3"]


def _correlated(
    batch: int, frames: int, correlation: Float[Tensor, " B"], *, generator: torch.Generator
) -> Float[Tensor, "B T 51"]:
    """Ornstein-Uhlenbeck noise of unit variance with the given correlation time in frames."""
    white = torch.randn(batch, frames, 51, generator=generator)
    keep = torch.exp(-1.0 / correlation)[:, None]
    steps, innovation = [white[:, 0]], (1 - keep**2).sqrt()
    for t in range(1, frames):
        steps.append(keep * steps[-1] + innovation * white[:, t])
    return torch.stack(steps, dim=1)


def _one_sided(batch: int, frames: int, *, generator: torch.Generator) -> Float[Tensor, "B T 51"]:
    """Noise with a common sign per channel: mostly a bias, as the paper's Beta noise is.

    Signs are those of a right hand, of a mirrored left one, or random.
    """
    flip = torch.tensor(LEFT_SIGNS)
    left = torch.cat([flip, -flip.repeat(16)])
    random = torch.randn(batch, 51, generator=generator).sign()
    kind = torch.rand(batch, 1, generator=generator)
    sign = torch.where(kind < 0.4, 1.0, torch.where(kind < 0.8, left, random))
    size = 0.8 + 0.15 * torch.randn(batch, frames, 51, generator=generator)
    return sign[:, None] * size.clamp(0, 1.2)


def _gaps(batch: int, frames: int, *, generator: torch.Generator) -> Bool[Tensor, "B T"]:
    """Observed frames: runs of 2 to 10 frames are lost in a third of the sequences."""
    time = torch.arange(frames)
    keep = torch.ones(batch, frames, dtype=torch.bool)
    holes = torch.randint(1, 4, (batch, 1), generator=generator)
    holes = holes * (torch.rand(batch, 1, generator=generator) < 0.33)
    for hole in range(3):
        start = torch.randint(-3, max(frames, 1), (batch, 1), generator=generator)
        length = torch.randint(2, 11, (batch, 1), generator=generator)
        lost = (time >= start) & (time < start + length) & (hole < holes)
        keep &= ~lost
    return keep | ~keep.any(1, keepdim=True)


def draw_corruption(batch: int, frames: int, *, generator: torch.Generator) -> Corruption:
    """Corruption of B sequences of T frames."""

    def uniform(*shape: int) -> Tensor:
        return torch.rand(batch, *shape, generator=generator)

    share = torch.log(uniform(1, 4).clamp(min=1e-4)) ** 2  # a few kinds dominate each sequence
    share = share / share.square().sum(-1, keepdim=True).sqrt()
    white = torch.randn(batch, frames, 51, generator=generator)
    burst = uniform(frames, 1) < 0.1 * uniform(1, 1) * (uniform(1, 1) < 0.3)
    white = torch.where(burst, white * (3 + 6 * uniform(1, 1)), white)
    correlation = torch.exp(math.log(2) + math.log(30) * uniform())
    slow = _correlated(batch, frames, correlation, generator=generator)
    bias = torch.randn(batch, 1, 51, generator=generator)
    one_sided = _one_sided(batch, frames, generator=generator)
    kinds = torch.stack([white, slow, bias.expand_as(white), one_sided], dim=-1)
    unit = (kinds * share[:, None]).sum(-1)

    low, high = torch.tensor(SMALLEST).log(), torch.tensor(LARGEST).log()
    common = uniform(1)
    size = torch.exp(low + (high - low) * (0.7 * common + 0.3 * uniform(3)))
    size = size * (uniform(1) >= CLEAN_SHARE)
    joints = (0.6 * torch.randn(batch, 15, generator=generator)).exp().clamp(max=1.5)
    noise = unit * torch.cat(
        [
            size[:, :1].expand(-1, 3),
            size[:, 1:2].expand(-1, 3),
            (size[:, 2:] * joints).repeat_interleave(3, dim=1),
        ],
        dim=-1,
    ).unsqueeze(1)
    blur = 0.006 * uniform(1, 1, 1) * (uniform(1, 1, 1) < 0.25)
    return Corruption(
        translation=noise[..., :3],
        pose=noise[..., 3:].unflatten(-1, (16, 3)),
        keep=_gaps(batch, frames, generator=generator),
        jitter=blur * torch.randn(batch, frames, 21, 3, generator=generator),
    )
