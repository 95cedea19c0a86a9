"""Gaussian smoothing of synthetic motion over time."""

import torch
from jaxtyping import Float
from torch import Tensor


def smoothed_motion(values: Float[Tensor, "B T C"], deviation: float) -> Float[Tensor, "B T C"]:
    """Values smoothed over time by a Gaussian of standard deviation `deviation` (frames).

    The kernel ends at three deviations; the first and last frame are replicated beyond the ends.
    """
    reach = int(3 * deviation)
    time = torch.arange(-reach, reach + 1).to(values)
    kernel = torch.exp(-0.5 * (time / deviation) ** 2)
    kernel = (kernel / kernel.sum())[None, None]
    padded = torch.nn.functional.pad(values.mT, (reach, reach), mode="replicate")
    smooth = torch.nn.functional.conv1d(padded.flatten(0, 1)[:, None], kernel)
    return smooth.reshape(len(values), values.shape[2], -1).mT
