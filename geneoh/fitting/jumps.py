"""Jumps of a fitted hand where it changes the side by which it leaves the object or another hand.

The surface terms of the fit choose a way out in each frame. Where that changes from one frame to
the next, the hand jumps by as much as it is deep, which is seen at once. A hand that passes through
the surface within some frames looks right.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, median_filter
from torch import Tensor

from geneoh.bundle import where
from geneoh.fitting.fit import fit_hand
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.terms import HandState
from geneoh.hand.model import ShapedHand

LARGEST_BEND = 0.014
"""Second difference over frames, metres, of a keypoint's distance from its target at which the fit
counts as jumping: real hands seldom accelerate so much."""
MOST_JUMPS = 0.25
"""Share of frames with jumps above which a hand stays as it is: it moves wildly all the time."""
JUMP_REACH = 4
"""Frames on either side of a jump that change."""
MEDIAN_FRAMES, CALM_FRAMES, EDGE_FRAMES = 7, 1.5, 1.0
"""Frames of the median, and standard deviations in frames of the Gaussians over the distances and
over the share of each frame that changes."""
REFIT_STEPS = 3  # of the fit to the calm keypoints


def without_jumps(
    state: HandState,
    target: Float[Tensor, "1 T 21 3"],
    shaped: ShapedHand,
    config: FitConfig,
    *,
    most: float = MOST_JUMPS,
) -> HandState:
    """A fitted hand whose keypoints keep smooth distances from their targets.

    Around a jump these distances are replaced by a smoothed median over frames, and the hand is
    fitted to keypoints there, without the object. A hand without a jump stays as it is, and so does
    one with jumps in a share of the frames that is larger than `most`.
    """
    away = state.joints(shaped) - target
    bend = away.diff(n=2, dim=1).norm(dim=-1).amax(-1)[0]
    jumps = torch.nn.functional.pad(bend > LARGEST_BEND, (1, 1)).cpu().numpy()
    if not 0 < jumps.mean() <= most:
        return state
    near = maximum_filter1d(jumps.astype(float), 2 * JUMP_REACH + 1, mode="nearest")
    share = gaussian_filter1d(near, EDGE_FRAMES, mode="nearest")
    given = away[0].cpu().numpy()
    median = median_filter(given, size=(MEDIAN_FRAMES, 1, 1), mode="nearest")
    calm = torch.from_numpy(gaussian_filter1d(median, CALM_FRAMES, axis=0, mode="nearest")).to(away)
    changed = torch.from_numpy(share).to(away)[:, None, None]
    aim = target + torch.lerp(away, calm[None], changed)
    alone = replace(config, contact_rounds=0, iterations=REFIT_STEPS)
    moved = fit_hand(aim, torch.ones_like(aim[..., 0]), shaped, state, config=alone)
    return where(changed[None, :, 0, 0] > 0, moved, state)
