"""When a grasped object moves, in frames from the start of a clip, and how.

It stands or floats, is carried or slid, and its joint moves.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import Limited, Limits
from geneoh.geometry.mirror import mirror_points, mirror_rotations
from geneoh.geometry.rigid import Rigid, part_poses
from geneoh.geometry.rotations import axis_angle_to_matrix, shortest_turn
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.bimanual import HandPairs
from geneoh.synthesis.shapes.solids import Solids


@dataclass(frozen=True)
class ScheduleConfig:
    """Times of the events of a clip."""

    close: tuple[float, float] = (-0.25, 0.55)
    """Range of the time at which the hand has closed, as a share of the clip (< 0: before it)."""
    hold: tuple[float, float] = (0.4, 1.1)  # range of the grasp's duration, as a share of the clip
    grip_frames: float = 4.0
    """Frames from the closed hand to the object's first motion, and from its last to release."""
    shortest_move: float = 12.0  # fewest frames between rest points, as in recordings
    regrasp_share: float = 0.15
    """Share of the clips with a regrasp: the hand opens and grasps again while the object rests."""
    regrasp_frames: float = 16.0  # frames from the regrasp to the release
    regrasp_rest: float = 8.0
    """Frames that the object rests before a regrasp, in addition to `grip_frames`."""
    regrasp_hold: float = 64.0
    """Shortest grasp in frames that has a regrasp: the object needs time to move before."""


@dataclass(frozen=True)
class Schedule:
    """Times of the events of B clips, in frames; events before or after the clip are not seen."""

    frames: int  # length of every clip
    close: Float[Tensor, " B"]  # the hand has closed on the object
    release: Float[Tensor, " B"]  # the hand starts to open
    lift: Float[Tensor, " B"]
    """The object starts to move; before this hand closes if a second hand already holds it."""
    put_down: Float[Tensor, " B"]  # the object is at rest from here on
    regrasp: Float[Tensor, " B"]  # the hand is open for a moment, where `regrasps`
    regrasps: Bool[Tensor, " B"]
    shortest_move: float

    @property
    def time(self) -> Float[Tensor, " T"]:
        """The frames of a clip."""
        return torch.arange(self.frames, dtype=torch.float32)

    def moves(self, rests: Float[Tensor, "B K C"], draws: Draws) -> Float[Tensor, "B T C"]:
        """Smooth moves through rest points: zero before `lift`, the last one after `put_down`."""
        batch, count = rests.shape[:2]
        cuts = draws.share(count - 1).sort(1).values
        cuts = torch.cat([torch.zeros(batch, 1), cuts, torch.ones(batch, 1)], 1)
        held = self.put_down - self.lift
        # the last move ends when the object is put down, where the hold is long enough for a move
        latest = (held - self.shortest_move).clamp(min=0)[:, None]
        starts = self.lift[:, None] + torch.minimum(cuts * held.clamp(min=0)[:, None], latest)
        progress = (self.time[None, :, None] - starts[:, None, :-1]) / (
            (starts[:, 1:] - starts[:, :-1])[:, None].clamp(min=self.shortest_move)
        )
        steps = torch.diff(rests, dim=1, prepend=torch.zeros_like(rests[:, :1]))
        return minimum_jerk(progress) @ steps


