"""The prior of finger poses: curls from a flat hand to a fist; mean, deviation, range of joints.

Axis-angle in the right hand's rest frame (fingers -x, palm -y, thumb +z), radians; joints in MANO
order without the wrist.
"""

import torch
from jaxtyping import Float
from torch import Tensor

# A finger flexes about the line across it, near +z; the thumb opposes by turning about +x at its
# base and flexes about (0.31, -0.86, 0.39).
FLEXION = (0.65, 0.7, 0.55)
"""Flexion of knuckle, middle and distal joint of a half closed finger (curl 1), radians."""
ACROSS = ((0.2, 0.0, 1.0), (-0.05, 0.0, 1.0), (-0.5, 0.0, 0.9), (-0.2, 0.0, 1.0))
"""Flexion axes of index, middle, pinky and ring at the knuckle: closing fingers converge."""
_BASE_STD, _MIDDLE_STD, _DISTAL_STD = (0.3, 0.2, 0.5), (0.18, 0.05, 0.5), (0.06, 0.05, 0.4)
_THUMB = (
    ((1.05, 0.1, 0.2), (0.4, 0.3, 0.25)),
    ((0.06, -0.17, 0.08), (0.35, 0.2, 0.25)),
    ((0.15, -0.42, 0.19), (0.15, 0.3, 0.35)),
)


def curled(curl: Float[Tensor, "B 5"]) -> Float[Tensor, "B 15 3"]:
    """Finger poses of the given curl: 0 is flat, 1 half closed, 2 a fist.

    Fingers in MANO order; the thumb stays opposed and bends at its two outer joints.
    """
    axes, flexion = curl.new_tensor(ACROSS), curl.new_tensor(FLEXION)
    base = curl[:, :4, None] * flexion[0] * axes + curl.new_tensor([0.0, 0.05, 0.0])
    outer = curl[:, :4, None, None] * flexion[1:, None] * curl.new_tensor([0.0, 0.0, 1.0])
    fingers = torch.cat([base[:, :, None], outer], dim=2)
    thumb = curl.new_tensor([mean for mean, _ in _THUMB])
    share = torch.stack([torch.ones_like(curl[:, 4]), curl[:, 4], curl[:, 4]], dim=-1)
    return torch.cat([fingers, (share[..., None] * thumb)[:, None]], dim=1).flatten(1, 2)


FINGER_MEAN = curled(torch.ones(1, 5))[0]
FINGER_STD = torch.tensor(
    [_BASE_STD, _MIDDLE_STD, _DISTAL_STD] * 4 + [list(std) for _, std in _THUMB]
)
FINGER_LOW = FINGER_MEAN.minimum(curled(torch.full((1, 5), 1.5))[0])
FINGER_HIGH = FINGER_MEAN.maximum(curled(torch.full((1, 5), 1.5))[0])
"""Ends of the range of the prior: half closed and three quarters closed."""


def beyond_range(fingers: Float[Tensor, "*B 15 3"]) -> Float[Tensor, "*B 15 3"]:
    """How far joint components are outside of the prior's range, in units of `FINGER_STD`."""
    return torch.maximum(FINGER_LOW - fingers, fingers - FINGER_HIGH).clamp(min=0) / FINGER_STD
