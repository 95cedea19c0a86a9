"""Normalisation of a window by its own mean and deviation, the unit of the paper's noise levels."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

LEAST_DEVIATION = 1e-3
"""Lower limit of a window's standard deviation, metres."""


@dataclass(frozen=True)
class WindowScale:
    """Mean and standard deviation of B windows of canonical keypoints, metres (paper, C.5).

    The mean is over frames and keypoints. The deviation is over all coordinates, as in the public
    code, and not one for each axis (eq. 19): a single number keeps the shape of the hand. Level 400
    of the paper is about 75 mm for a real hand.
    """

    mean: Float[Tensor, "B *N 3"]
    deviation: Float[Tensor, "B *N 1"]

    @classmethod
    def of(cls, windows: Float[Tensor, "B *N 3"]) -> "WindowScale":
        """The scale computed from the noisy windows themselves."""
        middle = tuple(range(1, windows.ndim - 1))
        mean = windows.mean(middle, keepdim=True)
        square = (windows - mean).square().mean((*middle, -1), keepdim=True)
        return cls(mean, square.sqrt().clamp(min=LEAST_DEVIATION))

    def normalised(self, windows: Float[Tensor, "B *N 3"]) -> Float[Tensor, "B *N 3"]:
        """The windows with zero mean and unit standard deviation."""
        return (windows - self.mean) / self.deviation

    def metres(self, windows: Float[Tensor, "B *N 3"]) -> Float[Tensor, "B *N 3"]:
        """Inverse of `normalised`."""
        return windows * self.deviation + self.mean
