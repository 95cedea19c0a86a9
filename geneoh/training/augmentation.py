"""Augmentation of clean hands with motion that synthesized grasps lack.

Recorded hands turn about their fingertips while they hold an object, shift on it, and move their
fingers all the time. People, and the fits that make ground truth, have individual finger poses.
Added motion lifts a hand off the surface or moves it in, so it is corrected to keep its contact.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.config import Limited, Limits
from geneoh.errors import ConfigError
from geneoh.fitting.terms import MOVES_KEYPOINT
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import MANO_FROM_OPENPOSE, TIP_KEYPOINTS
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.parameters import UNIT, HandParameters
from geneoh.representation.region import ObjectSurface
from geneoh.synthesis.draws import Draws, smoothed_motion
from geneoh.synthesis.grasping.grasp_types import FINGER_STD


@dataclass(frozen=True)
class KeptContactConfig(Limited):
    """How hands are corrected to keep their contact; in metres, with standard deviations."""

    LIMITS: ClassVar[Limits] = {
        "rounds": (0, 20),
        **dict.fromkeys(("near", "fade", "deviation", "smoothing"), (1e-6, 1000)),
    }

    share: float = 0.0  # share of the windows whose hand is corrected
    rounds: int = 2  # iterations of the correction; 0 leaves the hands as they are
    near: float = 0.012
    """Height of keypoints over the surface up to which they count fully as touching it."""
    fade: float = 0.006  # deviation of the Gaussian by which the weight falls above `near`
    deviation: float = 0.0015  # with which the height of a touching keypoint is kept
    smoothing: float = 1.5  # deviation of the Gaussian that smooths corrections, frames


def with_kept_contact(
    hand: HandParameters,
    before: HandParameters,
    surface: ObjectSurface,
    config: KeptContactConfig,
    chosen: Bool[Tensor, " B"] | None = None,
) -> HandParameters:
    """Hands corrected so that touching keypoints keep the height over the surface of `before`.

    Other keypoints are only pushed away where they come nearer than `near` and than before. World
    frame in and out, smooth over time. With `chosen`, only the hands of these windows change.
    """
    wanted = _heights(before.joints, surface)[0]
    touching = torch.exp(-0.5 * ((wanted - config.near).clamp(min=0) / config.fade) ** 2)
    least = wanted.clamp(max=config.near)
    for _ in range(config.rounds):
        height, normal = _heights(hand.joints, surface)
        # keypoints that did not touch are kept out of the object
        away = (height < least) & (touching < 0.5)
        weight = torch.where(away, 1.0, touching)
        missing = torch.where(away, least, wanted) - height
        change = smoothed_motion(
            _correction(hand, normal, missing, weight, config), config.smoothing
        )
        hand = hand.moved(change if chosen is None else change * chosen[:, None, None])
    return hand


def _heights(
    joints: Float[Tensor, "B T 21 3"], surface: ObjectSurface
) -> tuple[Float[Tensor, "B T 21"], Float[Tensor, "B T 21 3"]]:
    """Heights of keypoints over the tangent plane at the nearest surface point, and its normal."""
    near = nearest_on_parts(joints, surface)
    return ((joints - near.points) * near.normals).sum(-1), near.normals


def _correction(
    hand: HandParameters,
    normal: Float[Tensor, "B T 21 3"],
    missing: Float[Tensor, "B T 21"],
    weight: Float[Tensor, "B T 21"],
    config: KeptContactConfig,
) -> Float[Tensor, "B T 51"]:
    """The most probable change, in units of `UNIT`, that raises keypoints by `missing` metres.

    It is the posterior mean given 21 linear measurements: the prior of the change is Gaussian with
    `UNIT` as standard deviations, and heights are measured with `config.deviation`.
    """
    joints, turn = hand.posed
    centers = joints[..., list(MANO_FROM_OPENPOSE[:16]), :]
    moved, by = MOVES_KEYPOINT.to(joints.device).unbind(1)
    # turning joint j by w in its own frame moves a point p by (G_j w) x (p - p_j)
    lever = torch.linalg.cross(
        joints[..., moved, :] - centers[..., by, :], normal[..., moved, :], dim=-1
    )
    rotate = joints.new_zeros(*joints.shape[:-1], 16, 3)
    rotate[..., moved, by, :] = (lever[..., None, :] @ turn[..., by, :, :])[..., 0, :]
    slope = torch.cat([normal, rotate.flatten(-2)], -1) * joints.new_tensor(UNIT)
    slope, wanted = slope * weight[..., None], (missing * weight)[..., None]
    system = slope @ slope.mT + config.deviation**2 * torch.eye(21).to(slope)
    return (slope.mT @ torch.linalg.solve(system, wanted))[..., 0]


MOST_PERIOD = 1_000_000  # longest period of added motion, frames


@dataclass(frozen=True)
class AugmentationConfig(Limited):
    """Motion that is added to hands. Shares are of the windows, deviations are standard ones."""

    LIMITS: ClassVar[Limits] = dict.fromkeys(("turn", "shift", "fingers"), (1e-9, 1000))

    share: float = 0.85  # share to whose hand motion is added
    periods: tuple[float, ...] = (1.0, 2.0, 4.0, 10.0, 25.0)
    """Time scales of added motion, frames; each window has a random mixture of them."""
    period_power: float = 0.3
    """Motion counts in the mixture by its period to this power: slow motion is larger."""
    turn: tuple[float, float] = (0.02, 0.4)
    """Range of the deviation of the turn about the fingertips, radians, log-uniform."""
    shift: tuple[float, float] = (0.0006, 0.02)  # range of the shift's deviation, m, log-uniform
    fingers: tuple[float, float] = (0.05, 0.8)
    """Range of the deviation of the finger joints, relative to the pose prior's, log-uniform."""
    style_share: float = 0.5  # share whose finger pose has a constant offset
    style: float = 0.4
    """Deviation of that offset, relative to the pose prior's: small where joints hardly move."""
    smallest_style: float = 0.04  # least deviation of that offset, radians
    contact: KeptContactConfig = field(default_factory=KeptContactConfig)
    """How hands with added motion are corrected to keep their contact."""

    def __post_init__(self) -> None:
        """Refuse numbers outside of their limits, and an empty list of periods."""
        super().__post_init__()
        if not self.periods or not all(0 < period <= MOST_PERIOD for period in self.periods):
            raise ConfigError(
                f"AugmentationConfig: 'periods' must be above 0 and at most {MOST_PERIOD}, got "
                f"{self.periods}; correct them"
            )


