"""Straight ways of a hand to and from a hold, where its sampled way passes through the object.

A hand around a handle or the edge of a lid can leave only in some directions. Of several directions
the one is taken in which the hand penetrates the object, the table and the other hand least.
"""

from itertools import product

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.generators.text2hoi.physics.held_hands import HeldHands
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    interpolate_rotations,
    matrix_to_axis_angle,
)
from geneoh.synthesis.grasping.contact_pads import OtherHands, Table
from geneoh.synthesis.motions.object_motion import minimum_jerk
from geneoh.synthesis.shapes.solids import Solids

BACK, OUT = (0.06, 0.12), 12.0
"""Distances that a hand may retreat from its hold, metres, and the frames that this takes."""
JOINED = (20.0, 40.0)  # frames from the hold until the hand is on its sampled way again
DEEP_ON_WAY = 0.006
"""Penetration depth on the way to or from a hold above which other ways are tried, metres."""
FORCED = 0.1
"""Cost of wrist acceleration (metres per squared frame) relative to penetration depth (metres)."""


def withdrawn(
    hand: HeldHands, hold: Int[Tensor, " N"], solids: Solids, table: Table, other: OtherHands | None
) -> HeldHands:
    """A hand whose ways to the hold (frames `hold`) and from it are the best of those tried, by
    penetration depth and wrist acceleration; ways that are not deep are kept."""
    frames = torch.arange(len(hand.wrist))
    for end, apart in ((hold[0], hold[0] - frames), (hold[-1], frames - hold[-1])):
        way = frames[(apart > 0) & (apart < JOINED[-1])]
        if not len(way):
            continue
        drawn = hand.take(way, "N")
        deep = depths(drawn, way, solids, table, other)
        if float(deep.amax()) < DEEP_ON_WAY:
            continue
        ways = concatenated(
            [drawn, *_ways(drawn, hand.take(end[None], "N"), apart[way].float())], "N"
        )
        count = len(ways.wrist) // len(way)
        found = depths(ways, way.repeat(count), solids, table, other)
        forced = ways.wrist.unflatten(0, (count, -1)).diff(n=2, dim=1).norm(dim=-1).sum(1)
        best = (found.unflatten(0, (count, -1)).sum(1) + FORCED * forced).argmin()
        taken = ways.take(best * len(way) + torch.arange(len(way)), "N")
        hand = HeldHands(
            hand.pose.index_copy(0, way, taken.pose), hand.wrist.index_copy(0, way, taken.wrist)
        )
    return hand


def depths(
    hands: HeldHands,
    frames: Int[Tensor, " N"],
    solids: Solids,
    table: Table,
    other: OtherHands | None,
) -> Float[Tensor, " N"]:
    """Penetration depth of each hand in its object, the table or the other hand, metres."""
    centers, radii = hands.spheres
    posed = solids.take(frames if len(solids.kind) > 1 else torch.zeros_like(frames), "B")
    depth = radii - posed.signed_distance(centers)
    depth = depth.maximum(table.take(frames, "B").depth(centers, radii))
    if other is not None:
        depth = depth.maximum(other.take(frames, "B").depth(centers, radii))
    return depth.clamp(min=0).amax(1)


def _ways(drawn: HeldHands, held: HeldHands, apart: Float[Tensor, " N"]) -> list[HeldHands]:
    """Hands that retreat from a hold in several directions and then join the sampled way."""
    found = []
    steps = torch.tensor([-1.0, 0.0, 1.0])
    sides = torch.cartesian_prod(steps, steps, steps)
    sides = torch.nn.functional.normalize(sides[sides.norm(dim=-1) > 0], dim=-1)
    turns = axis_angle_to_matrix(held.pose), axis_angle_to_matrix(drawn.pose)
    for back, joined in product(BACK, JOINED):
        share = minimum_jerk(apart / joined)
        pose = matrix_to_axis_angle(interpolate_rotations(*turns, share[:, None]))
        for side in sides:
            place = held.wrist + back * minimum_jerk(apart / OUT)[:, None] * side
            found.append(HeldHands(pose, torch.lerp(place, drawn.wrist, share[:, None])))
    return found
