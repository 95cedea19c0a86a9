"""How far off an answer's keypoints may be, from how much the samples disagree."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.candidate_corrections import filter_kernels

SCALE = 2.48
"""Samples tell what a network does not know, not where it is wrong: answers are off by so many
times the deviation over samples. See `python -m tools.calibrate_spread`."""
LASTING = 10.0
"""Deviation in frames of the Gaussian filter that disagreement has to pass: what comes and goes
between frames is gone from the mean of the samples as well."""


def joint_spread(samples: Float[Tensor, "S T 21 3"], scale: float = SCALE) -> Float[Tensor, "T 21"]:
    """Root mean square distance in metres that the answer's keypoints are expected to be off by.

    Args:
        samples: keypoints of two samples or more.
        scale: what the deviation of their lasting disagreement is multiplied by.
    """
    kernel = filter_kernels(samples.new_ones(1, samples.shape[1]), (LASTING,))[0, 0]
    apart = torch.einsum("tu,sukc->stkc", kernel, samples - samples.mean(0))
    return scale * (apart.square().sum((0, -1)) / (len(samples) - 1)).sqrt()
