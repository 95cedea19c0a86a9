"""Noise like that of hand trackers, on pose parameters; keypoints follow by forward kinematics.

The first three kinds, independent between frames, are those of the papers. The others imitate real
trackers: a constant bias, slow drift, bursts, lost frames, and the combined errors of an estimator
with one fixed camera. Times are in frames, at any frame rate. Networks are trained on more varied
errors (`geneoh.training.corruption`), and tested on these.
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import normalize
from typing_extensions import assert_never

from geneoh.choices import Noise
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import (
    MANO_FROM_OPENPOSE,
    PARENTS,
    TIP_PARENTS,
    forward_kinematics,
    rest_offsets,
)
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.sequence.validation import without_collapsed

DRIFT_FRAMES = 10.0
"""Correlation time of the drift in frames."""
BURST_SHARE, BURST_FACTOR = 0.05, 9.0
"""Share of the frames with a burst, and the factor on their noise."""
DROP_SHARE, DROP_SHORTEST, DROP_LONGEST = 0.15, 3, 7
"""Share of the frames that are lost in runs (some runs overlap), and the lengths of a run."""
CAMERA_DEPTH_BLUNDER, CAMERA_FINGER_BLUNDER = 0.06, 3.0
"""Depth error in metres, and factor on the fingers' noise, in frames with a gross error."""
DEPTH_FRAMES, CAMERA_FRAMES = 15.0, 8.0
"""Correlation times of the drift of depth and of angles in the noise "camera", frames."""


@dataclass(frozen=True)
class Sizes:
    """Scale of the noise on each kind of parameter."""

    translation: float  # metres
    orientation: float  # radians, on each component of the global axis-angle
    fingers: float  # radians, on each component of the finger joints' axis-angle

    def scale(self, unit: Float[Tensor, "*B 51"]) -> Float[Tensor, "*B 51"]:
        """Unit noise on 3 translations, 3 global and 45 finger angles, scaled to these sizes."""
        sizes = [self.translation] * 3 + [self.orientation] * 3 + [self.fingers] * 45
        return unit * unit.new_tensor(sizes)


CAMERA_LASTING = Sizes(0.004, 0.06, 0.12)
"""Constant part of the noise "camera", to which `CAMERA_DEPTH` adds an error along the ray."""
CAMERA_DRIFTING = Sizes(0.0, 0.08, 0.12)
CAMERA_JITTER = Sizes(0.002, 0.02, 0.04)
CAMERA_DEPTH = (0.025, 0.01, 0.003)
"""Error along the ray in metres: its constant, its drifting and its white part."""

SIZES: dict[Noise, Sizes] = {
    "gauss": Sizes(0.01, 0.05, 0.3),  # the paper's, for ARCTIC
    "gauss_strong": Sizes(0.01, 0.1, 0.5),
    "beta": Sizes(0.01, 0.05, 0.3),  # times Beta(8, 2): mostly a constant of 0.8
    "bias": Sizes(0.008, 0.06, 0.25),
    "drift": Sizes(0.008, 0.06, 0.25),
    "burst": Sizes(0.003, 0.02, 0.1),
    "drop": Sizes(0.003, 0.02, 0.1),
}


def corrupt_sequence(sequence: Sequence, noise: Noise, *, generator: torch.Generator) -> Sequence:
    """The sequence with every hand corrupted; its source names the noise and the seed.

    Frames of zeros are first marked as not valid: with noise on them they would look like a hand.
    """
    ray = draw_ray(generator=generator) if noise == "camera" else None
    clean = map(without_collapsed, sequence.hands)
    hands = tuple(corrupt(hand, noise, ray=ray, generator=generator) for hand in clean)
    source = f"{noise} noise, seed {generator.initial_seed()}, on {sequence.source}"
    return replace(sequence, hands=hands, source=source)


