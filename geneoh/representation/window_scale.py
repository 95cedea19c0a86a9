"""The unit of a window: its own mean and deviation, in which the paper reads its noise levels."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

LEAST = 1e-3
"""Least deviation of a window, metres."""


@dataclass(frozen=True)
class WindowScale:
    """Mean and deviation of each of B windows of canonical keypoints, metres (paper, C.5).

    The mean is over frames and keypoints, the deviation over all coordinates: one number for each
    window keeps the shape of the hand. Level 400 of the paper is about 75 mm for a real hand.
    """

    mean: Float[Tensor, "B *N 3"]
    deviation: Float[Tensor, "B *N 1"]

    @classmethod
    def of(cls, windows: Float[Tensor, "B *N 3"]) -> "WindowScale":
        """The scale of noisy windows, as they are given."""
        middle = tuple(range(1, windows.ndim - 1))
        mean = windows.mean(middle, keepdim=True)
        square = (windows - mean).square().mean((*middle, -1), keepdim=True)
        return cls(mean, square.sqrt().clamp(min=LEAST))

    def normalised(self, windows: Float[Tensor, "B *N 3"]) -> Float[Tensor, "B *N 3"]:
        """The windows with mean zero and deviation one."""
        return (windows - self.mean) / self.deviation

    def metres(self, windows: Float[Tensor, "B *N 3"]) -> Float[Tensor, "B *N 3"]:
        """Inverse of `normalised`."""
        return windows * self.deviation + self.mean
