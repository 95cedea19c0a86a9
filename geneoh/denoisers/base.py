"""Features and scales that several denoisers share."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.candidate_corrections import SMOOTHING_FRAMES, filter_kernels
from geneoh.geometry.rotations import matrix_to_axis_angle

HAND_SCALE = 0.08
"""Standard deviation of canonical keypoints around the contact points, metres: the unit of network
inputs. It is fixed, because a scale per window, as in the paper, would lose bone lengths."""
NOISE_SCALE = 0.02  # typical distance of a clean keypoint from its observation, metres
CLOSE = 0.02  # distance over which closeness to the surface decays, metres
POINTS = 32  # number K of contact points that the networks are trained with
SELECT_EVERY = 4  # contact points are chosen from every fourth frame
VERSIONS = 1 + len(SMOOTHING_FRAMES)  # number K of versions of a sample in `with_low_passed`
TYPICAL_DEVIATION = 0.035  # standard deviation of keypoints in a window of a real hand, metres


def object_rates(
    move: Float[Tensor, "B N 3"], turn: Float[Tensor, "B N 3 3"], axes: Float[Tensor, "B 3 3"]
) -> Float[Tensor, "B N+1 6"]:
    """Features of the object's motion to the next frame in the given axes: translation in units of
    3 mm, then rotation in units of 0.03 rad, clamped to +-10; zero in the last frame."""
    rates = torch.cat([move @ axes / 0.003, matrix_to_axis_angle(turn) @ axes / 0.03], dim=-1)
    return torch.nn.functional.pad(rates, (0, 0, 0, 1)).clamp(-10, 10)


def with_low_passed(values: Float[Tensor, "B T C"]) -> Float[Tensor, "B T K C"]:
    """A sample, stacked with its low-pass filtered versions over time (`SMOOTHING_FRAMES`)."""
    kernels = filter_kernels(torch.ones_like(values[:1, :, 0]), SMOOTHING_FRAMES)
    each = values[:, None]
    return torch.cat([each, kernels @ each], dim=1).transpose(1, 2)


def window_size(deviation: Float[Tensor, " B"], frames: int) -> Float[Tensor, "B T 1"]:
    """Logarithm of each window's standard deviation (metres), relative to `TYPICAL_DEVIATION`, as a
    feature of each frame."""
    size = (deviation / TYPICAL_DEVIATION).log()
    return size[:, None, None].expand(-1, frames, 1)
