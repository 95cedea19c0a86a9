"""From grasps to interactions at 30 frames a second: reach, close, carry, adjust, let go, leave.

What else there is in some of them: a table that the object is lifted from, slid on and put back on;
a joint that the hand works, or that swings while the object is held; a second hand; a grasp that is
given up for a moment and taken again.
"""

import math
from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle, skew
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.grasps import Grasps
from geneoh.synthesis.pose_prior import curled
from geneoh.synthesis.solids import Solids

SHORTEST_MOVE = 12.0
"""Frames that the object takes from one rest point to the next, at least."""
KEYFRAMES = 5
"""Rest points of the object's path; some coincide, so the object also stands still while held."""
TABLE_SHARE, SLID_SHARE = 0.6, 0.25
"""Share of the clips with a table, where the hand has room above it; of them, those whose object is
slid over it and never lifted."""
TABLE_SIDES = 16
"""Directions in which an object is tried to stand up."""
LIFTED = 0.03
"""How far over the table an object is carried, metres, besides what it is moved."""
SKIN = 0.012
"""From a keypoint to the skin around it, metres."""
WORKED_SHARE, STILL_SHARE = 0.8, 0.7
"""Share of the jointed objects whose joint moves; and whose first part stays where it is where the
hand holds the second: drawers are pulled, lids are opened."""
TOUCHED = 0.02
"""Distance within which a keypoint counts as at a part, metres."""
SWINGS = 9
"""States of the joint at which room for the hand is looked for."""
AGAIN_SHARE = 0.15
"""Share of the clips whose hand lets go for a moment and takes hold again."""
AGAIN_FRAMES = 16.0
"""How long before the end the object is put down for that."""


@dataclass(frozen=True)
class Interactions:
    """B right-hand interactions of T frames in the world frame, with their skeletons."""

    pose: Float[Tensor, "B T 16 3"]
    wrist: Float[Tensor, "B T 3"]
    offsets: Float[Tensor, "B 20 3"]
    rotation: Float[Tensor, "B T Q 3 3"]
    """Of the object's two parts to the world, with `translation`; a rigid object's are the same."""
    translation: Float[Tensor, "B T Q 3"]
    points: Float[Tensor, "B P 3"]
    """Object surface points in the frame of their part, with `normals` and `part` index."""
    normals: Float[Tensor, "B P 3"]
    part: Int[Tensor, "B P"]

    def chosen(self, which: Int[Tensor, " C"]) -> "Interactions":
        """Some of the interactions."""
        return Interactions(*(getattr(self, field.name)[which] for field in fields(self)))


