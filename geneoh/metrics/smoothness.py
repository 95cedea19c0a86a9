"""Smoothness of a hand's motion by finite differences, and means over the frames that count.

A difference of order k has L = T - k frames, at least 0; value t is made of the frames t to t + k.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def acceleration(points: Float[Tensor, "*B T P 3"], fps: float) -> Float[Tensor, "*B L"]:
    """Mean length of the points' acceleration in metres per second squared."""
    return finite_difference(points, 2).norm(dim=-1).mean(-1) * fps**2


def acceleration_error(
    points: Float[Tensor, "*B T P 3"], truth: Float[Tensor, "*#B T P 3"], fps: float
) -> Float[Tensor, "*B L"]:
    """Mean length of the difference of two accelerations in metres per second squared.

    Source: Kanazawa et al., Learning 3D Human Dynamics from Video, 2019 (acceleration error).
    """
    return finite_difference(points - truth, 2).norm(dim=-1).mean(-1) * fps**2


def jerk(points: Float[Tensor, "*B T P 3"], fps: float) -> Float[Tensor, "*B L"]:
    """Mean length of the points' jerk in metres per second cubed."""
    return finite_difference(points, 3).norm(dim=-1).mean(-1) * fps**3


def in_mm_per_frame_squared(
    acceleration: Float[Tensor, "*B T"], fps: float
) -> Float[Tensor, "*B T"]:
    """The same acceleration in millimetres per frame squared, the unit of the literature."""
    return acceleration * (1000 / fps**2)


def finite_difference(points: Float[Tensor, "*B T P 3"], order: int) -> Float[Tensor, "*B L P 3"]:
    """Forward difference over frames; empty when there are not more than `order` frames."""
    return points.diff(n=order, dim=-3)


def mean_over_frames(
    values: Float[Tensor, "*B T"], valid: Bool[Tensor, " T"] | None = None
) -> Float[Tensor, "*B"]:
    """Mean over the valid frames whose value is not NaN; NaN when there is none."""
    if valid is not None:
        values = values[..., valid]
    return torch.nanmean(values, dim=-1)


def valid_differences(valid: Bool[Tensor, " T"], order: int) -> Bool[Tensor, " L"]:
    """Whether each frame and the next `order` frames are all valid."""
    return valid.unfold(0, order + 1, 1).all(-1) if len(valid) > order else valid[:0]