def corrupt(
    hand: HandTrack,
    noise: Noise,
    *,
    ray: Float[Tensor, " 3"] | None = None,
    generator: torch.Generator,
) -> HandTrack:
    """A noisy version of a clean track.

    With a pose, noise is added to its axis-angle components, and the keypoints follow by forward
    kinematics of the clean track's skeleton. Without one, the bones of the keypoints are rotated
    about each joint by the same noise, in world axes. Lost frames are not valid and hold NaN.

    `ray` is the viewing direction of the noise "camera", which the noisy track stores; by default a
    random one. The generator must be on the CPU.
    """
    if noise == "camera":
        ray = draw_ray(generator=generator) if ray is None else ray
        hand = replace(hand, camera_ray=ray.to(hand.valid.device).expand(hand.frames, 3))
    offsets, keep = draw_noise(noise, hand.frames, ray=ray, generator=generator)
    return perturbed(hand, offsets.to(hand.valid.device), keep.to(hand.valid.device))


def perturbed(
    hand: HandTrack, offsets: Float[Tensor, "T 51"], keep: Bool[Tensor, " T"]
) -> HandTrack:
    """A track with offsets of `draw_noise` added; frames that are not in `keep` are lost.

    `joint_spread` is removed, because it no longer holds.
    """
    shift, turn = offsets[:, :3], offsets[:, 3:].unflatten(-1, (16, 3))

    def kept(values: Tensor) -> Tensor:
        return torch.where(keep.reshape(-1, *[1] * (values.ndim - 1)), values, math.nan)

    noisy = hand.changed(
        pose=lambda pose: kept(pose + turn),
        wrist=lambda wrist: kept(wrist + shift),
        joints=lambda _: kept(noisy_joints(hand, turn, shift)),
    )
    return replace(noisy, valid=hand.valid & keep, joint_spread=None)


