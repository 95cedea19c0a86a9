"""How a hand moves about its grasp, in the frame of the part that it holds."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points, mirror_rotations
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.grasps import Grasps, Grips
from geneoh.synthesis.grasping.pose_prior import curled
from geneoh.synthesis.motions.object_motion import Standing
from geneoh.synthesis.motions.schedule import Schedule, minimum_jerk


@dataclass(frozen=True)
class HandMotionConfig:
    """How fast, how far and how restlessly hands move."""

    reach_frames: tuple[float, float] = (18.0, 40.0)
    """Range of the frames that the wrist takes to come, and to leave."""
    opening_frames: tuple[float, float] = (8.0, 16.0)
    """Range of the frames that the fingers take to close, and to open."""
    wrist_delay: float = 0.1  # time from the grasp to the wrist's motion, as a share of its way
    opening_lead: float = 0.3
    """How far the fingers are open at the grasp, as a share: off the surface before the wrist."""
    away_direction: tuple[float, float, float] = (0.6, 1.0, 0.0)
    """Where hands come from, in the hand's frame: off the palm and towards the forearm."""
    away_distance: tuple[float, float] = (0.06, 0.2)
    """Range of the distance from there to the grasp, in lengths of `away_direction`, metres."""
    away_std: float = 0.05  # deviation of that place on each axis, metres
    table_height: float = 0.04  # least height of that place over the grasp above a table, metres
    away_turn_std: float = 0.4
    """Deviation of the hand's orientation there from that of the grasp, radians on each axis."""
    regrasp_width: float = 4.0  # half duration of a moment without the grasp, frames (bell curve)
    regrasp_distance: float = 0.3
    """How far the wrist goes in that moment, as a share of its way from the object."""
    regrasp_opening: float = 0.7  # how far the fingers open in that moment, as a share
    shift_noise: float = 0.001  # deviation of the wrist's small adjustments while it holds, metres
    shift_period: float = 12.0  # frames over which they change
    turn_noise: float = 0.01  # deviation of small adjustments of the hand's orientation, radians
    turn_period: float = 15.0  # frames over which they change
    grip_share: float = 0.6  # share of the hands that shift from grip to grip while they hold
    grip_frames: tuple[float, float] = (8.0, 40.0)  # range of the frames that a hand takes to shift
    restless_share: float = 0.5
    """Of those that shift, the share that is always between its grips, as in the use of a tool."""
    restless_period: float = 10.0  # frames over which their place between the grips changes
    restless_size: float = 2.0
    """How far they go from the middle: with large numbers from one grip to the next."""
    open_curl: tuple[float, float] = (0.05, 0.9)
    """Range of the curl of open fingers: people reach with their fingers more or less open."""
    curl_scatter: float = 0.3  # deviation of the logarithm of the curl from finger to finger
    opening: tuple[float, float] = (0.5, 1.0)
    """Range of the share of the way to the open fingers that a hand goes."""
    lift_share: float = 0.15  # share of the fingers that are lifted while the hand holds
    lift_time: tuple[float, float] = (0.2, 0.8)  # range of the time of that, as a share of the clip
    lift_width: float = 7.0  # half duration of it, frames (deviation of a bell curve)
    lift_height: tuple[float, float] = (0.2, 0.6)
    """Range of how far they open, as a share of the way to the open fingers."""
    repeat_share: float = 0.2
    """Share of the hands that lift the same fingers again and again, as with a tool in use."""
    repeat_period: tuple[float, float] = (12.0, 40.0)  # range of frames from one time to the next
    tremor: float = 0.004  # deviation of the finger joints' motion while the hand holds, radians
    open_tremor: float = 0.04  # what is added to it while the hand is open, radians
    tremor_period: float = 8.0  # frames over which it changes
    together: float = 0.6
    """Correlation of that motion between the flexions of the four fingers; recorded free motion
    (Leap Motion, leapjs-playback): 0.56 to 0.8."""


@dataclass(frozen=True)
class HandPhases(Bundle):
    """How far hands are from their grasp in each frame: 0 in the grasp, 1 away from it."""

    reach: Float[Tensor, "B T"]  # of the wrist, before the grasp
    leave: Float[Tensor, "B T"]  # of the wrist, after it
    opening: Float[Tensor, "B T"]  # of the fingers
    regrasp: Float[Tensor, "B T"]  # of a moment without the grasp


