"""The side of the hand that an object is at.

The networks learned hands that touch objects with palm and fingers. They pull one that carries a
tray on its back, or pushes a door with it, to the other side of what it touches.
"""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from geneoh.geometry.distance import MovingSurface
from geneoh.sequence.keypoints import palm_axes
from geneoh.sequence.windows import blocks

CLOSE = 0.02  # decay of the weight of a keypoint with its distance from the surface, metres
FEW = 0.5  # prior weight, in keypoints per frame, of a surface that faces neither side
PALM_SIDE, BACK = 0.62, 0.78
"""Mean component along the normal of the palm of the surface's outward normals: up to the first
bound the object may be held, from the second on it is at the back of the hand. Noisy hands that
hold have at most 0.55, in the convex hull of the object 0.60; with a tray on their backs at least
0.78."""


def at_palm(
    joints: Float[Tensor, "T 21 3"], surface: MovingSurface, smoothed: float, around: float
) -> Float[Tensor, " T"]:
    """Whether the object may be at the palm or the fingers of a right hand around each frame, from
    1 to 0: it is at the back of the hand. Keypoints inside of the object do not count.

    `smoothed` and `around` are the standard deviations, in frames, of the filters of keypoints and
    of what they tell.
    """
    filtered = gaussian_filter1d(joints.cpu().numpy(), smoothed, axis=0, mode="nearest")
    points = torch.from_numpy(filtered).to(joints)
    palm = -palm_axes(points[:, None])[:, None, :, 2]
    surface, found = replace(surface, within=4 * CLOSE), []
    for some in blocks(len(points)):
        query = surface.at(some).query(points[some])
        near = torch.exp(-(query.distance / CLOSE).square()) * (query.distance > 0)
        facing = (query.normal * palm[some]).sum(-1)
        found.append(torch.stack([near * facing, near], -1).nan_to_num(0.0).sum(1))
    told = torch.cat(found).cpu().double().numpy()
    facing, weight = gaussian_filter1d(told, around, axis=0, mode="constant").T
    share = np.interp(facing / (weight + FEW), (PALM_SIDE, BACK), (1.0, 0.0))
    return torch.from_numpy(share).to(joints)
