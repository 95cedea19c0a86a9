"""Hands brought to the surface they hold: penetration and gaps that a network leaves are removed.

Ours. Several poses of a hold are optimised with the grasp energy of the training data
(`geneoh.synthesis.grasping.grasps`), and the best is kept. While the object moves, the hand keeps
this pose relative to it, so that contact lasts; if it rests, the correction applies to all frames
of contact. It fades out on the ways to and from the object, on which hands are pushed out of it.

A hand around a handle or the edge of a lid can leave only in some directions, and one around a pole
only with open fingers. Where its sampled way passes through the object, straight ways are tried,
and the one is taken in which the hand penetrates the object, the table and the other hand least.
"""

from dataclasses import replace
from itertools import product

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.generators.text2hoi.physics.held_hands import (
    FIRM,
    PAD_TOUCH,
    HeldHands,
    Holding,
    frames_of_motion,
    lifted,
    mean_offsets,
    new_hold,
    table_of,
)
from geneoh.generators.text2hoi.physics.resting import touching_hands
from geneoh.generators.text2hoi.physics.standing import StandingObject
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    interpolate_rotations,
    matrix_to_axis_angle,
)
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.grasping.contact_pads import Obstacles, OtherHands, Table
from geneoh.synthesis.grasping.grasp_energy import GraspEnergy
from geneoh.synthesis.grasping.grasps import GraspConfig, Grasps, settled_grasps
from geneoh.synthesis.motions.object_motion import minimum_jerk
from geneoh.synthesis.shapes.objects import scanned_object
from geneoh.synthesis.shapes.scans import MeshFolder, build_scans
from geneoh.synthesis.shapes.solids import Solids

PULLED_WITHIN = 0.012
"""Distance from the surface within which a pad of the hand is pulled to it, metres."""
TOO_DEEP = 0.004  # penetration depth of a hold above which a new one is synthesised, metres
POSES_TRIED = 5  # poses of a hold that are optimised; the best is kept
LOOSE_COST = 20.0
"""Number of touching pads that bearing pushes from all sides is worth, relative to bearing none."""
FADE = 40.0  # frames over which the correction fades out; with 15, hands jerked to their holds
PUSHES = 12  # iterations that push a hand out of what it penetrates
SMOOTH = 2.0  # standard deviation of the smoothing of these pushes, frames
SETTLING = GraspConfig(
    steps=80,
    wrist_rate=0.003,
    angle_rate=0.02,
    energy=GraspEnergy(liked=0.5),  # fingers stay nearer to the sampled pose
)
BACK, OUT = (0.06, 0.12), 12.0
"""Distances that a hand may retreat from its hold, metres, and the frames that this takes."""
STRAIGHTENED, OPENING = 0.6, 6.0
"""Share of the fingers' bend that is taken back where they open first, within `OUT` frames, and the
frames after which the hand then begins to retreat."""
JOINED = (20.0, 40.0)  # frames from the hold until the hand is on its sampled way again
DEEP_ON_WAY = 0.006
"""Penetration depth on the way to or from a hold above which other ways are tried, metres."""
FORCED = 0.1
"""Cost of wrist acceleration (metres per squared frame) relative to penetration depth (metres)."""


def solid_of(stood: StandingObject) -> tuple[Solids, Float[Tensor, " 3"]]:
    """The standing object as a signed distance grid, and its middle, the origin of the grid."""
    mesh = Mesh(stood.mesh.verts @ stood.rotation.T + stood.shift, stood.mesh.faces)
    name, middle = str(stood.mesh.source or "the mesh"), mesh.center()
    found = MeshFolder((name,), (), "", (Mesh(mesh.verts - middle, mesh.faces),))
    return scanned_object(build_scans(found)), middle


