"""How a hand moves about its grasp, in the frame of the part that it holds."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import Limited, Limits
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points, mirror_rotations
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.grasp_types import curled
from geneoh.synthesis.grasping.grasps import Grasps, Grips
from geneoh.synthesis.motions.object_motion import Schedule, Standing, minimum_jerk


@dataclass(frozen=True)
class HandMotionConfig(Limited):
    """Speed, range and small variations of hand motion."""

    LIMITS: ClassVar[Limits] = {
        **dict.fromkeys(("shift_period", "turn_period", "restless_period"), (1e-3, math.inf)),
        **dict.fromkeys(("repeat_period", "tremor_period"), (1e-3, math.inf)),
        "table_height": (-math.inf, math.inf),
    }

    reach_frames: tuple[float, float] = (18.0, 40.0)
    """Range of the duration of the wrist's approach, and of its departure, in frames."""
    opening_frames: tuple[float, float] = (8.0, 16.0)
    """Range of the time in which fingers close, and in which they open, in frames."""
    wrist_delay: float = 0.1  # time between grasp and wrist motion, as a share of the latter's time
    opening_lead: float = 0.3
    """Share of the opening time that has passed when the grasp ends (and is left when it starts):
    fingers leave the surface before the wrist."""
    away_direction: tuple[float, float, float] = (0.6, 1.0, 0.0)
    """Direction from the grasp to where hands start and end, in the hand's rest frame: towards the
    back of the hand and the forearm."""
    away_distance: tuple[float, float] = (0.06, 0.2)
    """Range of the factor on `away_direction` (which is no unit vector), metres."""
    away_std: float = 0.05  # standard deviation of the start and the end on each axis, metres
    table_height: float = 0.04  # least height of both over the grasp if there is a table, metres
    away_turn_std: float = 0.4
    """Standard deviation of the rotation from the grasp to start and end, radians on each axis."""
    regrasp_width: float = 4.0  # standard deviation of a regrasp's bell curve over time, frames
    regrasp_distance: float = 0.3
    """Distance of the wrist from the grasp in a regrasp, as a share of a start's distance."""
    regrasp_opening: float = 0.7  # opening of the fingers in a regrasp, as a share
    shift_noise: float = 0.001  # standard deviation of small shifts of the wrist, metres
    shift_period: float = 12.0  # frames over which they change
    turn_noise: float = 0.01  # standard deviation of small rotations of the hand, radians
    turn_period: float = 15.0  # frames over which they change
    grip_share: float = 0.6  # share of the hands that change their grip while they hold
    grip_frames: tuple[float, float] = (8.0, 40.0)  # range of the duration of a change, in frames
    restless_share: float = 0.5
    """Of these, the share that moves between its grips all the time, as when using a tool."""
    restless_period: float = 10.0  # frames over which their blend of grips changes
    restless_size: float = 2.0
    """Gain of the softmax that blends the grips; with large values hands jump between grips."""
    open_curl: tuple[float, float] = (0.05, 0.9)
    """Range of the curl of open fingers: people reach with their fingers more or less open."""
    curl_scatter: float = 0.3  # standard deviation of the log of the curl between fingers
    opening: tuple[float, float] = (0.5, 1.0)
    """Range of how far a hand opens, as a share of the way from the grasp to the open fingers."""
    lift_share: float = 0.15  # probability that a finger is lifted while the hand holds
    lift_time: tuple[float, float] = (0.2, 0.8)  # range of the lift's time, as a share of the clip
    lift_width: float = 7.0  # standard deviation of the lift's bell curve over time, frames
    lift_height: tuple[float, float] = (0.2, 0.6)
    """Range of how far lifted fingers open, as a share of the way to the open fingers."""
    repeat_share: float = 0.2
    """Share of the hands that lift the same fingers periodically, as when using a tool."""
    repeat_period: tuple[float, float] = (12.0, 40.0)  # range of that period, in frames
    tremor: float = 0.004  # standard deviation of finger joint tremor in the grasp, radians
    open_tremor: float = 0.04  # additional tremor of the open hand, radians
    tremor_period: float = 8.0  # frames over which the tremor changes
    together: float = 0.6
    """Correlation of the tremor between the flexions of the four fingers; recorded free motion
    (Leap Motion, leapjs-playback): 0.56 to 0.8."""


@dataclass(frozen=True)
class HandPhases(Bundle):
    """How far hands are from their grasp in each frame: 0 in the grasp, 1 away from it."""

    reach: Float[Tensor, "B T"]  # of the wrist, before the grasp
    leave: Float[Tensor, "B T"]  # of the wrist, after it
    opening: Float[Tensor, "B T"]  # of the fingers
    regrasp: Float[Tensor, "B T"]  # of the wrist, when it lets go for a moment and grasps again