def draw_phases(schedule: Schedule, config: HandMotionConfig, draws: Draws) -> HandPhases:
    """When hands reach, close, let go for a moment, open and leave."""

    def away(frames: Float[Tensor, "B T"]) -> tuple[Tensor, Tensor]:
        """Phases of wrist and fingers, so many frames from the grasp."""
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
    """B hands in each of T frames, in the frame of what they hold or of the world."""

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
        """The same hands in another frame."""
        moved = Rigid(rotation, shift).compose(Rigid(self.turn, self.wrist))
        return HandPath(moved.translation, moved.rotation, self.fingers)

    def replaced(self, index: Int[Tensor, " C"], other: "HandPath") -> "HandPath":
        """These hands, with others in place of those of the given numbers."""
        own = (getattr(self, each.name) for each in fields(self))
        new = (getattr(other, each.name) for each in fields(self))
        return HandPath(*(a.index_copy(0, index, b) for a, b in zip(own, new, strict=True)))

    def mirrored(self) -> "HandPath":
        """The hands of the other side on the mirror images."""
        turn, fingers = mirror_rotations(self.turn), mirror_axis_angle(self.fingers)
        return HandPath(mirror_points(self.wrist), turn, fingers)


def grip_motion(
    grasps: Grasps,
    grips: Grips | None,
    schedule: Schedule,
    free: Bool[Tensor, " B"],
    config: HandMotionConfig,
    draws: Draws,
) -> HandPath:
    """Hands that shift from their grasp to other grips while they hold, one after the other.

    Only those that are `free` do: others have another hand in their way.
    """
    first = axis_angle_to_matrix(grasps.pose[:, 0])
    still = torch.zeros_like(grasps.wrist)
    start = torch.cat([grasps.wrist, still, grasps.pose[:, 1:].flatten(1)], -1)
    path = start[:, None].expand(-1, schedule.frames, -1)
    if grips is not None:
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


def hand_motions(
    held: HandPath,
    standing: Standing,
    phases: HandPhases,
    config: HandMotionConfig,
    generator: torch.Generator,
) -> Callable[[Int[Tensor, " C"]], HandPath]:
    """A function that draws motions of the hands of the given numbers, others in every call: they
    come to what they hold, move a little while they do, and leave."""

    def drawn(clips: Int[Tensor, " C"]) -> HandPath:
        some, when = held.take(clips, "B"), phases.take(clips, "B")
        draws = Draws(len(clips), generator)
        wrist, turn = _wrist_motion(some, standing.take(clips, "B"), when, config, draws)
        return HandPath(wrist, turn, _finger_motion(some, when, config, draws))

    return drawn


def _wrist_motion(
    held: HandPath,
    standing: Standing,
    phases: HandPhases,
    config: HandMotionConfig,
    draws: Draws,
) -> tuple[Float[Tensor, "B T 3"], Float[Tensor, "B T 3 3"]]:
    """Wrist and global rotation: from a place before the object to the grasp and to another."""
    frames = phases.reach.shape[1]
    back = held.turn[:, 0] @ torch.tensor(config.away_direction)
    up = standing.upright[:, 2]  # the world's vertical in the object's frame

    def place() -> Float[Tensor, "B 1 3"]:
        """A place away from the object, from the grasp; on a table, above it."""
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
    # never more bent than in the grasp: to open must not press a finger into the object
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
    """How far each finger joint is on its way to the open hand while a finger is lifted."""
    time = torch.arange(frames, dtype=torch.float32)
    chosen = draws.chance(config.lift_share, 5).float()
    middle = draws.uniform(config.lift_time, 1) * frames
    period = draws.uniform(config.repeat_period, 1)
    repeats = draws.chance(config.repeat_share, 1)
    again = 0.5 - 0.5 * torch.cos(2 * math.pi * (time - middle) / period)
    height = torch.where(repeats, again, bell(time - middle, config.lift_width))
    raised = height[..., None] * chosen.repeat_interleave(3, dim=1)[:, None]
    return raised * draws.uniform(config.lift_height, 1, 1)
