"""Augmentation of clean hands: motion that the grasps of the synthesis lack.

Recorded hands turn about their fingertips while they hold, shift, and move their fingers all the
time; people, and the fits that make ground truth, also have finger poses of their own. Real skin
stays at the surface meanwhile, but added motion takes it off or into it: hands are brought back.
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
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.pose_prior import FINGER_STD
from geneoh.synthesis.motions.smoothing import smoothed_motion


@dataclass(frozen=True)
class KeptContactConfig(Limited):
    """How many hands are brought back, and how exactly; lengths in metres."""

    LIMITS: ClassVar[Limits] = {
        "rounds": (0, 20),
        **dict.fromkeys(("near", "fade", "deviation", "smoothing"), (1e-6, 1000)),
    }

    share: float = 0.0  # share of the windows whose hand is brought back
    rounds: int = 2  # corrections, one after the other; 0 leaves the hands where they are
    near: float = 0.012
    """Height of keypoints over the surface up to which they count as touching it."""
    fade: float = 0.006  # deviation of the bell curve by which higher ones count less
    deviation: float = 0.0015  # of the height that is kept
    smoothing: float = 1.5  # deviation over which corrections are smoothed, frames


def with_kept_contact(
    hand: HandParameters,
    before: HandParameters,
    surface: ObjectSurface,
    config: KeptContactConfig | None = None,
    chosen: Bool[Tensor, " B"] | None = None,
) -> HandParameters:
    """Hands whose keypoints are as high over the surface as they were `before`, where that is near.

    Others come no nearer than they were, or than `near`. World frame in and out, smooth over time.
    With `chosen`, the hands of the other windows stay as they are.
    """
    config = config or KeptContactConfig()
    wanted = _heights(before.joints, surface)[0]
    touching = torch.exp(-0.5 * ((wanted - config.near).clamp(min=0) / config.fade) ** 2)
    least = wanted.clamp(max=config.near)
    for _ in range(config.rounds):
        height, normal = _heights(hand.joints, surface)
        # keypoints that did not touch keep out of the object
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
    """Heights of keypoints over the plane of the nearest surface point, and its outward normal."""
    near = nearest_on_parts(joints, surface)
    return ((joints - near.points) * near.normals).sum(-1), near.normals


def _correction(
    hand: HandParameters,
    normal: Float[Tensor, "B T 21 3"],
    missing: Float[Tensor, "B T 21"],
    weight: Float[Tensor, "B T 21"],
    config: KeptContactConfig,
) -> Float[Tensor, "B T 51"]:
    """The most probable change, in units of `UNIT`, that raises keypoints by `missing`.

    Units are the prior deviations, and heights have a deviation of their own: the mean of a
    Gaussian given 21 linear measurements.
    """
    joints, turn = hand.posed
    order = list(MANO_FROM_OPENPOSE)
    mano = joints[..., order, :]
    moved, by = MOVES_KEYPOINT.to(mano.device).unbind(1)
    # turning joint j by w in its own frame moves a point p by (G_j w) x (p - p_j)
    lever = torch.linalg.cross(
        mano[..., moved, :] - mano[..., by, :], normal[..., order, :][..., moved, :], dim=-1
    )
    rotate = mano.new_zeros(*mano.shape[:-1], 16, 3)
    rotate[..., moved, by, :] = (lever[..., None, :] @ turn[..., by, :, :])[..., 0, :]
    shift = normal[..., order, :]
    slope = torch.cat([shift, rotate.flatten(-2)], -1) * mano.new_tensor(UNIT)
    slope = slope * weight[..., order, None]
    wanted = (missing * weight)[..., order, None]
    system = slope @ slope.mT + config.deviation**2 * torch.eye(21).to(slope)
    return (slope.mT @ torch.linalg.solve(system, wanted))[..., 0]


MOST_PERIOD = 1_000_000  # frames of the slowest motion


@dataclass(frozen=True)
class AugmentationConfig(Limited):
    """How much hands move beyond what was synthesized. A share is of the windows."""

    LIMITS: ClassVar[Limits] = dict.fromkeys(("turn", "shift", "fingers"), (1e-9, 1000))

    share: float = 0.85  # share whose hand moves more than it was made to
    periods: tuple[float, ...] = (1.0, 2.0, 4.0, 10.0, 25.0)
    """Frames over which such motion changes; each window has a mixture of its own."""
    period_power: float = 0.3
    """Power of its period by which a motion counts in that mixture: slow motion is larger."""
    turn: tuple[float, float] = (0.02, 0.4)
    """Range of the deviation of the turn about the fingertips, radians, log-uniform."""
    shift: tuple[float, float] = (0.0006, 0.02)  # range of the shift's deviation, m, log-uniform
    fingers: tuple[float, float] = (0.05, 0.8)
    """Range of the deviation of the finger joints, in those of the pose prior, log-uniform."""
    style_share: float = 0.5  # share whose finger pose is set off as a whole
    style: float = 0.4
    """Deviation of that offset, in those of the pose prior: little where joints hardly move."""
    smallest_style: float = 0.04  # least deviation of that offset, radians
    contact: KeptContactConfig = field(default_factory=KeptContactConfig)
    """How the hands that move more are brought back to the surface that they touched."""

    def __post_init__(self) -> None:
        """Refuse numbers outside of their limits, and motion of no period."""
        super().__post_init__()
        if not self.periods or not all(0 < period <= MOST_PERIOD for period in self.periods):
            raise ConfigError(
                f"AugmentationConfig: 'periods' must be above 0 and at most {MOST_PERIOD}, got "
                f"{self.periods}; correct them"
            )


def augmented(
    hand: HandParameters, draws: Draws, config: AugmentationConfig | None = None
) -> HandParameters:
    """The same windows with hands that move more; world frame in and out, smooth over time."""
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
    """Motion of unit size in every channel, a random mixture of fast and slow."""
    bands = [draws.smooth(frames, 51, period) for period in config.periods]
    share = draws.share(1, 1, len(bands)) * torch.tensor(config.periods) ** config.period_power
    share = share / share.square().sum(-1, keepdim=True).sqrt()
    return (torch.stack(bands, dim=-1) * share).sum(-1)
