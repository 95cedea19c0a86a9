"""Distributions of quantities of hands and their motion, to compare two sources of clips."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from scipy.stats import ks_2samp
from torch import Tensor

from geneoh.hand.skeleton import KEYPOINT_FINGERS
from geneoh.metrics.smoothness import finite_difference

ANGLES = tuple(
    f"{finger} {angle}"
    for finger in KEYPOINT_FINGERS
    for angle in ("base flexion", "middle flexion", "end flexion", "spread")
)
"""Names of the angles of `joint_angles`, in order."""
WRIST, INDEX, PINKY = 0, 5, 17  # keypoints of the palm: the wrist and the bases of two fingers


@dataclass(frozen=True)
class Quantiles:
    """The 5%, 50% and 95% quantiles of a distribution."""

    low: float
    median: float
    high: float


def quantiles(values: Float[Tensor, " N"]) -> Quantiles:
    """Quantiles of a sample, linearly interpolated; NaN if it is empty."""
    if not len(values):
        return Quantiles(*(float("nan"),) * 3)
    return Quantiles(*np.quantile(values.double().numpy(force=True), (0.05, 0.5, 0.95)).tolist())


def ks_distance(first: Float[Tensor, " N"], second: Float[Tensor, " M"]) -> float:
    """Kolmogorov-Smirnov statistic of two samples: 0 for equal distributions, 1 for disjoint ones.

    NaN if a sample is empty.
    """
    if not len(first) or not len(second):
        return float("nan")
    one, other = (values.double().numpy(force=True) for values in (first, second))
    # The p-value is not used; its exact computation would take minutes on samples of this size.
    statistic, _ = ks_2samp(one, other, method="asymp")
    return float(statistic)  # pyright: ignore[reportArgumentType]  # scipy gives no types


def motion_size(
    points: Float[Tensor, "*B T P 3"], fps: float, order: int
) -> Float[Tensor, "*B L P"]:
    """Norm of each point's velocity (order 1, m/s) or acceleration (order 2, m/s²)."""
    return finite_difference(points, order).norm(dim=-1) * fps**order


def joint_angles(joints: Float[Tensor, "*B 21 3"]) -> Float[Tensor, "*B 20"]:
    """Joint angles computed from keypoints alone, in radians, in the order of `ANGLES`.

    Flexion is the angle between a bone and its parent, zero for a straight finger; the first bone
    goes from the wrist to the base. Spread is the signed angle about the palm's normal between the
    finger's first two bones, positive towards the little finger.
    """
    chains = joints[..., 1:, :].unflatten(-2, (5, 4))
    wrist = joints[..., None, None, WRIST, :].expand(*chains.shape[:-2], 1, 3)
    bones = torch.cat([wrist, chains], dim=-2).diff(dim=-2)
    first, second = bones[..., :-1, :], bones[..., 1:, :]
    across = torch.linalg.cross(first, second).norm(dim=-1)
    flexion = torch.atan2(across, (first * second).sum(-1))
    normal = palm_basis(joints)[..., None, :, 2]
    flat = bones - (bones * normal[..., None, :]).sum(-1, keepdim=True) * normal[..., None, :]
    base, next_bone = flat[..., 0, :], flat[..., 1, :]
    turn = (torch.linalg.cross(base, next_bone) * normal).sum(-1)
    spread = torch.atan2(turn, (base * next_bone).sum(-1))
    return torch.cat([flexion, spread[..., None]], dim=-1).flatten(-2)


def correlations(values: Float[Tensor, "N D"]) -> Float[Tensor, " K"]:
    """Correlation coefficient of each pair of columns: (1, 2), (1, 3) and so on; 0 for NaN."""
    matrix = torch.corrcoef(values.double().T).nan_to_num()
    a, b = torch.triu_indices(values.shape[1], values.shape[1], 1)
    return matrix[a, b].float()


def palm_basis(joints: Float[Tensor, "*B 21 3"]) -> Float[Tensor, "*B 3 3"]:
    """Palm axes of each frame as columns: to the index finger's base, across, palm normal."""
    index = joints[..., INDEX, :] - joints[..., WRIST, :]
    pinky = joints[..., PINKY, :] - joints[..., WRIST, :]
    normal = torch.linalg.cross(index, pinky)
    axes = [index, torch.linalg.cross(normal, index), normal]
    return torch.stack([torch.nn.functional.normalize(axis, dim=-1) for axis in axes], dim=-1)
