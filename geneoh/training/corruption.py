"""Random corruption of clean windows: a mixture of the errors of real hand trackers.

Errors are added to hand parameters, as estimators err, and keypoint jitter on top. Their size and
correlation in time vary from window to window, from none at all to more than the paper's noises.
Some errors depend on the motion: fingers that bend too little or too much, and filters that lag.
The noises that methods are tested on are in `geneoh.sequence.noise`.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import Limited, Limits
from geneoh.geometry.mirror import MIRROR
from geneoh.representation.parameters import HandParameters
from geneoh.sequence.noise import with_memory
from geneoh.synthesis.draws import Draws

CHANNELS = torch.tensor([3, 3, 45])
"""Number of parameters of the translation, the global rotation and the finger joints."""


@dataclass(frozen=True)
class CorruptionConfig(Limited):
    """Size and change over time of the errors. Shares are of windows, deviations are standard."""

    LIMITS: ClassVar[Limits] = {
        **{"common_size": (0, 1), "bent_fingers": (0, 1), "bend": (0, 2)},
        "filter_memory": (0, 0.99),
        **dict.fromkeys(("translation", "rotation", "fingers", "depth"), (1e-9, 1000)),
        **dict.fromkeys(("object_turn", "object_shift", "burst_factor"), (1e-9, 1000)),
        **dict.fromkeys(("lasting_turn", "lasting_shift"), (0, 1000)),
        **dict.fromkeys(("drift_frames", "depth_frames", "object_frames"), (1e-3, math.inf)),
        **{"gaps": (1, 1000), "gap_frames": (1, Limited.LARGEST)},
    }

    clean_share: float = 0.1  # share whose parameters are exact: clean hands must stay clean
    translation: tuple[float, float] = (0.0005, 0.014)
    """Range of the deviation of the translation, metres, log-uniform."""
    rotation: tuple[float, float] = (0.004, 0.13)
    """Range of the deviation of the global rotation, radians, log-uniform."""
    fingers: tuple[float, float] = (0.02, 0.6)
    """Range of the deviation of the finger joints, radians, log-uniform."""
    common_size: float = 0.7  # weight of a size that the three share: bad tracks are bad in all
    apart_share: float = 0.4
    """Share in which errors of translation, rotation and fingers are independent in kind and size:
    many trackers are good at the pose of a hand, and bad at its position."""
    exact_share: float = 0.3  # in such windows, probability that each of the three has no error
    joint_scatter: float = 0.6  # deviation of the logarithm of each finger joint's size factor
    largest_joint: float = 1.5  # largest size factor of a finger joint
    burst_share: float = 0.3  # share with bursts: frames whose independent errors are larger
    burst_frames: float = 0.1  # largest share of the frames of a window that are bursts
    burst_factor: tuple[float, float] = (3.0, 9.0)  # range of the factor of errors in bursts
    drift_frames: tuple[float, float] = (2.0, 60.0)
    """Range of the correlation time of slow errors, frames, log-uniform."""
    right_share: float = 0.4
    """Share whose one-sided errors (as the paper's Beta noise) are positive in all channels."""
    left_share: float = 0.4
    """Share whose one-sided errors have the signs of a mirrored left hand; others are random."""
    one_sided: tuple[float, float] = (0.8, 0.15)
    """Mean and deviation over time of one-sided errors, relative to their size."""
    gap_share: float = 0.33  # share with gaps, runs of frames without a hand
    gaps: int = 3  # largest number of gaps in a window
    gap_frames: tuple[int, int] = (2, 10)  # shortest and longest gap
    bent_share: float = 0.0
    """Share whose fingers bend too little or too much: regression tends to the mean pose."""
    each_bent_share: float = 0.4  # share of such windows in which single fingers have own factors
    bent_fingers: float = 0.4  # share of the fingers that have one in these
    bend: tuple[float, float] = (0.2, 1.2)  # range of the factor of the joint angles, uniform
    filtered_share: float = 0.0  # share that was smoothed by a causal filter, and therefore lags
    filter_memory: tuple[float, float] = (0.2, 0.75)
    """Range of the filter's weight of the previous filtered frame, uniform."""
    jitter_share: float = 0.25  # share whose keypoints jitter independently, as detectors' do
    jitter: float = 0.006  # largest deviation of that jitter, metres
    camera_share: float = 0.4  # share with the depth error of a single camera, along a random ray
    depth: tuple[float, float] = (0.005, 0.045)
    """Range of the deviation of the constant depth error, metres, log-uniform."""
    depth_drift: float = 0.8  # largest deviation of the drifting depth error, relative to `depth`
    depth_frames: float = 15.0  # correlation time of that drift, frames
    depth_jitter: float = 0.5  # largest deviation of independent depth errors, relative to `depth`
    blunder_share: float = 0.02  # share of frames with a blunder, in every second such window
    blunder: float = 0.06  # depth error of a blunder, metres
    across: float = 0.004  # deviation of the constant error across the ray, metres
    ray_share: float = 0.5  # share of such windows whose ray the network gets
    other_ray_share: float = 0.1  # share of other windows that get a ray without errors along it
    shaky_share: float = 0.35  # share with noise on the object's pose, as left after smoothing
    object_turn: tuple[float, float] = (0.004, 0.1)
    """Range of the deviation of the object's rotation, radians, log-uniform."""
    object_shift: tuple[float, float] = (0.0005, 0.012)
    """Range of the deviation of the object's translation, metres, log-uniform."""
    object_frames: float = 15.0  # correlation time of the slow half of this noise, frames
    object_white_left: float = 0.15  # share that smoothing leaves of the other half, white noise
    lasting_turn: float = 0.03  # deviation of the object's constant rotation error, radians
    lasting_shift: float = 0.004  # of its constant translation error, metres; both in all windows


@dataclass(frozen=True)
class Corruption(Bundle):
    """Errors of hand and object, and observed frames, of B windows."""

    translation: Float[Tensor, "B T 3"]
    pose: Float[Tensor, "B T 16 3"]
    bend: Float[Tensor, "B 15"]  # factor of the finger joint angles, before `pose` is added
    memory: Float[Tensor, "B 2"]
    """Weight of the previous frame in the filters of the wrist position and of the fingers."""
    keep: Bool[Tensor, "B T"]  # frames in which the hand is observed
    jitter: Float[Tensor, "B T 21 3"]
    ray: Float[Tensor, "B 3"]  # unit direction from the camera, world; zero where it is not known
    object_turn: Float[Tensor, "B T 3"]
    """Rotation error of the object in its own frame (axis-angle); below, its shift in the world."""
    object_shift: Float[Tensor, "B T 3"]
    object_noise: Float[Tensor, "B 2"]
    """Deviation of white noise on the object's rotation (rad) and translation (m) as tracked."""

    def tracked(self, clean: HandParameters) -> HandParameters:
        """Clean hands with these errors, without gaps and keypoint jitter; world frame."""
        noisy = HandParameters.of_pose(
            clean.wrist + self.translation, clean.pose + self.pose, clean.offsets
        )
        bent = noisy.fingers + (self.bend[:, None, :, None] - 1) * clean.fingers
        return replace(
            noisy,
            wrist=_filtered(noisy.wrist, self.memory[:, 0]),
            fingers=_filtered(bent.flatten(2), self.memory[:, 1]).unflatten(2, (15, 3)),
        )


def draw_corruption(frames: int, draws: Draws, config: CorruptionConfig) -> Corruption:
    """Draw the corruption of B windows of T frames."""
    apart = draws.chance(config.apart_share, 1)
    noise, size = _unit_noise(frames, config, apart, draws), _sizes(config, apart, draws)
    noise, exact = noise * size[:, None], (size == 0).all(1, keepdim=True)
    jitter = config.jitter * draws.share(1, 1, 1)
    jitter = jitter * draws.chance(config.jitter_share, 1, 1, 1)
    keep, jitter = _observed(frames, config, draws), jitter * draws.normal(frames, 21, 3)
    shift, ray = _camera(frames, config, draws)
    turn, move, white = _object_noise(frames, config, draws)
    return Corruption(
        translation=noise[..., :3] + shift,
        pose=noise[..., 3:].unflatten(-1, (16, 3)),
        bend=torch.where(exact, 1.0, _bend(config, draws)),
        memory=torch.where(exact, 0.0, _memory(config, draws)),
        keep=keep,
        jitter=jitter,
        ray=ray,
        object_turn=turn,
        object_shift=move,
        object_noise=white,
    )


def _camera(
    frames: int, config: CorruptionConfig, draws: Draws
) -> tuple[Float[Tensor, "B T 3"], Float[Tensor, "B 3"]]:
    """Translation errors along a camera ray, and the ray, or zero where the network gets none."""
    ray = torch.nn.functional.normalize(draws.normal(3), dim=-1)
    errs = draws.chance(config.camera_share, 1)
    correlation = torch.full((draws.batch,), config.depth_frames)
    drift = config.depth_drift * draws.share(1, 1)
    drift = drift * _ornstein_uhlenbeck(draws.normal(frames, 1), correlation)
    jitter = config.depth_jitter * draws.share(1, 1)
    depth = draws.normal(1, 1) + drift + jitter * draws.normal(frames, 1)
    depth = depth * draws.log_uniform(config.depth, 1, 1)
    blunders = draws.chance(config.blunder_share, frames, 1) & draws.chance(0.5, 1, 1)
    depth = depth + config.blunder * draws.normal(1, 1).sign() * blunders
    shift = depth * ray[:, None] + config.across * draws.normal(1, 3)
    scaled = torch.where(
        errs, draws.chance(config.ray_share, 1), draws.chance(config.other_ray_share, 1)
    )
    return shift * errs[..., None], ray * scaled


def _object_noise(
    frames: int, config: CorruptionConfig, draws: Draws
) -> tuple[Float[Tensor, "B T 3"], Float[Tensor, "B T 3"], Float[Tensor, "B 2"]]:
    """Errors that smoothing leaves in the object's track, and its white noise before smoothing."""
    shakes = draws.chance(config.shaky_share, 1)
    ranges = config.object_turn, config.object_shift
    size = torch.stack([draws.log_uniform(limits) for limits in ranges], -1) * shakes
    correlation = torch.full((draws.batch,), config.object_frames)
    slow = _ornstein_uhlenbeck(draws.normal(frames, 6), correlation)
    unit = (slow + config.object_white_left * draws.normal(frames, 6)) / math.sqrt(2)
    turn, move = (unit.unflatten(-1, (2, 3)) * size[:, None, :, None]).unbind(2)
    lasting = torch.tensor([config.lasting_turn, config.lasting_shift])
    lasting_turn, lasting_move = (draws.normal(1, 2, 3) * lasting[:, None]).unbind(2)
    return turn + lasting_turn, move + lasting_move, size / math.sqrt(2)


def _unit_noise(
    frames: int, config: CorruptionConfig, apart: Bool[Tensor, "B 1"], draws: Draws
) -> Float[Tensor, "B T 51"]:
    """A mixture of independent, slow, constant and one-sided noise, of about unit size.

    In windows that are `apart`, translation, rotation and fingers each have their own mixture.
    """
    share = torch.log(draws.share(3, 4).clamp(min=1e-4)) ** 2  # one or two dominate each mixture
    share = torch.where(apart[..., None], share, share[:, :1])
    share = share / share.square().sum(-1, keepdim=True).sqrt()
    share = share.repeat_interleave(CHANNELS, dim=1)
    white = draws.normal(frames, 51)
    draw, most = draws.share(frames, 1), config.burst_frames * draws.share(1, 1)
    burst = draw < most * draws.chance(config.burst_share, 1, 1)
    white = torch.where(burst, white * draws.uniform(config.burst_factor, 1, 1), white)
    correlation = draws.log_uniform(config.drift_frames)
    slow = _ornstein_uhlenbeck(draws.normal(frames, 51), correlation)
    bias = draws.normal(1, 51).expand_as(white)
    one_sided = _one_sided(frames, config, draws)
    return (torch.stack([white, slow, bias, one_sided], dim=-1) * share[:, None]).sum(-1)


def _ornstein_uhlenbeck(
    white: Float[Tensor, "B T C"], correlation: Float[Tensor, " B"]
) -> Float[Tensor, "B T C"]:
    """White noise turned into noise of unit variance with a `correlation` time in frames."""
    stay = torch.exp(-1.0 / correlation)[:, None]
    return with_memory(white, stay, (1 - stay**2).sqrt())


def _one_sided(frames: int, config: CorruptionConfig, draws: Draws) -> Float[Tensor, "B T 51"]:
    """Noise close to a bias, with all signs positive, as in a mirrored left hand, or random."""
    flip = torch.tensor(MIRROR)
    left = torch.cat([flip, -flip.repeat(16)])
    random, draw = draws.normal(51).sign(), draws.share(1)
    sign = torch.where(draw < config.right_share + config.left_share, left, random)
    sign = torch.where(draw < config.right_share, 1.0, sign)
    mean, std = config.one_sided
    return sign[:, None] * (mean + std * draws.normal(frames, 51)).clamp(0, 1.2)


def _sizes(
    config: CorruptionConfig, apart: Bool[Tensor, "B 1"], draws: Draws
) -> Float[Tensor, "B 51"]:
    """Standard deviation of each channel of translation, global rotation and finger joints.

    In windows that are `apart`, the three sizes are independent, and some are zero.
    """
    ranges = torch.tensor([config.translation, config.rotation, config.fingers])
    low, high = ranges.log().unbind(-1)
    common = config.common_size * ~apart
    size = common * draws.share(1) + (1 - common) * draws.share(3)
    exact = draws.chance(config.clean_share, 1) | (apart & draws.chance(config.exact_share, 3))
    size = torch.exp(low + (high - low) * size) * ~exact
    joints = (config.joint_scatter * draws.normal(15)).exp().clamp(max=config.largest_joint)
    return torch.cat([size[:, :2], size[:, 2:] * joints], -1).repeat_interleave(3, dim=1)


def _bend(config: CorruptionConfig, draws: Draws) -> Float[Tensor, "B 15"]:
    """Factors of the finger joint angles, one per finger or one for the whole hand."""
    if not config.bent_share:
        return torch.ones(draws.batch, 15)
    each = draws.uniform(config.bend, 5)
    some = torch.where(draws.chance(config.bent_fingers, 5), each, 1.0)
    factor = torch.where(draws.chance(config.each_bent_share, 1), some, each[:, :1])
    factor = torch.where(draws.chance(config.bent_share, 1), factor, 1.0)
    return factor.repeat_interleave(3, dim=1)


def _memory(config: CorruptionConfig, draws: Draws) -> Float[Tensor, "B 2"]:
    """`Corruption.memory`; in every second filtered window only the wrist position is filtered."""
    if not config.filtered_share:
        return torch.zeros(draws.batch, 2)
    memory = draws.uniform(config.filter_memory, 1) * draws.chance(config.filtered_share, 1)
    return torch.cat([memory, memory * draws.chance(0.5, 1)], -1)


def _filtered(
    values: Float[Tensor, "B T C"], memory: Float[Tensor, " B"]
) -> Float[Tensor, "B T C"]:
    """Exponential smoothing with the previous filtered frame, as live trackers do."""
    if not memory.any():  # the default: no window is filtered
        return values
    return with_memory(values, memory[:, None], 1 - memory[:, None])


def _observed(frames: int, config: CorruptionConfig, draws: Draws) -> Bool[Tensor, "B T"]:
    """Mask of observed frames; a window that would lose all frames keeps all."""
    time = torch.arange(frames)
    keep = torch.ones(draws.batch, frames, dtype=torch.bool)
    shortest, longest = config.gap_frames
    gaps = draws.integers(1, config.gaps + 1, 1) * draws.chance(config.gap_share, 1)
    for gap in range(config.gaps):
        start = draws.integers(-3, max(frames, 1), 1)
        length = draws.integers(shortest, longest + 1, 1)
        keep &= ~((time >= start) & (time < start + length) & (gap < gaps))
    return keep | ~keep.any(1, keepdim=True)
