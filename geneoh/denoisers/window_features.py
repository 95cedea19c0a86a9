"""What MotionDiff and SpatialDiff in the paper's form read of a window beside the noisy sample."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.candidate_corrections import SMOOTHING_FRAMES, filter_kernels

VERSIONS = 1 + len(SMOOTHING_FRAMES)
"""Versions of a sample in `with_low_passed`."""
TYPICAL_DEVIATION = 0.035
"""Deviation of the keypoints in a typical window of a real hand, metres."""


def with_low_passed(values: Float[Tensor, "B T C"]) -> Float[Tensor, "B T K C"]:
    """A sample, and the same under low-pass filters over time (`SMOOTHING_FRAMES`)."""
    kernels = filter_kernels(torch.ones_like(values[:1, :, 0]), SMOOTHING_FRAMES)
    each = values[:, None]
    return torch.cat([each, kernels @ each], dim=1).transpose(1, 2)


def window_size(deviation: Float[Tensor, " B"], frames: int) -> Float[Tensor, "B T 1"]:
    """The deviation of each window (metres) as a feature of each frame, near zero."""
    size = (deviation / TYPICAL_DEVIATION).log()
    return size[:, None, None].expand(-1, frames, 1)
