"""How a hand moves through time: acceleration and jerk of its points, by finite differences.

Order k loses k frames, L = T - k or none: value t is made of the frames t to t + k.
"""

from jaxtyping import Float
from torch import Tensor


def acceleration(points: Float[Tensor, "*B T P 3"], fps: float) -> Float[Tensor, "*B L"]:
    """Mean size of the points' acceleration in metres per second squared."""
    return difference(points, 2).norm(dim=-1).mean(-1) * fps**2


def acceleration_error(
    points: Float[Tensor, "*B T P 3"], truth: Float[Tensor, "*#B T P 3"], fps: float
) -> Float[Tensor, "*B L"]:
    """Mean size of the difference between two accelerations in metres per second squared.

    Source: Kanazawa et al., Learning 3D Human Dynamics from Video, 2019 (acceleration error).
    """
    return difference(points - truth, 2).norm(dim=-1).mean(-1) * fps**2


def jerk(points: Float[Tensor, "*B T P 3"], fps: float) -> Float[Tensor, "*B L"]:
    """Mean size of the points' jerk in metres per second cubed."""
    return difference(points, 3).norm(dim=-1).mean(-1) * fps**3


def per_frame_squared(acceleration: Float[Tensor, "*B T"], fps: float) -> Float[Tensor, "*B T"]:
    """The same acceleration in millimetres per frame squared, as papers print it."""
    return acceleration * (1000 / fps**2)


def difference(points: Float[Tensor, "*B T P 3"], order: int) -> Float[Tensor, "*B L P 3"]:
    """Forward difference over frames; empty when there are not more than `order` frames."""
    if points.shape[-3] <= order:
        return points[..., :0, :, :]
    return points.diff(n=order, dim=-3)
