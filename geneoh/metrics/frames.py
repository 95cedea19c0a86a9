"""Means over the frames that count."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def mean_over_frames(
    values: Float[Tensor, "*B T"], valid: Bool[Tensor, " T"] | None = None
) -> Float[Tensor, "*B"]:
    """Mean over the valid frames whose value is not NaN; NaN when there is none."""
    if valid is not None:
        values = values[..., valid]
    return torch.nanmean(values, dim=-1)


def valid_differences(valid: Bool[Tensor, " T"], order: int) -> Bool[Tensor, " L"]:
    """Whether a finite difference of this order exists per frame: it and the next are valid."""
    return valid.unfold(0, order + 1, 1).all(-1) if len(valid) > order else valid[:0]
