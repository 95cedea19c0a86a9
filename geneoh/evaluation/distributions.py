"""What motion and hands are described by when two sources of them are set side by side."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.metrics.smoothness import finite_difference

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
"""In the order of the keypoints."""
ANGLES = tuple(
    f"{finger} {angle}"
    for finger in FINGERS
    for angle in ("base flexion", "middle flexion", "end flexion", "spread")
)
WRIST, INDEX, PINKY = 0, 5, 17
"""Keypoints of the palm."""
LOW, HIGH = 0.05, 0.95
"""Quantiles between which most of a distribution lies."""


@dataclass(frozen=True)
class Spread:
    """A distribution in three numbers."""

    low: float
    """5% lie below."""
    median: float
    high: float
    """5% lie above."""


def spread_of(values: Float[Tensor, " N"]) -> Spread:
    """Quantiles of a sample; NaN of an empty one."""
    if not len(values):
        return Spread(*(float("nan"),) * 3)
    at = torch.tensor([LOW, 0.5, HIGH], dtype=torch.float64)
    # torch's own quantile refuses more than 16 million values
    ordered = values.double().sort().values
    place = at * (len(ordered) - 1)
    below = place.floor().long()
    above = (below + 1).clamp(max=len(ordered) - 1)
    found = torch.lerp(ordered[below], ordered[above], place - below)
    return Spread(*found.tolist())


def ks_distance(first: Float[Tensor, " N"], second: Float[Tensor, " M"]) -> float:
    """Largest difference of two samples' cumulative shares: 0 for the same, 1 for apart.

    Source: Kolmogorov and Smirnov's two-sample statistic.
    """
    if not len(first) or not len(second):
        return float("nan")
    both = torch.cat([first, second]).double()
    shares = [
        torch.searchsorted(values.double().sort().values, both, right=True).double() / len(values)
        for values in (first, second)
    ]
    return float((shares[0] - shares[1]).abs().max())


def speed(points: Float[Tensor, "*B T P 3"], fps: float) -> Float[Tensor, "*B L P"]:
    """Speed of each point in metres per second."""
    return finite_difference(points, 1).norm(dim=-1) * fps


def point_acceleration(points: Float[Tensor, "*B T P 3"], fps: float) -> Float[Tensor, "*B L P"]:
    """Size of each point's acceleration in metres per second squared."""
    return finite_difference(points, 2).norm(dim=-1) * fps**2


def joint_angles(joints: Float[Tensor, "*B 21 3"]) -> Float[Tensor, "*B 20"]:
    """Angles that keypoints alone tell, in radians, named by `ANGLES`.

    Flexion is the angle between a bone and the one before it, zero for a straight finger; the
    first bone is from the wrist to the base. Spread is the angle between the finger's first two
    bones seen along the palm's normal, positive from the index finger's side to the little one's.
    """
    chains = joints[..., 1:, :].unflatten(-2, (5, 4))
    wrist = joints[..., None, None, WRIST, :].expand(*chains.shape[:-2], 1, 3)
    bones = torch.cat([wrist, chains], dim=-2).diff(dim=-2)
    first, second = bones[..., :-1, :], bones[..., 1:, :]
    across = torch.linalg.cross(first, second).norm(dim=-1)
    flexion = torch.atan2(across, (first * second).sum(-1))
    palm = joints[..., [INDEX, PINKY], :] - joints[..., WRIST, None, :]
    normal = torch.linalg.cross(palm[..., 0, :], palm[..., 1, :])
    normal = torch.nn.functional.normalize(normal, dim=-1)[..., None, :]
    base, next_bone = (
        bone - (bone * normal).sum(-1, keepdim=True) * normal
        for bone in (bones[..., 0, :], bones[..., 1, :])
    )
    turn = (torch.linalg.cross(base, next_bone) * normal).sum(-1)
    spread = torch.atan2(turn, (base * next_bone).sum(-1))
    return torch.cat([flexion, spread[..., None]], dim=-1).flatten(-2)


def correlations(values: Float[Tensor, "N D"]) -> Float[Tensor, " K"]:
    """Correlation of each pair of columns, the first with the second, the third and so on."""
    matrix = torch.corrcoef(values.double().T).nan_to_num()
    a, b = torch.triu_indices(values.shape[1], values.shape[1], 1)
    return matrix[a, b].float()
