"""Variety that the grasps of the synthesis engine lack: hands that do not hold like a vice.

In real recordings a hand turns about its fingertips while it holds, shifts, and moves its fingers
all the time; people, and the fits that make ground truth, also hold them in ways of their own.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.representation.parameters import HandParameters
from geneoh.synthesis.draws import smooth_noise
from geneoh.synthesis.pose_prior import FINGER_STD

SHARE = 0.85
"""Share of the windows whose hand moves more than it was made to."""
PERIODS, SLOW = (1.0, 2.0, 4.0, 10.0, 25.0), 0.3
"""Frames over which such motion changes; each window has a mixture of its own, in which a motion
counts by that power of its period. The fastest are the unrest of a real ground truth."""
TURN, SHIFT, FINGERS = (0.02, 0.4), (0.0006, 0.02), (0.05, 0.8)
"""Smallest and largest deviation, log-uniform: turn about the fingertips (rad), shift (m), fingers
(in natural deviations of each joint)."""
STYLE_SHARE, STYLE_STD = 0.5, (0.4 * FINGER_STD).clamp(min=0.04)
"""Share of the windows whose finger pose is set off as a whole, and by how much (rad): little where
joints hardly move, by which a pose that is off as a whole can be told."""


def augmented(hand: HandParameters, *, generator: torch.Generator) -> HandParameters:
    """The same windows with livelier hands; world frame in and out, smooth over time."""
    batch, frames = hand.wrist.shape[:2]

    def uniform(*shape: int) -> Tensor:
        return torch.rand(batch, *shape, generator=generator)

    bands = [smooth_noise(batch, frames, 51, period, generator=generator) for period in PERIODS]
    share = uniform(1, 1, len(PERIODS)) * torch.tensor(PERIODS) ** SLOW
    share = share / share.square().sum(-1, keepdim=True).sqrt()
    motion = (torch.stack(bands, dim=-1) * share).sum(-1)
    lively = (uniform(1, 1) < SHARE).float()

    def size(limits: tuple[float, float]) -> Float[Tensor, "B 1 1"]:
        low, high = (math.log(limit) for limit in limits)
        return torch.exp(low + (high - low) * uniform(1, 1)) * lively

    turn = axis_angle_to_matrix(motion[..., :3] * size(TURN))
    pivot = hand.joints[:, :, list(TIP_KEYPOINTS)].mean(2)
    arm = (turn @ (hand.wrist - pivot)[..., None])[..., 0]
    style = STYLE_STD * torch.randn(batch, 1, 15, 3, generator=generator)
    style = style * (uniform(1, 1, 1) < STYLE_SHARE)
    bend = (motion[..., 6:] * size(FINGERS)).unflatten(-1, (15, 3)) * FINGER_STD
    return HandParameters(
        pivot + arm + motion[..., 3:6] * size(SHIFT),
        turn @ hand.turn,
        hand.fingers + style + bend,
        hand.offsets,
    )
