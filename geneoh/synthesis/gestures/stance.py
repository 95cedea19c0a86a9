"""How the rest of a body stands, sits or walks while its hands do something."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import BODY_PARENTS, JOINT_NAMES, Skeleton, embedded_skeleton
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.seeds import seeded_generator
from geneoh.synthesis.actions.action import FPS
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.motions.smoothing import smoothed_motion

ANKLE_HEIGHT = 0.075  # of the embedded skeleton over the ground, metres
FEET_SMOOTHING = 2.5  # deviation in frames of the filter on the pelvis over stepping feet
BODIES = 400
"""Bodies of different proportions; `Gestures.body` is one of their numbers."""


@dataclass(frozen=True)
class StanceConfig:
    """How bodies differ and move; angles in radians."""

    height: float = 0.06  # deviation of the logarithm of a body's size
    proportion: float = 0.03  # of that of legs, trunk, arms and hands beside it
    shoulders: float = 0.05  # of that of the shoulders' width
    lean: tuple[float, float] = (-0.04, 0.14)  # range of the trunk's bend forward
    sway: float = 0.018  # deviation of its slow motion
    follow: float = 0.12  # turn of the trunk to the side of a hand that is active
    gaze: float = 0.28  # turn of the head to it
    nod: float = 0.05  # deviation of the head's own motion
    stroke: float = 0.03  # what the trunk follows of a hand's strokes
    drift: float = 0.12  # deviation of slow turns of the whole body
    step: tuple[float, float] = (0.28, 0.42)  # range of a leg's swing to each side
    cadence: tuple[float, float] = (0.75, 1.0)  # range of walking cycles a second
    arm_swing: float = 0.3  # of a resting arm's swing to that of its leg, metres a radian


@dataclass(frozen=True)
class Gait:
    """How B people hold themselves, and where they are in their steps, if they walk."""

    seated: Bool[Tensor, " B"]
    swing: Float[Tensor, "B T"]  # forward swing of the left leg, radians; zero without steps
    rate: Float[Tensor, "B T"]  # of that swing, radians a second

    @property
    def walking(self) -> Bool[Tensor, " B"]:
        """Who walks."""
        return (self.rate != 0).any(1)


def draw_gait(
    seated: Bool[Tensor, " B"],
    walking: Bool[Tensor, " B"],
    frames: int,
    config: StanceConfig,
    draws: Draws,
) -> Gait:
    """Steps of those who walk."""
    walking = walking & ~seated
    cadence = draws.uniform(config.cadence, 1)
    time = torch.arange(frames) / FPS
    phase = cadence * time + draws.share(1)
    size = draws.uniform(config.step, 1) * walking[:, None]
    turn = 2 * math.pi * phase
    return Gait(seated, size * torch.sin(turn), 2 * math.pi * cadence * size * torch.cos(turn))


def body_skeletons(numbers: list[int], config: StanceConfig) -> Skeleton:
    """The bodies of these numbers: the embedded one with other proportions."""
    return Skeleton(torch.stack([_body(number, config) for number in numbers]))


def _body(number: int, config: StanceConfig) -> Float[Tensor, "52 3"]:
    draws = Draws(1, seeded_generator("body", number))
    size, legs, trunk, arms, hands = (draws.normal(5)[0]).tolist()
    wide = draws.normal()[0].item()
    scale = torch.full((len(JOINT_NAMES),), config.height * size)
    for joint, name in enumerate(JOINT_NAMES):
        part = (
            hands if joint >= len(BODY_PARENTS)
            else legs if any(each in name for each in ("knee", "ankle", "foot"))
            else arms if any(each in name for each in ("elbow", "wrist"))
            else trunk
        )  # fmt: skip
        scale[joint] += config.proportion * part
        if "shoulder" in name or "collar" in name:
            scale[joint] += config.shoulders * wide
    return scale.exp()[:, None] * embedded_skeleton().offsets


def standing_bodies(
    skeleton: Skeleton,
    gait: Gait,
    active: Float[Tensor, "B T 2"],
    strokes: Float[Tensor, "B T 2"],
    fingers: Float[Tensor, "B T 30 3 3"],
    config: StanceConfig,
    draws: Draws,
) -> BodyMotion:
    """Legs, trunk and head of people whose left and right hands are active; arms are left out.

    `active` is how far each hand is from its rest, left and right, and `strokes` how far it is in a
    stroke, both from 0 to 1.
    """
    frames = active.shape[1]
    turned = torch.zeros(draws.batch, frames, len(BODY_PARENTS), 3)
    # a trunk and a head turn to the left about +y
    side = active[..., 0] - active[..., 1]
    bent = 0.5 * strokes.sum(-1) * config.stroke
    lean = draws.uniform(config.lean, 1)
    for name, share in (("spine1", 0.3), ("spine2", 0.35), ("spine3", 0.35)):
        slow = config.sway * draws.smooth(frames, 3, 22.0)
        own = torch.stack([lean + bent, config.follow * side, torch.zeros_like(side)], -1)
        turned[:, :, JOINT_NAMES.index(name)] = share * own + slow
    gaze = draws.share(1) * config.gaze * side
    for name in ("neck", "head"):
        own = torch.stack([-0.3 * lean.expand(-1, frames), 0.5 * gaze, torch.zeros_like(gaze)], -1)
        turned[:, :, JOINT_NAMES.index(name)] = own + config.nod * draws.smooth(frames, 3, 16.0)
    _pose_legs(turned, gait, draws)
    heading = config.drift * draws.smooth(frames, 1, 45.0)[..., 0]
    turned[:, :, 0, 1] = heading - heading[:, :1]
    turned[:, :, 0, ::2] = 0.4 * config.sway * draws.smooth(frames, 2, 30.0)
    rotations = axis_angle_to_matrix(turned)
    motion = BodyMotion(torch.zeros(draws.batch, frames, 3), torch.cat([rotations, fingers], 2))
    return BodyMotion(_root(skeleton, motion, gait), motion.rotations)


def _pose_legs(turned: Float[Tensor, "B T 22 3"], gait: Gait, draws: Draws) -> None:
    """Hips, knees and ankles: nearly straight, bent at right angles, or in steps."""
    bend = torch.where(gait.seated, 1.45 + 0.1 * draws.normal(), 0.05 + 0.05 * draws.share())
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        # a knee bends while its leg comes forward
        forward, ahead = sign * gait.swing, (sign * gait.rate).clamp(min=0)
        knee = torch.where(gait.seated, bend, 2 * bend)[:, None] + 0.28 * ahead
        turned[:, :, JOINT_NAMES.index(f"{side}_hip"), 0] = -bend[:, None] - forward
        turned[:, :, JOINT_NAMES.index(f"{side}_hip"), 2] = sign * 0.06
        turned[:, :, JOINT_NAMES.index(f"{side}_knee"), 0] = knee
        turned[:, :, JOINT_NAMES.index(f"{side}_ankle"), 0] = bend[:, None] - knee + forward


def _root(skeleton: Skeleton, motion: BodyMotion, gait: Gait) -> Float[Tensor, "B T 3"]:
    """Where the pelvis is, so that the lower foot is on the ground and stays while it steps."""
    posed = pose(skeleton, motion).positions
    ankles = posed[:, :, [JOINT_NAMES.index(f"{side}_ankle") for side in ("left", "right")]]
    lowest = torch.where(gait.walking[:, None], ankles[..., 1].amin(2), ankles[..., 1].mean(2))
    # the foot on the ground moves back under the body
    on_left = torch.sigmoid((ankles[..., 1, 1] - ankles[..., 0, 1]) / 0.01)[..., None]
    moved = torch.diff(ankles, dim=1, prepend=ankles[:, :1])
    back = on_left * moved[:, :, 0] + (1 - on_left) * moved[:, :, 1]
    way = -(back * gait.walking[:, None, None]).cumsum(1)
    still = ankles.mean(2)
    planted = torch.where(gait.walking[:, None, None], way, still[:, :1] - still)
    root = torch.stack([planted[..., 0], ANKLE_HEIGHT - lowest, planted[..., 2]], -1)
    return smoothed_motion(root, FEET_SMOOTHING)
