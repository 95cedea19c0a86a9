"""The expected error of a cleaned track's keypoints, from how much its samples disagree."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.candidate_corrections import filter_kernels
from geneoh.sequence.windows import blocks, widened

SCALE = 1.43
"""Ratio of the expected error to the deviation over samples, found by `tools.calibrate_spread`. It
is above 1 because samples differ where the network is unsure, not where all of them are wrong."""
LASTING = 10.0
"""Standard deviation in frames of the Gaussian filter on the samples' differences. Differences that
change from frame to frame cancel in the mean of the samples and are left out."""

REACH = 150
"""Frames from which on the filter's weight is zero in float32."""


def joint_spread(samples: Float[Tensor, "S T 21 3"], scale: float = SCALE) -> Float[Tensor, "T 21"]:
    """`HandTrack.joint_spread` of the samples' mean, metres.

    Args:
        samples: keypoints in metres of two samples or more.
        scale: ratio of the expected error to the deviation over the samples.
    """
    found, frames = [], samples.shape[1]
    for block in blocks(frames):
        wide, inner = widened(block, REACH, frames)
        near = samples[:, wide]
        kernel = filter_kernels(near.new_ones(1, near.shape[1]), (LASTING,))[0, 0, inner]
        apart = torch.einsum("tu,sukc->stkc", kernel, near - near.mean(0))
        found.append(scale * (apart.square().sum((0, -1)) / (len(samples) - 1)).sqrt())
    return torch.cat(found)