def settled(actions: Actions, stood: StandingObject, *, generator: torch.Generator) -> Actions:
    """The first action with hands that touch its object and penetrate neither it nor the table.

    The hand that carries the object longer is settled first, and the other one avoids it. A hand
    that lifts the object without a sampled pose that holds it takes the closest grasp found. One
    that never touches the object is only pushed out of it, the table and the other hand.
    """
    solids, middle = solid_of(stood)
    touching, moves = touching_hands(actions)[0], frames_of_motion(actions)
    before: OtherHands | None = None
    other_way: OtherHands | None = None
    for number in (touching & moves).sum(1).argsort(descending=True).tolist():
        if not bool(actions.hands[0, number]):
            continue
        own = solids if number else solids.mirrored()
        hand, table = HeldHands.of(actions, number, middle), table_of(actions, number, middle)
        if not bool(touching[number].any()):
            out = shifts_out(own, hand, Obstacles(table, other_way))
            if bool(out.any()):
                actions = replace(hand, wrist=hand.wrist + out).into(actions, number, middle)
            continue
        carrying = touching[number] & moves
        hold = torch.nonzero(carrying if bool(carrying.any()) else touching[number])[:, 0]
        lowest = hold[table.height[hold].argmin()]  # there a kept pose is nearest to the table
        nearest = Obstacles(table.take(lowest[None], "B"), before)
        held, frame, fits = settled_pose(own, hand, hold, nearest)
        frames = hold if bool(carrying.any()) else frame.expand(1)
        if not fits and lifted(actions, carrying):
            alone = not bool((touching[1 - number] & carrying).any())
            one = hand.take(frame[None], "N")
            held = new_hold(own, one, nearest, generator, alone=alone) or held
        hand = kept_pose(own, hand, held, frames, hold, Obstacles(table, other_way))
        actions = hand.into(actions, number, middle)
        before, other_way = held.mirrored_spheres, hand.mirrored_spheres
    return actions


def settled_pose(
    solids: Solids,
    hand: HeldHands,
    hold: Int[Tensor, " N"],
    beside: Obstacles,
    part: Solids | None = None,
) -> tuple[HeldHands, Int[Tensor, ""], bool]:
    """The best of several optimised poses of a hold, its frame, and whether it is good enough.

    The score rewards touching pads and firmness against pushes, and penalises penetration of the
    object, the table and the other hand.
    """
    tried = hold[torch.linspace(0, len(hold) - 1, 2 * POSES_TRIED + 1).long()[1::2]]
    copies, start = [0] * POSES_TRIED, hand.take(tried, "N")
    beside, solids = beside.take(copies, "B"), solids.take(copies, "B")
    start = replace(start, wrist=start.wrist + shifts_out_of_table(start, beside.table))
    if beside.other is not None:
        start = moved_out_of(start, beside.other)
    grasps = Grasps(
        pose=start.pose,
        wrist=start.wrist,
        offsets=mean_offsets().expand(POSES_TRIED, -1, -1),
        kept=torch.ones(POSES_TRIED, dtype=torch.bool),
        types=torch.zeros(POSES_TRIED, dtype=torch.long),
    )
    out = settled_grasps(solids, grasps, SETTLING, reach=PULLED_WITHIN, beside=beside)
    # a hand that left the object from deep inside is now pulled to the surface it ended up near
    after = settled_grasps(solids, out, SETTLING, reach=PULLED_WITHIN, beside=beside)
    found = HeldHands(after.pose, after.wrist)
    centers, radii = found.spheres
    depth = (radii - solids.signed_distance(centers)).maximum(beside.table.depth(centers, radii))
    depth = depth.clamp(min=0).amax(1)
    if beside.other is not None:
        depth = depth + beside.other.depth(centers, radii).clamp(min=0).amax(1)
    touched = solids if part is None else part.take(copies, "B")
    holding = Holding.of(touched, found)
    best = (holding.touching - depth / PAD_TOUCH - LOOSE_COST * holding.loose).argmax()
    fits = (holding.loose[best] < FIRM) & (depth[best] < TOO_DEEP)
    return found.take(best[None], "N"), tried[best], bool(fits)