def noisy_joints(
    hand: HandTrack, turn: Float[Tensor, "T 16 3"], shift: Float[Tensor, "T 3"]
) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a track after rotating its joints and shifting its wrist; bone lengths stay."""
    assert hand.joints is not None, "asked for the joints of a track that has none"
    wrist = hand.joints[:, 0] + shift
    if hand.pose is None:
        # Without a pose, the keypoints of each frame are the rest pose that is rotated.
        mano = hand.joints[:, list(MANO_FROM_OPENPOSE)]
        bones = mano[:, 1:] - mano[:, [*PARENTS[1:], *TIP_PARENTS]]
        return forward_kinematics(axis_angle_to_matrix(turn), wrist, bones)[0]
    skeleton = rest_offsets(axis_angle_to_matrix(hand.pose), hand.joints, hand.trust)
    return forward_kinematics(axis_angle_to_matrix(hand.pose + turn), wrist, skeleton)[0]


def draw_noise(
    noise: Noise, frames: int, *, ray: Float[Tensor, " 3"] | None, generator: torch.Generator
) -> tuple[Float[Tensor, "T 51"], Bool[Tensor, " T"]]:
    """Additive noise on the hand's parameters, and a mask of the frames that are kept.

    Offsets are for translation (3, metres), global rotation (3) and fingers (45, radians); the mask
    is all true except for "drop" and "camera", which needs the `ray` of `corrupt`. The generator
    must be on the CPU, so that all devices get the same noise.
    """
    shape, keep = (frames, 51), torch.ones(frames, dtype=torch.bool)
    match noise:
        case "gauss" | "gauss_strong":
            unit = torch.randn(shape, generator=generator)
        case "beta":
            unit = draw_beta(shape, generator=generator)
        case "bias":
            unit = torch.randn((1, 51), generator=generator).expand(shape).clone()
        case "drift":
            unit = ornstein_uhlenbeck(torch.randn(shape, generator=generator))
        case "burst":
            unit = torch.randn(shape, generator=generator)
            bursts = torch.rand((frames, 1), generator=generator) < BURST_SHARE
            unit = torch.where(bursts, BURST_FACTOR * unit, unit)
        case "drop":
            unit = torch.randn(shape, generator=generator)
            keep = draw_drops(frames, generator=generator)
        case "camera":
            assert ray is not None, "the noise of a camera needs its ray"
            return draw_camera(ray, frames, generator=generator)
        case _:
            assert_never(noise)
    return SIZES[noise].scale(unit), keep


def draw_beta(shape: tuple[int, ...], *, generator: torch.Generator) -> Float[Tensor, "..."]:
    """Draws from Beta(8, 2), the distribution of the eighth smallest of nine uniform numbers."""
    return torch.rand((*shape, 9), generator=generator).sort(-1).values[..., 7]


def ornstein_uhlenbeck(
    white: Float[Tensor, "*B T D"], frames: float = DRIFT_FRAMES
) -> Float[Tensor, "*B T D"]:
    """Stationary Ornstein-Uhlenbeck noise of unit variance, with a correlation time in frames,
    from white noise."""
    stay = math.exp(-1 / frames)
    return with_memory(white, stay, math.sqrt(1 - stay**2))


def with_memory(
    values: Float[Tensor, "*B T D"],
    stay: Float[Tensor, "*B 1"] | float,
    gain: Float[Tensor, "*B 1"] | float,
) -> Float[Tensor, "*B T D"]:
    """First-order recursive filter: y[t] = gain * x[t] + stay * y[t - 1], with y[0] = x[0]."""
    steps = [values[..., 0, :]]
    for t in range(1, values.shape[-2]):
        steps.append(stay * steps[-1] + gain * values[..., t, :])
    return torch.stack(steps, dim=-2)


def draw_drops(frames: int, *, generator: torch.Generator) -> Bool[Tensor, " T"]:
    """A mask without random runs of frames; clips too short for a run lose none."""
    starts = frames - DROP_LONGEST - 1
    if starts < 1:
        return torch.ones(frames, dtype=torch.bool)
    middle = (DROP_SHORTEST + DROP_LONGEST) / 2
    runs, lengths = max(1, round(frames * DROP_SHARE / middle)), (DROP_SHORTEST, DROP_LONGEST)
    return ~draw_runs(frames, (0, starts), runs, lengths, generator=generator).any(0)


def draw_runs(
    frames: int,
    starts: tuple[int, int],
    runs: int,
    lengths: tuple[int, int],
    *,
    generator: torch.Generator,
) -> Bool[Tensor, "R T"]:
    """Masks of random runs of frames, one row per run.

    A run begins at a frame from `starts[0]` to `starts[1] - 1`; `lengths` are the shortest and the
    longest run in frames.
    """
    start = torch.randint(*starts, (runs, 1), generator=generator)
    length = torch.randint(lengths[0], lengths[1] + 1, (runs, 1), generator=generator)
    frame = torch.arange(frames)
    return (frame >= start) & (frame < start + length)


def draw_ray(*, generator: torch.Generator) -> Float[Tensor, " 3"]:
    """A unit viewing direction, uniform on the sphere."""
    return normalize(torch.randn(3, generator=generator), dim=-1)


def draw_camera(
    ray: Float[Tensor, " 3"], frames: int, *, generator: torch.Generator
) -> tuple[Float[Tensor, "T 51"], Bool[Tensor, " T"]]:
    """Noise of a hand estimator with one fixed camera: mostly along the ray, and lasting.

    Depth and angles have a constant, a drifting and a white error. Runs of 1 to 3 frames (about 3%)
    have gross errors, runs of 2 to 6 frames (about 5%) are missing, none in clips under ten frames.
    `ray` is the unit direction from the camera, taken as far away, to the hand.
    """

    def unit(size: int, count: int = frames) -> Float[Tensor, "N D"]:
        return torch.randn((count, size), generator=generator)

    lasting, drifting, jitter = CAMERA_DEPTH
    depth = lasting * unit(1, 1) + jitter * unit(1)
    depth = depth + drifting * ornstein_uhlenbeck(unit(1), DEPTH_FRAMES)
    offsets = CAMERA_LASTING.scale(unit(51, 1)) + CAMERA_JITTER.scale(unit(51))
    offsets += CAMERA_DRIFTING.scale(ornstein_uhlenbeck(unit(51), CAMERA_FRAMES))
    runs = max(1, round(0.03 * frames / 2))
    blunders = draw_runs(frames, (0, frames), runs, (1, 3), generator=generator)
    sign = 2 * torch.randint(0, 2, (runs, 1), generator=generator) - 1
    depth = depth + CAMERA_DEPTH_BLUNDER * (blunders * sign).sum(0)[:, None]
    offsets[:, 6:] *= CAMERA_FINGER_BLUNDER ** blunders.sum(0)[:, None]
    offsets[:, :3] += depth * ray
    if frames < 10:
        return offsets, torch.ones(frames, dtype=torch.bool)
    runs = max(1, round(0.05 * frames / 4))
    return offsets, ~draw_runs(frames, (1, frames - 8), runs, (2, 6), generator=generator).any(0)