def minimum_jerk(x: Float[Tensor, "*S"]) -> Float[Tensor, "*S"]:
    """Minimum-jerk profile from 0 to 1, constant outside."""
    x = x.clamp(0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def draw_schedule(frames: int, pairs: HandPairs, config: ScheduleConfig, draws: Draws) -> Schedule:
    """Random times; the grasps of two hands on one object overlap in time."""
    second, first = pairs.second, pairs.leader
    close = draws.uniform(config.close) * frames
    hold = draws.uniform(config.hold) * frames
    release = close + hold
    meet = release[first] - config.shortest_move
    close = torch.where(second, torch.minimum(close, meet), close)
    meet = close[first] + config.shortest_move
    release = torch.where(second, torch.maximum(release, meet), release)
    lift, put_down, leader = close.clone(), release.clone(), first[second]
    lift[leader] = torch.minimum(close[leader], close[second])
    put_down[leader] = torch.maximum(release[leader], release[second])
    regrasps = draws.chance(config.regrasp_share) & ~pairs.shared & (hold > config.regrasp_hold)
    earlier = put_down - config.regrasp_frames - config.regrasp_rest
    put_down = torch.where(regrasps, earlier, put_down)
    return Schedule(
        frames,
        close,
        release,
        lift + config.grip_frames,
        put_down - config.grip_frames,
        release - config.regrasp_frames,
        regrasps,
        config.shortest_move,
    )


@dataclass(frozen=True)
class ObjectMotionConfig(Limited):
    """How far and how often objects and their joints move while they are held."""

    LIMITS: ClassVar[Limits] = {"joint_states": (3, Limited.LARGEST)}

    rest_points: int = 5  # poses at which the object stops on its way, the last one included
    carry_share: float = 0.85  # share of the objects that are moved at all
    move_share: float = 0.75
    """Share of the rest points that differ from the previous one; else the object stays still."""
    shift_std: tuple[float, float, float] = (0.25, 0.25, 0.18)
    """Standard deviation of the translation between rest points, metres; z is vertical."""
    turn_std: float = 0.8  # standard deviation of the rotation between them, radians on each axis
    path_scale: float = 0.7  # factor on the sum of these steps: keeps objects within arm's reach
    orientation_std: float = 2.0
    """Standard deviation of an object's first orientation without a table, radians on each axis."""
    table_share: float = 0.6  # share of the clips with a table, if the hand has room above it
    slide_share: float = 0.25  # of those, the share that is slid over the table and never lifted
    table_directions: int = 16
    """Directions that are tried as an object's vertical; one with room for the hand is taken."""
    lift_height: float = 0.03
    """Height at which an object is carried over the table, metres, in addition to its path."""
    skin: float = 0.012  # distance from a keypoint to the skin around it, metres
    joint_share: float = 0.8  # share of the objects with a joint whose joint moves
    base_still_share: float = 0.7
    """Of those held by the second part, the share whose first part stays: a drawer is pulled."""
    touch: float = 0.02  # distance below which a keypoint counts as holding a part, metres
    joint_states: int = 9
    """Joint states in which clearance to the hand is tested; odd, the middle one is at rest."""


@dataclass(frozen=True)
class Standing(Bundle):
    """How B objects stand before they are lifted."""

    upright: Float[Tensor, "B 3 3"]  # rotation from the object to the world, whose z axis points up
    on_table: Bool[Tensor, " B"]


def draw_standing(
    joints: Float[Tensor, "B 21 3"],
    surface: Float[Tensor, "B P 3"],
    floating: Bool[Tensor, " B"],
    config: ObjectMotionConfig,
    draws: Draws,
) -> Standing:
    """Objects of random orientation, or standing on a table such that the hand is above it.

    Keypoints and surface are in the object's frame; `floating` objects have no table.
    """
    up = torch.nn.functional.normalize(draws.normal(config.table_directions, 3), dim=-1)
    room = (joints @ up.mT).amin(1) - config.skin - (surface @ up.mT).amin(1)
    side = torch.where(room > 0, draws.share(config.table_directions), -1.0).argmax(1)
    clip = torch.arange(len(joints))
    on_table = (room[clip, side] > 0) & draws.chance(config.table_share) & ~floating
    around = 2 * math.pi * draws.share(1) * torch.eye(3)[2]
    standing = axis_angle_to_matrix(around) @ shortest_turn(up[clip, side], torch.eye(3)[2])
    orientation = config.orientation_std * draws.normal(3)
    upright = torch.where(on_table[:, None, None], standing, axis_angle_to_matrix(orientation))
    return Standing(upright, on_table)


@dataclass(frozen=True)
class HeldPart:
    """Which part of B objects the hand holds, and how far the joints may move in that grasp."""

    index: Int[Tensor, " B"]
    travel: Float[Tensor, "B 2"]
    """Range of the joint in which the other part stays clear of the hand, as `Solids.travel`; zero
    where the hand holds both parts."""


def held_part(
    solids: Solids, joints: Float[Tensor, "B 21 3"], config: ObjectMotionConfig
) -> HeldPart:
    """The part that more of the hand's keypoints touch, and the other part's range of travel."""
    states = config.joint_states
    parts = [solids.only(part) for part in range(2)]
    near = torch.stack([part.signed_distance(joints) < config.touch for part in parts]).sum(-1)
    held = (near[1] > near[0]).long()
    state = torch.linspace(-1, 1, states)
    low, high = solids.travel[:, :1], solids.travel[:, 1:]
    turn, shift = solids.joint_pose(torch.where(state < 0, -state * low, state * high))
    # the hand in the frame of the part that it does not hold, for each state of the joint
    hand = joints[:, None].expand(-1, states, -1, -1)
    second = ((hand - shift[:, :, None]) @ turn).flatten(1, 2)
    first = (hand @ turn.mT + shift[:, :, None]).flatten(1, 2)
    gap = torch.where(
        (held == 0)[:, None], parts[1].signed_distance(second), parts[0].signed_distance(first)
    )
    room = gap.unflatten(1, (states, -1)).amin(-1) > config.skin
    middle = states // 2
    above = room[:, middle:].long().cumprod(1).sum(1) - 1
    below = room[:, : middle + 1].flip(1).long().cumprod(1).sum(1) - 1
    share = torch.stack([below, above], dim=1).clamp(min=0) / middle
    holds_one = (near > 0).sum(0) == 1
    return HeldPart(held, solids.travel * share * holds_one[:, None])


def carried_path(
    schedule: Schedule, standing: Standing, config: ObjectMotionConfig, draws: Draws
) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
    """Rotation and translation of the first part: at rest before `lift` and after `put_down`.

    From a table the object is lifted and put back upright, or slid over it.
    """
    rests = config.rest_points
    moves = draws.chance(config.move_share, rests, 1) & draws.chance(config.carry_share, 1, 1)
    shift = draws.normal(rests, 3) * torch.tensor(config.shift_std) * moves
    shift = shift.cumsum(1) * config.path_scale
    turn = (draws.normal(rests, 3) * config.turn_std * moves).cumsum(1) * config.path_scale

    # (B, K): rest points on the table
    down = draws.chance(config.slide_share, 1) | (torch.arange(rests) == rests - 1)
    raised = shift[..., 2].abs() + config.lift_height * moves[..., 0]
    above = torch.cat([shift[..., :2], torch.where(down, 0.0, raised)[..., None]], -1)
    on_table = standing.on_table[:, None, None]
    shift = torch.where(on_table, above, shift)
    turn = torch.where(on_table & down[..., None], turn * torch.eye(3)[2], turn)

    path = schedule.moves(torch.cat([shift, turn], dim=-1), draws)
    translation, turn = path.split(3, -1)
    return axis_angle_to_matrix(turn) @ standing.upright[:, None], translation


def carry(
    solids: Solids,
    held: HeldPart,
    standing: Standing,
    schedule: Schedule,
    pairs: HandPairs,
    config: ObjectMotionConfig,
    draws: Draws,
) -> tuple[Float[Tensor, "B T 2 3 3"], Float[Tensor, "B T 2 3"]]:
    """Rotations and translations of both parts, object to world.

    The object of a second hand moves as the mirror image of the first hand's object.
    """
    works = draws.chance(config.joint_share) & solids.jointed & ~pairs.shared
    goals = draws.share(config.rest_points)
    goals = torch.lerp(held.travel[:, :1], held.travel[:, 1:], goals) * works[:, None]
    travelled = schedule.moves(goals[..., None], draws)[..., 0]
    rotation, translation = carried_path(schedule, standing, config, draws)

    still = draws.chance(config.base_still_share) & works & (held.index == 1)
    still = still[:, None, None]
    rotation = torch.where(still[..., None], rotation[:, :1], rotation)
    translation = torch.where(still, translation[:, :1], translation)
    second = pairs.second[:, None, None]
    mirrored = mirror_rotations(rotation[pairs.leader])
    rotation = torch.where(second[..., None], mirrored, rotation)
    translation = torch.where(second, mirror_points(translation[pairs.leader]), translation)

    return part_poses(Rigid(rotation, translation), Rigid(*solids.joint_pose(travelled)))