def draw_phases(schedule: Schedule, config: HandMotionConfig, draws: Draws) -> HandPhases:
    """Phases of hands that reach, close, regrasp, open and leave at the times of `schedule`."""

    def away(frames: Float[Tensor, "B T"]) -> tuple[Tensor, Tensor]:
        """Phases of wrist and fingers by the number of frames to or from the grasp."""
        way = frames / draws.uniform(config.reach_frames, 1)
        opening = frames / draws.uniform(config.opening_frames, 1)
        return minimum_jerk(way - config.wrist_delay), minimum_jerk(opening + config.opening_lead)

    time = schedule.time
    reach, closing = away(schedule.close[:, None] - time)
    leave, opening = away(time - schedule.release[:, None])
    regrasp = bell(time - schedule.regrasp[:, None], config.regrasp_width)
    regrasp = regrasp * schedule.regrasps[:, None]
    opening = torch.maximum(torch.maximum(closing, opening), config.regrasp_opening * regrasp)
    return HandPhases(reach, leave, opening, regrasp)


def bell(frames: Float[Tensor, "B T"], width: float) -> Float[Tensor, "B T"]:
    """A bell curve over time with its top, 1, at zero."""
    return torch.exp(-0.5 * (frames / width) ** 2)


@dataclass(frozen=True)
class HandPath(Bundle):
    """B hands over T frames, in the frame of the part that they hold or in the world frame."""

    wrist: Float[Tensor, "B T 3"]
    turn: Float[Tensor, "B T 3 3"]  # global rotation
    fingers: Float[Tensor, "B T 15 3"]

    @property
    def pose(self) -> Float[Tensor, "B T 16 3"]:
        """Axis-angles of all joints."""
        return torch.cat([matrix_to_axis_angle(self.turn)[:, :, None], self.fingers], 2)

    def moved(
        self, rotation: Float[Tensor, "*#B 3 3"], shift: Float[Tensor, "*#B 3"]
    ) -> "HandPath":
        """The hands after a rigid motion of each frame, such as that into the world frame."""
        moved = Rigid(rotation, shift).compose(Rigid(self.turn, self.wrist))
        return HandPath(moved.translation, moved.rotation, self.fingers)

    def replaced(self, index: Int[Tensor, " C"], other: "HandPath") -> "HandPath":
        """These hands, with `other` in place of those at `index`."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return HandPath(*(own.index_copy(0, index, new) for own, new in pairs))

    def mirrored(self) -> "HandPath":
        """The mirror images at x = 0, which are hands of the other side."""
        turn, fingers = mirror_rotations(self.turn), mirror_axis_angle(self.fingers)
        return HandPath(mirror_points(self.wrist), turn, fingers)


def grip_motion(
    grasps: Grasps,
    grips: Grips | None,
    schedule: Schedule,
    free: Bool[Tensor, " B"] | None,
    config: HandMotionConfig,
    draws: Draws,
) -> HandPath:
    """Hands that move from their grasp through other grips while they hold.

    Only hands that are `free` do; the others share their object with a hand that is in the way.
    """
    first = axis_angle_to_matrix(grasps.pose[:, 0])
    still = torch.zeros_like(grasps.wrist)
    start = torch.cat([grasps.wrist, still, grasps.pose[:, 1:].flatten(1)], -1)
    path = start[:, None].expand(-1, schedule.frames, -1)
    if grips is not None and free is not None:
        turned = matrix_to_axis_angle(first[:, None].mT @ axis_angle_to_matrix(grips.pose[:, :, 0]))
        ends = torch.cat([grips.wrist, turned, grips.pose[:, :, 1:].flatten(2)], -1)
        steps = torch.diff(ends, dim=1, prepend=start[:, None])
        shifts = draws.chance(config.grip_share, 1, 1) & free[:, None, None]
        held = (schedule.release - schedule.close)[:, None]
        times = schedule.close[:, None] + held * draws.share(ends.shape[1]).sort(1).values
        way = (schedule.time[:, None] - times[:, None]) / draws.uniform(config.grip_frames, 1, 1)
        progress = minimum_jerk(way + 0.5)
        between = draws.smooth(schedule.frames, ends.shape[1] + 1, config.restless_period)
        between = torch.softmax(config.restless_size * between, -1).flip(-1).cumsum(-1).flip(-1)
        restless = draws.chance(config.restless_share, 1, 1)
        progress = torch.where(restless, between[..., 1:], progress)
        path = path + (progress * shifts) @ steps
    wrist, turned, fingers = path.split([3, 3, 45], -1)
    turn = first[:, None] @ axis_angle_to_matrix(turned)
    return HandPath(wrist, turn, fingers.unflatten(-1, (15, 3)))


def hand_ways(
    grasps: Grasps,
    standing: Standing,
    schedule: Schedule,
    config: HandMotionConfig,
    draws: Draws,
    *,
    grips: Grips | None = None,
    free: Bool[Tensor, " B"] | None = None,
) -> Callable[[Int[Tensor, " C"]], HandPath]:
    """A function that draws random motions for hands by index, new ones in every call: they
    approach, move a little while they hold, and leave, in the frame of the part that they hold.

    Of the hands that are `free` some move through `grips` while they hold.
    """
    phases = draw_phases(schedule, config, draws)
    held = grip_motion(grasps, grips, schedule, free, config, draws)

    def drawn(clips: Int[Tensor, " C"]) -> HandPath:
        some, when = held.take(clips, "B"), phases.take(clips, "B")
        own = Draws(len(clips), draws.generator)
        wrist, turn = _wrist_motion(some, standing.take(clips, "B"), when, config, own)
        return HandPath(wrist, turn, _finger_motion(some, when, config, own))

    return drawn


def _wrist_motion(
    held: HandPath, standing: Standing, phases: HandPhases, config: HandMotionConfig, draws: Draws
) -> tuple[Float[Tensor, "B T 3"], Float[Tensor, "B T 3 3"]]:
    """Wrist position and global rotation, from a random start to the grasp and to a random end."""
    frames = phases.reach.shape[1]
    back = held.turn[:, 0] @ torch.tensor(config.away_direction)
    up = standing.upright[:, 2]  # the world's vertical in the object's frame

    def place() -> Float[Tensor, "B 1 3"]:
        """A random offset from the grasp, away from the object; upwards if there is a table."""
        there = back * draws.uniform(config.away_distance, 1) + config.away_std * draws.normal(3)
        short = (config.table_height - (there * up).sum(-1, keepdim=True)).clamp(min=0)
        return (there + torch.where(standing.on_table[:, None], short, 0.0) * up)[:, None]

    reach, leave = phases.reach[..., None], phases.leave[..., None]
    path = reach * place() + leave * place()
    path = path + phases.regrasp[..., None] * config.regrasp_distance * place()
    shift = config.shift_noise * draws.smooth(frames, 3, config.shift_period)
    turn = reach * config.away_turn_std * draws.normal(1, 3)
    turn = turn + leave * config.away_turn_std * draws.normal(1, 3)
    turn = turn + config.turn_noise * draws.smooth(frames, 3, config.turn_period)
    return held.wrist + path + shift, held.turn @ axis_angle_to_matrix(turn)


def _finger_motion(
    held: HandPath, phases: HandPhases, config: HandMotionConfig, draws: Draws
) -> Float[Tensor, "B T 15 3"]:
    """Finger joints: open before and after the grasp, some lifted from the object in between."""
    frames, fingers = phases.opening.shape[1], held.fingers
    scatter = (config.curl_scatter * draws.normal(5)).exp()
    opened = curled(draws.uniform(config.open_curl, 1) * scatter)
    # never more bent than in the grasp: opening must not press a finger into the object
    opened[:, :12, 2] = torch.minimum(opened[:, :12, 2], fingers[:, :, :12, 2].amin(1))
    opened = opened[:, None]
    opening = phases.opening[..., None, None] * draws.uniform(config.opening, 1, 1, 1)
    fingers = fingers + opening * (opened - fingers)
    lifted = _lifted(frames, config, draws)
    fingers = fingers + lifted[..., None] * (opened - fingers)
    tremor = draws.smooth(frames, 46, config.tremor_period)
    tremor, common = tremor[..., :45].unflatten(-1, (15, 3)), tremor[..., 45:]
    own = (1 - config.together) ** 0.5 * tremor[:, :, :12, 2]
    tremor[:, :, :12, 2] = own + config.together**0.5 * common
    size = config.tremor + config.open_tremor * opening
    return fingers + tremor * size


def _lifted(frames: int, config: HandMotionConfig, draws: Draws) -> Float[Tensor, "B T 15"]:
    """Opening of each joint of lifted fingers: 0 as in the grasp, 1 as in the open hand."""
    time = torch.arange(frames, dtype=torch.float32)
    chosen = draws.chance(config.lift_share, 5).float()
    middle = draws.uniform(config.lift_time, 1) * frames
    period = draws.uniform(config.repeat_period, 1)
    repeats = draws.chance(config.repeat_share, 1)
    again = 0.5 - 0.5 * torch.cos(2 * math.pi * (time - middle) / period)
    height = torch.where(repeats, again, bell(time - middle, config.lift_width))
    raised = height[..., None] * chosen.repeat_interleave(3, dim=1)[:, None]
    return raised * draws.uniform(config.lift_height, 1, 1)