def _ease(x: Float[Tensor, "*S"]) -> Float[Tensor, "*S"]:
    """Minimum-jerk profile from 0 to 1, clamped outside."""
    x = x.clamp(0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def smooth_noise(
    batch: int, frames: int, channels: int, period: float, *, generator: torch.Generator
) -> Float[Tensor, "B T C"]:
    """Smooth unit-variance noise that changes over about `period` frames."""
    time = torch.arange(-3 * int(period), 3 * int(period) + 1, dtype=torch.float32)
    kernel = torch.exp(-0.5 * (time / period) ** 2)
    kernel = kernel / kernel.square().sum().sqrt()
    white = torch.randn(batch * channels, 1, frames + len(kernel) - 1, generator=generator)
    smooth = torch.nn.functional.conv1d(white, kernel[None, None])
    return smooth.reshape(batch, channels, frames).transpose(1, 2)


def _between_rests(
    lift: Float[Tensor, " B"],
    release: Float[Tensor, " B"],
    rests: Float[Tensor, "B K C"],
    frames: int,
    *,
    generator: torch.Generator,
) -> Float[Tensor, "B T C"]:
    """From zero before `lift` by smooth moves through the rests to the last after `release`."""
    batch, count = rests.shape[:2]
    cuts = torch.rand(batch, count - 1, generator=generator).sort(1).values
    cuts = torch.cat([torch.zeros(batch, 1), cuts, torch.ones(batch, 1)], 1)
    # the last move ends with the release, where the hold is long enough for one at all
    latest = (release - lift - SHORTEST_MOVE).clamp(min=0)[:, None]
    starts = lift[:, None] + torch.minimum(cuts * (release - lift).clamp(min=0)[:, None], latest)
    time = torch.arange(frames, dtype=torch.float32)
    progress = (time[None, :, None] - starts[:, None, :-1]) / (
        (starts[:, 1:] - starts[:, :-1])[:, None].clamp(min=SHORTEST_MOVE)
    )
    return _ease(progress) @ torch.diff(rests, dim=1, prepend=torch.zeros_like(rests[:, :1]))


@dataclass(frozen=True)
class _Resting:
    """How B objects stand before they are lifted."""

    upright: Float[Tensor, "B 3 3"]
    """Object to world; z is up."""
    table: Bool[Tensor, " B"]


def _resting(
    joints: Float[Tensor, "B 21 3"],
    surface: Float[Tensor, "B P 3"],
    free: Bool[Tensor, " B"],
    *,
    generator: torch.Generator,
) -> _Resting:
    """Objects turned any way, or stood on a table so that the hand is above it.

    Args:
        joints: the hand that holds, in the object's frame.
        surface: points of the object.
        free: objects that float, as when a second hand holds them.
        generator: source of every random choice.
    """
    batch = len(joints)
    up = torch.nn.functional.normalize(
        torch.randn(batch, TABLE_SIDES, 3, generator=generator), dim=-1
    )
    low = (surface @ up.mT).amin(1)  # (B, sides)
    room = (joints @ up.mT).amin(1) - SKIN - low
    side = torch.where(room > 0, torch.rand(room.shape, generator=generator), -1.0).argmax(1)
    at = torch.arange(batch)
    wanted = torch.rand(batch, generator=generator) < TABLE_SHARE
    table = (room[at, side] > 0) & wanted & ~free
    up = up[at, side]
    # the shortest turn that stands the object up, then any about the vertical
    vertical = torch.tensor([0.0, 0.0, 1.0]).expand(batch, 3)
    cross, cosine = torch.linalg.cross(up, vertical), (up * vertical).sum(-1)
    bend = skew(cross)
    stand = torch.eye(3) + bend + bend @ bend / (1 + cosine).clamp(min=1e-4)[:, None, None]
    around = 2 * math.pi * torch.rand(batch, 1, generator=generator) * vertical
    standing = axis_angle_to_matrix(around) @ stand
    anyhow = axis_angle_to_matrix(2.0 * torch.randn(batch, 3, generator=generator))
    return _Resting(torch.where(table[:, None, None], standing, anyhow), table)


def _object_path(
    lift: Float[Tensor, " B"],
    release: Float[Tensor, " B"],
    rest: _Resting,
    frames: int,
    *,
    generator: torch.Generator,
) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
    """Object poses: at rest before `lift` and after `release`, smooth moves between rests.

    From a table it is lifted and put back upright, or slid over it.
    """
    batch = len(lift)
    moves = torch.rand(batch, KEYFRAMES, 1, generator=generator) < 0.75
    moves = moves & (torch.rand(batch, 1, 1, generator=generator) < 0.85)
    reach = torch.tensor([0.25, 0.25, 0.18])
    shift = (torch.randn(batch, KEYFRAMES, 3, generator=generator) * reach * moves).cumsum(1) * 0.7
    turn = (torch.randn(batch, KEYFRAMES, 3, generator=generator) * 0.8 * moves).cumsum(1) * 0.7

    slid = torch.rand(batch, 1, generator=generator) < SLID_SHARE
    down = slid | (torch.arange(KEYFRAMES) == KEYFRAMES - 1)  # (B, K): on the table
    raised = torch.where(down, 0.0, shift[..., 2].abs() + LIFTED * moves[..., 0])
    level = turn * torch.tensor([0.0, 0.0, 1.0])
    table = rest.table[:, None, None]
    shift = torch.where(table, torch.cat([shift[..., :2], raised[..., None]], -1), shift)
    turn = torch.where(table & down[..., None], level, turn)

    rests = torch.cat([shift, turn], dim=-1)
    shift, turn = _between_rests(lift, release, rests, frames, generator=generator).split(3, -1)
    return axis_angle_to_matrix(turn) @ rest.upright[:, None], shift


@dataclass(frozen=True)
class _Handled:
    """How the hand stands to the joint of its object."""

    held: Int[Tensor, " B"]
    """The part that it holds."""
    free: Float[Tensor, "B 2"]
    """How far the joint may go either way without the other part running into the hand."""


def _handled(solids: Solids, joints: Float[Tensor, "B 21 3"]) -> _Handled:
    """Which part a hand holds and how far the other may move; not at all where it holds both."""
    parts = [solids.only(part) for part in range(2)]
    near = torch.stack([part.signed_distance(joints) < TOUCHED for part in parts]).sum(-1)
    held = (near[1] > near[0]).long()
    states = torch.linspace(-1, 1, SWINGS)
    low, high = solids.travel[:, :1], solids.travel[:, 1:]
    travelled = torch.where(states < 0, -states * low, states * high)
    turn, shift = solids.joint_pose(travelled)
    # where the hand is to the other part, when that one or the one in the hand has moved
    hand = joints[:, None].expand(-1, SWINGS, -1, -1)
    second = ((hand - shift[:, :, None]) @ turn).flatten(1, 2)
    first = (hand @ turn.mT + shift[:, :, None]).flatten(1, 2)
    gap = torch.where(
        (held == 0)[:, None], parts[1].signed_distance(second), parts[0].signed_distance(first)
    )
    room = gap.unflatten(1, (SWINGS, -1)).amin(-1) > SKIN
    middle = SWINGS // 2
    above = room[:, middle:].long().cumprod(1).sum(1) - 1
    below = room[:, : middle + 1].flip(1).long().cumprod(1).sum(1) - 1
    share = torch.stack([below, above], dim=1).clamp(min=0) / middle
    one = (near > 0).sum(0) == 1
    return _Handled(held, solids.travel * share * one[:, None])


def _mirrored_path(
    rotation: Float[Tensor, "B T 3 3"], translation: Float[Tensor, "B T 3"]
) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
    """The same path seen in a mirror at x = 0."""
    flip = rotation.new_tensor([-1.0, 1.0, 1.0])
    return flip[:, None] * rotation * flip, translation * flip


def animate(
    grasps: Grasps,
    solids: Solids,
    frames: int,
    points: int,
    *,
    generator: torch.Generator,
    first: Int[Tensor, " B"] | None = None,
) -> Interactions:
    """One interaction of `frames` frames per grasp.

    The hand follows the grasp in the frame of the part it holds, and comes from and leaves to a
    random place in front of it with its fingers open; small smooth adjustments and single lifted
    fingers keep the hold alive.

    Args:
        grasps: the holds, in the objects' frames.
        solids: the objects.
        frames: length of every clip.
        points: surface points kept of each object.
        generator: source of every random choice.
        first: for a second hand, the number of the clip whose object it holds as well, seen in a
            mirror; -1 for every other clip. None: no clip has one.
    """
    batch = len(grasps.pose)
    first = torch.full((batch,), -1) if first is None else first
    second = first >= 0
    shared = second.clone()
    shared[first[second]] = True

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(batch, *shape, generator=generator)

    surface, normals = solids.surface_points(points, generator=generator)
    held_pose = axis_angle_to_matrix(grasps.pose)
    joints, _ = forward_kinematics(held_pose, grasps.wrist, grasps.offsets)
    rest = _resting(joints, surface, shared, generator=generator)
    handled = _handled(solids, joints)

    time = torch.arange(frames, dtype=torch.float32)[None]
    close = uniform(-0.25, 0.55) * frames  # negative: the clip starts in the middle of the hold
    hold = uniform(0.4, 1.1) * frames
    release = close + hold
    # of two hands, one holds until the other does
    lead = first.clamp(min=0)
    close = torch.where(second, torch.minimum(close, release[lead] - SHORTEST_MOVE), close)
    release = torch.where(second, torch.maximum(release, close[lead] + SHORTEST_MOVE), release)
    lift, put = close.clone(), release.clone()
    lift[first[second]] = torch.minimum(close[first[second]], close[second])
    put[first[second]] = torch.maximum(release[first[second]], release[second])
    again = (uniform(0.0, 1.0) < AGAIN_SHARE) & ~shared & (hold > 4 * AGAIN_FRAMES)
    put = torch.where(again, put - AGAIN_FRAMES - 8, put)

    works = (uniform(0.0, 1.0) < WORKED_SHARE) & solids.jointed & ~shared
    goals = torch.rand(batch, KEYFRAMES, generator=generator)
    goals = torch.lerp(handled.free[:, :1], handled.free[:, 1:], goals) * works[:, None]
    travelled = _between_rests(lift + 4, put - 4, goals[..., None], frames, generator=generator)
    rotation, translation = _object_path(lift + 4, put - 4, rest, frames, generator=generator)
    still = works & (handled.held == 1) & (uniform(0.0, 1.0) < STILL_SHARE)
    rotation = torch.where(still[:, None, None, None], rotation[:, :1], rotation)
    translation = torch.where(still[:, None, None], translation[:, :1], translation)
    seen = _mirrored_path(rotation[lead], translation[lead])
    rotation = torch.where(second[:, None, None, None], seen[0], rotation)
    translation = torch.where(second[:, None, None], seen[1], translation)
    joint = solids.joint_pose(travelled[..., 0])
    rotation = torch.stack([rotation, rotation @ joint[0]], dim=2)
    carried = (rotation[:, :, 0] @ joint[1][..., None])[..., 0]
    translation = torch.stack([translation, translation + carried], dim=2)

    def away(at: Tensor, before: float) -> tuple[Tensor, Tensor]:
        """How far from the hold (0 to 1): the wrist's way and the fingers' opening."""
        way = before * (at[:, None] - time) / uniform(18.0, 40.0, 1)
        opening = before * (at[:, None] - time) / uniform(8.0, 16.0, 1)
        return _ease(way - 0.1), _ease(opening + 0.3)

    wrist_in, open_in = away(close, 1.0)
    wrist_out, open_out = away(release, -1.0)
    # a moment without the hold, the object at rest
    moment = torch.exp(-0.5 * ((time - (release - AGAIN_FRAMES)[:, None]) / 4.0) ** 2)
    moment = moment * again[:, None]

    rotation_grasp = held_pose[:, 0]
    back = rotation_grasp @ torch.tensor([0.6, 1.0, 0.0])  # up off the palm and towards the forearm
    up = rest.upright[:, 2]  # the world's vertical in the object's frame

    def place() -> Tensor:
        there = back * uniform(0.06, 0.2, 1) + 0.05 * torch.randn(batch, 3, generator=generator)
        # on a table the hand comes from above
        short = 0.04 - (there * up).sum(-1, keepdim=True)
        return there + torch.where(rest.table[:, None], short.clamp(min=0), 0.0) * up

    path = wrist_in[..., None] * place()[:, None] + wrist_out[..., None] * place()[:, None]
    path = path + moment[..., None] * 0.3 * place()[:, None]
    slide = 0.001 * smooth_noise(batch, frames, 3, 12.0, generator=generator)
    wrist_object = grasps.wrist[:, None] + path + slide
    turn = wrist_in[..., None] * 0.4 * torch.randn(batch, 1, 3, generator=generator)
    turn = turn + wrist_out[..., None] * 0.4 * torch.randn(batch, 1, 3, generator=generator)
    orient_object = rotation_grasp[:, None] @ axis_angle_to_matrix(
        turn + 0.01 * smooth_noise(batch, frames, 3, 15.0, generator=generator)
    )

    # people reach with their fingers more or less open, no two fingers alike
    scatter = (0.3 * torch.randn(batch, 5, generator=generator)).exp()
    flat = curled(uniform(0.05, 0.9, 1) * scatter)[:, None]
    # but never more bent than in the grasp: to open must not press a finger into the object
    flat[:, :, :12, 2] = torch.minimum(flat[:, :, :12, 2], grasps.pose[:, None, 1:13, 2])
    openness = torch.maximum(torch.maximum(open_in, open_out), 0.7 * moment)
    openness = openness[..., None, None] * uniform(0.5, 1.0, 1, 1, 1)
    fingers = grasps.pose[:, None, 1:]
    fingers = fingers + openness * (flat - fingers)
    lifted = (torch.rand(batch, 5, generator=generator) < 0.15).float()
    beat = uniform(0.2, 0.8, 1) * frames
    bump = torch.exp(-0.5 * ((time - beat) / 7.0) ** 2)
    # a tool in use: the same fingers open and close again and again
    period, busy = uniform(12.0, 40.0, 1), torch.rand(batch, 1, generator=generator) < 0.2
    bump = torch.where(busy, 0.5 - 0.5 * torch.cos(2 * math.pi * (time - beat) / period), bump)
    raised = bump[..., None] * lifted.repeat_interleave(3, dim=1)[:, None]
    fingers = fingers + (raised * uniform(0.2, 0.6, 1, 1))[..., None] * (flat - fingers)
    tremble = smooth_noise(batch, frames, 45, 8.0, generator=generator).reshape(
        batch, frames, 15, 3
    )
    fingers = fingers + tremble * (0.004 + 0.04 * openness)

    at = torch.arange(batch)
    held_rotation, held_translation = (
        rotation[at, :, handled.held],
        translation[at, :, handled.held],
    )
    orient = matrix_to_axis_angle(held_rotation @ orient_object)
    return Interactions(
        pose=torch.cat([orient[:, :, None], fingers], dim=2),
        wrist=(held_rotation @ wrist_object[..., None])[..., 0] + held_translation,
        offsets=grasps.offsets,
        rotation=rotation,
        translation=translation,
        points=surface,
        normals=normals,
        part=solids.part_of(surface) * solids.jointed[:, None],
    )
