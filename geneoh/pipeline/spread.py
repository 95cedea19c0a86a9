"""Uncertainty: the expected error of cleaned keypoints, from the spread of the samples."""

import torch
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt
from torch import Tensor

from geneoh.denoisers.candidate_corrections import filter_kernels
from geneoh.sequence.normalisation import NETWORK_FPS
from geneoh.sequence.windows import blocks, widened

ERROR_RATIO = 1.5
"""Ratio of the expected error to the standard deviation over samples, from
`tools.calibrate_spread`. It is above 1 because errors that all samples share do not spread them."""
CHANGED, UNCHANGED_SHARE = 0.005, 0.02
"""Mean distance over the keypoints from input to result, metres, at which about half of the
variance over samples counts, from `tools.calibrate_spread`; and the share that counts where the
result is the input. Samples show all places at which contact could be, but a calm hand that already
is at one of them is seldom wrong."""
ALONE = 3.0
"""Factor on the expected error of a hand that is cleaned without the object, whose samples share
the unknown error of position. With it, 87 to 98% of the true keypoints of synthetic clips are in
the 90% radius, depending on the noise, and 51% under camera noise."""
LOST = 2.0
"""Growth of the expected error by each second to the nearest frame in which the hand was observed,
as a share: samples agree on a likely path, which the hand need not have taken. From
`tools.calibrate_spread lost`."""
DIFFERENCE_FILTER = 10.0
"""Standard deviation in frames of the Gaussian filter on the samples' differences. Differences that
change from frame to frame cancel in the mean of the samples and are left out."""

FILTER_END = 150
"""Frames beyond which the filter's weight is zero in float32."""


def joint_spread(
    samples: Float[Tensor, "S T 21 3"],
    scale: float = ERROR_RATIO,
    *,
    given: Float[Tensor, "T 21 3"] | None = None,
    changed: float = CHANGED,
    alone: Float[Tensor, " T"] | None = None,
    observed: Bool[Tensor, " T"] | None = None,
) -> Float[Tensor, "T 21"]:
    """`HandTrack.joint_spread` of the samples' mean, metres.

    Args:
        samples: keypoints of at least two samples, metres.
        scale: ratio of the expected error to the standard deviation over the samples.
        given: keypoints of the input, metres; without them all of the variance counts.
        changed: mean change from `given` at which half of the variance counts, metres.
        alone: share, 0 to 1, by which each frame was cleaned without the object; 0 by default.
        observed: frames in which the hand was observed; all by default.
    """
    frames = samples.shape[1]
    alone = samples.new_zeros(frames) if alone is None else alone
    seen = torch.ones_like(alone) if observed is None else observed.to(samples)
    found = []
    for block in blocks(frames):
        wide, inner = widened(block, FILTER_END, frames)
        near = samples[:, wide]
        mean, weights = near.mean(0), torch.stack([torch.ones_like(seen[wide]), seen[wide]])
        all_frames, seen_frames = filter_kernels(weights, (DIFFERENCE_FILTER,))[:, 0, inner]
        apart = torch.einsum("tu,sukc->stkc", all_frames, near - mean)
        spread = scale * (apart.square().sum((0, -1)) / (len(samples) - 1)).sqrt()
        if given is not None:
            change = seen_frames @ (mean - given[wide]).norm(dim=-1).mean(-1)
            share = variance_share(change, changed)
            # a frame that was filled in, or cleaned by itself, says nothing about contact
            rest = seen[block] * (1 - alone[block]) * (1 - share)
            spread = spread * (1 - rest).sqrt()[:, None]
        found.append(spread)
    spread = torch.cat(found) * (1 + (ALONE - 1) * alone)[:, None]
    if observed is not None:
        spread = spread * (1 + LOST * seconds_lost(observed).to(spread))[:, None]
    return spread


def variance_share(change: Float[Tensor, "*N"], changed: float) -> Float[Tensor, "*N"]:
    """Share of the variance over samples that counts, by the change from input to result, and by
    the one at which half of the variance counts, metres."""
    share = change.square() / (change.square() + changed**2)
    return UNCHANGED_SHARE + (1 - UNCHANGED_SHARE) * share


def seconds_lost(observed: Bool[Tensor, " T"]) -> Float[Tensor, " T"]:
    """Time from each frame to the nearest observed one, of which there is one, seconds."""
    frames = distance_transform_edt(~observed.cpu().numpy())
    return torch.from_numpy(frames).float() / NETWORK_FPS
