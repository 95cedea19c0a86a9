"""The expected error of a cleaned track's keypoints, from how much its samples disagree."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.candidate_corrections import filter_kernels
from geneoh.sequence.windows import blocks, widened

SCALE = 1.5
"""Ratio of the expected error to the deviation over samples, found by `tools.calibrate_spread`. It
is above 1 because samples differ where the network is unsure, not where all of them are wrong."""
ALONE = 3.0
"""By how much the expected error of a hand that is cleaned by itself is larger: samples that see no
surface agree on a place that they do not know. With it 87 to 98% of the true keypoints of made
clips are in the 90% radius, by noise, and 51% under a camera's."""
LASTING = 10.0
"""Standard deviation in frames of the Gaussian filter on the samples' differences. Differences that
change from frame to frame cancel in the mean of the samples and are left out."""

REACH = 150
"""Frames from which on the filter's weight is zero in float32."""


def joint_spread(
    samples: Float[Tensor, "S T 21 3"],
    scale: float = SCALE,
    *,
    alone: Float[Tensor, " T"] | None = None,
) -> Float[Tensor, "T 21"]:
    """`HandTrack.joint_spread` of the samples' mean, metres.

    Args:
        samples: keypoints in metres of two samples or more.
        scale: ratio of the expected error to the deviation over the samples.
        alone: share, 0 to 1, by which each frame was cleaned without the object; none by default.
    """
    found, frames = [], samples.shape[1]
    for block in blocks(frames):
        wide, inner = widened(block, REACH, frames)
        near = samples[:, wide]
        kernel = filter_kernels(near.new_ones(1, near.shape[1]), (LASTING,))[0, 0, inner]
        apart = torch.einsum("tu,sukc->stkc", kernel, near - near.mean(0))
        found.append(scale * (apart.square().sum((0, -1)) / (len(samples) - 1)).sqrt())
    spread = torch.cat(found)
    return spread if alone is None else spread * (1 + (ALONE - 1) * alone)[:, None]
