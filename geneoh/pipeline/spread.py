"""The expected error of a cleaned track's keypoints, from how much its samples disagree."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.candidate_corrections import filter_kernels

SCALE = 1.43
"""Ratio of the expected error to the deviation over samples, found by `tools.calibrate_spread`. It
is above 1 because samples differ where the network is unsure, not where all of them are wrong."""
LASTING = 10.0
"""Standard deviation in frames of the Gaussian filter on the samples' differences. Differences that
change from frame to frame cancel in the mean of the samples and are left out."""


def joint_spread(samples: Float[Tensor, "S T 21 3"], scale: float = SCALE) -> Float[Tensor, "T 21"]:
    """`HandTrack.joint_spread` of the samples' mean, metres.

    Args:
        samples: keypoints in metres of two samples or more.
        scale: ratio of the expected error to the deviation over the samples.
    """
    kernel = filter_kernels(samples.new_ones(1, samples.shape[1]), (LASTING,))[0, 0]
    apart = torch.einsum("tu,sukc->stkc", kernel, samples - samples.mean(0))
    return scale * (apart.square().sum((0, -1)) / (len(samples) - 1)).sqrt()
