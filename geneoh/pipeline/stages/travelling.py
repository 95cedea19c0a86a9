"""A frame that moves with a hand that travels, as that of someone who walks.

The networks learned hands that stay within reach of one place. In a frame fixed in the world, they
pull a hand that covers metres in a window back toward the window's centre.
"""

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d
from torch import Tensor

from geneoh.sequence.windows import WINDOW

PATH_FRAMES = 15.0
"""Standard deviation of the Gaussian that smooths the hand's path, frames at 30 a second."""
WITHIN_REACH, TRAVELLING = 0.8, 1.2
"""Extent of the path in the frames of a window around each one, metres: up to the first bound the
hand stays in the given frame, from the second on its frame moves with it. Made hands that reach for
an object cover up to 0.7 m, and someone who walks 2.6 m."""


def travelled(joints: Float[Tensor, "T 21 3"], fps: float) -> Float[Tensor, "T 3"]:
    """Position of the frame that moves with a hand where it travels, from its first one, metres;
    zero for a hand that stays within reach."""
    middle, more = joints.mean(1).cpu().double().numpy(), min(WINDOW, len(joints) - 1)
    own = slice(more, more + len(middle))
    # it goes on as it begins and ends
    longer = np.pad(middle, ((more, more), (0, 0)), mode="reflect", reflect_type="odd")
    path = gaussian_filter1d(longer, PATH_FRAMES * fps / 30, axis=0, mode="nearest")
    bounds = (each(path, WINDOW + 1, axis=0) for each in (maximum_filter1d, minimum_filter1d))
    extent = np.linalg.norm(np.subtract(*bounds), axis=1)[own]
    share = ((extent - WITHIN_REACH) / (TRAVELLING - WITHIN_REACH)).clip(0, 1)
    steps = 0.5 * (share[:-1] + share[1:])[:, None] * np.diff(path[own], axis=0)
    moved = np.concatenate([np.zeros((1, 3)), steps.cumsum(0)])
    return torch.from_numpy(moved).to(joints)