def moved_out_of(hands: HeldHands, other: OtherHands) -> HeldHands:
    """Hands shifted out of other hands."""
    for _ in range(PUSHES):
        hands = replace(hands, wrist=hands.wrist + shifts_out_of_hand(hands, other))
    return hands


def shifts_out_of_hand(hands: HeldHands, other: OtherHands) -> Float[Tensor, "N 3"]:
    """Shifts that take the deepest sphere of each hand out of the other hand's, metres."""
    rows, count = torch.arange(len(hands.wrist)), other.radii.shape[1]
    centers, radii = hands.spheres
    depth, deepest = other.overlap(centers, radii).flatten(1).max(1)
    way = centers[rows, deepest // count] - other.centers[rows, deepest % count]
    return depth.clamp(min=0)[:, None] * torch.nn.functional.normalize(way, dim=-1)


def kept_pose(
    solids: Solids,
    hand: HeldHands,
    held: HeldHands,
    frames: Int[Tensor, " N"],
    hold: Int[Tensor, " M"],
    beside: Obstacles,
) -> HeldHands:
    """A hand that is in the pose `held` from the first to the last of `frames`.

    If the `hold` is longer, the correction at these frames applies to all of it, and fades out on
    the ways to and from the hold. Outside of `frames`, and less near them, the hand is pushed out
    of the object, the table and the other hand.
    """
    share = _fading(hold, len(hand.wrist))[:, None]
    end = torch.arange(len(hand.wrist)).clamp(frames[0], frames[-1])
    changed = hand.take(end, "N")
    bend = axis_angle_to_matrix(held.pose[:, 0]) @ axis_angle_to_matrix(changed.pose[:, 0]).mT
    bend = axis_angle_to_matrix(share * matrix_to_axis_angle(bend))
    turn = matrix_to_axis_angle(bend @ axis_angle_to_matrix(hand.pose[:, 0]))
    fingers = hand.pose[:, 1:] + share[..., None] * (held.pose[:, 1:] - changed.pose[:, 1:])
    wrist = hand.wrist + share * (held.wrist - changed.wrist)
    found = HeldHands(torch.cat([turn[:, None], fingers], 1), wrist)
    # no push in the held pose itself, and little near it
    away = 1 - _fading(frames, len(hand.wrist))[:, None] ** 4
    out = away * shifts_out(solids, found, beside)
    return withdrawn(replace(found, wrist=wrist + out), hold, solids, beside)


def shifts_out_of_table(hand: HeldHands, table: Table) -> Float[Tensor, "N 3"]:
    """Upward shifts that take hands out of the table, metres."""
    return table.depth(*hand.spheres).amax(1).clamp(min=0)[:, None] * table.up


def shifts_out(solids: Solids, hand: HeldHands, beside: Obstacles) -> Float[Tensor, "T 3"]:
    """Shifts, smooth over time, that take a hand out of its object, the table and the other hand,
    metres.

    The hand is moved along the surface normal at its deepest sphere, in `PUSHES` iterations.
    """
    start, frames = hand.wrist, torch.arange(len(hand.wrist))
    for _ in range(PUSHES):
        centers, radii = hand.spheres
        points = centers if len(solids.kind) > 1 else centers.flatten(0, 1)[None]
        distance, normal = solids.distance_and_normal(points)
        depth, deepest = (radii - distance.view(radii.shape)).clamp(min=0).max(1)
        shift = depth[:, None] * normal.view(centers.shape)[frames, deepest]
        hand = replace(hand, wrist=hand.wrist + shift)
        if beside.other is not None:
            hand = replace(hand, wrist=hand.wrist + shifts_out_of_hand(hand, beside.other))
        hand = replace(hand, wrist=hand.wrist + shifts_out_of_table(hand, beside.table))
    kernel = torch.exp(-0.5 * ((frames - frames[:, None]) / SMOOTH) ** 2)
    return kernel / kernel.sum(1, keepdim=True) @ (hand.wrist - start)


def _fading(frames: Int[Tensor, " N"], count: int) -> Float[Tensor, " T"]:
    """Weights that are 1 from the first to the last of `frames`, and fall to 0 over `FADE` more."""
    time = torch.arange(count, dtype=torch.float32)
    apart = torch.maximum(frames[0] - time, time - frames[-1]).clamp(min=0)
    return 1 - minimum_jerk(apart / FADE)


def withdrawn(
    hand: HeldHands, hold: Int[Tensor, " N"], solids: Solids, beside: Obstacles
) -> HeldHands:
    """A hand whose ways to the hold (frames `hold`) and from it are the best of those tried, by
    penetration depth and wrist acceleration; ways that are not deep are kept."""
    frames = torch.arange(len(hand.wrist))
    for end, apart in ((hold[0], hold[0] - frames), (hold[-1], frames - hold[-1])):
        way = frames[(apart > 0) & (apart < JOINED[-1])]
        if not len(way):
            continue
        drawn = hand.take(way, "N")
        deep = depths(drawn, way, solids, beside)
        if float(deep.amax()) < DEEP_ON_WAY:
            continue
        ways = concatenated(
            [drawn, *_ways(drawn, hand.take(end[None], "N"), apart[way].float())], "N"
        )
        count = len(ways.wrist) // len(way)
        found = depths(ways, way.repeat(count), solids, beside)
        forced = ways.wrist.unflatten(0, (count, -1)).diff(n=2, dim=1).norm(dim=-1).sum(1)
        best = (found.unflatten(0, (count, -1)).sum(1) + FORCED * forced).argmin()
        taken = ways.take(best * len(way) + torch.arange(len(way)), "N")
        hand = HeldHands(
            hand.pose.index_copy(0, way, taken.pose), hand.wrist.index_copy(0, way, taken.wrist)
        )
    return hand


def depths(
    hands: HeldHands, frames: Int[Tensor, " N"], solids: Solids, beside: Obstacles
) -> Float[Tensor, " N"]:
    """Penetration depth of each hand in its object, the table or the other hand, metres."""
    centers, radii = hands.spheres
    posed = solids.take(frames if len(solids.kind) > 1 else torch.zeros_like(frames), "B")
    depth = radii - posed.signed_distance(centers)
    beside = beside.take(frames, "B")
    depth = depth.maximum(beside.table.depth(centers, radii))
    if beside.other is not None:
        depth = depth.maximum(beside.other.depth(centers, radii))
    return depth.clamp(min=0).amax(1)


def _ways(drawn: HeldHands, held: HeldHands, apart: Float[Tensor, " N"]) -> list[HeldHands]:
    """Hands that retreat from a hold in several directions and then join the sampled way: with
    fingers that follow the hand, or that open before it retreats."""
    found = []
    steps = torch.tensor([-1.0, 0.0, 1.0])
    sides = torch.cartesian_prod(steps, steps, steps)
    sides = torch.nn.functional.normalize(sides[sides.norm(dim=-1) > 0], dim=-1)
    turns = axis_angle_to_matrix(held.pose), axis_angle_to_matrix(drawn.pose)
    for back, joined in product(BACK, JOINED):
        share = minimum_jerk(apart / joined)
        whole = interpolate_rotations(*turns, share[:, None])
        bend = 1 - STRAIGHTENED * (1 - share)[:, None, None]
        straight = axis_angle_to_matrix(bend * drawn.pose[:, 1:])
        opened = minimum_jerk(apart / OUT)[:, None]
        fingers = interpolate_rotations(turns[0][:, 1:], straight, opened)
        for turned, late in ((whole, 0.0), (torch.cat([whole[:, :1], fingers], 1), OPENING)):
            pose = matrix_to_axis_angle(turned)
            away = back * minimum_jerk((apart - late) / OUT)[:, None]
            for side in sides:
                place = torch.lerp(held.wrist + away * side, drawn.wrist, share[:, None])
                found.append(HeldHands(pose, place))
    return found
