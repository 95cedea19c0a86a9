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
from geneoh.synthesis.draws import Draws, smoothed_motion

ANKLE_HEIGHT = 0.075  # of the embedded skeleton over the ground, metres
FEET_SMOOTHING = 2.5  # standard deviation of the Gaussian over the pelvis positions, frames
BODIES = 400  # number of bodies of different proportions; `Gestures.body` is an index of one


@dataclass(frozen=True)
class StanceConfig:
    """How bodies differ and move; angles in radians."""

    height: float = 0.06  # standard deviation of the log of a body's size
    proportion: float = 0.03  # the same of legs, trunk, arms and hands each, in addition
    shoulders: float = 0.05  # the same of the shoulders' width, in addition
    lean: tuple[float, float] = (-0.04, 0.14)  # range of the trunk's bend forward
    sway: float = 0.018  # standard deviation of the trunk's slow motion
    follow: float = 0.12  # turn of the trunk to the side of an active hand
    gaze: float = 0.28  # largest turn of the head to that side
    nod: float = 0.05  # standard deviation of the head's own motion
    stroke: float = 0.03  # bend of the trunk forward with the strokes of both hands
    drift: float = 0.12  # standard deviation of slow turns of the whole body
    step: tuple[float, float] = (0.28, 0.42)  # range of the amplitude of a leg's swing
    cadence: tuple[float, float] = (0.75, 1.0)  # range of walking cycles per second
    arm_swing: float = 0.3  # swing of a resting hand per swing of a leg, metres per radian


@dataclass(frozen=True)
class Gait:
    """Whether B people sit, stand or walk, and the swing of their legs while they walk."""

    seated: Bool[Tensor, " B"]
    swing: Float[Tensor, "B T"]  # forward swing of the left leg, radians; zero without steps
    rate: Float[Tensor, "B T"]  # of that swing, radians a second

    @property
    def walking(self) -> Bool[Tensor, " B"]:
        """Whether each person walks."""
        return (self.rate != 0).any(1)


def draw_gait(
    seated: Bool[Tensor, " B"],
    walking: Bool[Tensor, " B"],
    frames: int,
    config: StanceConfig,
    draws: Draws,
) -> Gait:
    """Random gaits; a person who is `seated` does not walk."""
    walking = walking & ~seated
    cadence = draws.uniform(config.cadence, 1)
    time = torch.arange(frames) / FPS
    phase = cadence * time + draws.share(1)
    size = draws.uniform(config.step, 1) * walking[:, None]
    turn = 2 * math.pi * phase
    return Gait(seated, size * torch.sin(turn), 2 * math.pi * cadence * size * torch.cos(turn))


def body_offsets(number: int, config: StanceConfig) -> Float[Tensor, "52 3"]:
    """The skeleton of a body by its index: the embedded one with other proportions."""
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
    """Bodies with legs, trunk and head that follow the activity of the hands; arms are not posed.

    `active` (0 at rest, 1 in the gesture) and `strokes` (position in a stroke, 0 to 1) are of the
    left and the right hand.
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
    """Pelvis positions that put the lower foot on the ground and keep it still during a step."""
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