def augmented(
    hand: HandParameters, draws: Draws, config: AugmentationConfig | None = None
) -> HandParameters:
    """Add random motion and finger poses to clean hands; world frame in and out, smooth in time."""
    config = config or AugmentationConfig()
    motion = _mixed_motion(hand.wrist.shape[1], config, draws)
    moves = draws.chance(config.share, 1, 1).float()

    def size(limits: tuple[float, float]) -> Float[Tensor, "B 1 1"]:
        return draws.log_uniform(limits, 1, 1) * moves

    turn = axis_angle_to_matrix(motion[..., :3] * size(config.turn))
    pivot = hand.joints[:, :, list(TIP_KEYPOINTS)].mean(2)
    arm = (turn @ (hand.wrist - pivot)[..., None])[..., 0]
    style = (config.style * FINGER_STD).clamp(min=config.smallest_style) * draws.normal(1, 15, 3)
    style = style * draws.chance(config.style_share, 1, 1, 1)
    bend = (motion[..., 6:] * size(config.fingers)).unflatten(-1, (15, 3)) * FINGER_STD
    return HandParameters(
        pivot + arm + motion[..., 3:6] * size(config.shift),
        turn @ hand.turn,
        hand.fingers + style + bend,
        hand.offsets,
    )


def _mixed_motion(frames: int, config: AugmentationConfig, draws: Draws) -> Float[Tensor, "B T 51"]:
    """Noise of unit variance in every channel, a random mixture of all `periods`."""
    bands = [draws.smooth(frames, 51, period) for period in config.periods]
    share = draws.share(1, 1, len(bands)) * torch.tensor(config.periods) ** config.period_power
    share = share / share.square().sum(-1, keepdim=True).sqrt()
    return (torch.stack(bands, dim=-1) * share).sum(-1)
