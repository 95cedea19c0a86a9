"""Distance from the ground truth per frame: keypoints, vertices, calibration of the spread."""

import math

from jaxtyping import Float
from torch import Tensor


def mpjpe(
    joints: Float[Tensor, "*B T 21 3"], truth: Float[Tensor, "*#B T 21 3"]
) -> Float[Tensor, "*B T"]:
    """Mean per-joint position error of each frame, metres, in the world frame without alignment.

    NaN in frames whose keypoints are NaN. Source: GeneOH Diffusion, C.2.
    """
    return (joints - truth).norm(dim=-1).mean(-1)


def mpvpe(
    verts: Float[Tensor, "*B T V 3"], truth: Float[Tensor, "*#B T V 3"]
) -> Float[Tensor, "*B T"]:
    """Mean per-vertex position error of each frame, metres. Source: GeneOH Diffusion, C.2."""
    return (verts - truth).norm(dim=-1).mean(-1)


RADIUS_90 = math.sqrt(6.2514 / 3)
"""Radius that holds 90% of an isotropic normal distribution in space, in units of the root of its
mean square distance: 6.2514 is the 90% point of chi-square with three degrees of freedom."""


def within_spread(
    joints: Float[Tensor, "*B T 21 3"],
    truth: Float[Tensor, "*#B T 21 3"],
    spread: Float[Tensor, "*#B T 21"],
) -> Float[Tensor, "*B T"]:
    """Share of each frame's keypoints whose truth lies in the 90% radius; 0.9 if calibrated.

    `spread` is the expected error of the keypoints (`HandTrack.joint_spread`); all in metres.
    """
    return ((joints - truth).norm(dim=-1) <= RADIUS_90 * spread).to(joints).mean(-1)
