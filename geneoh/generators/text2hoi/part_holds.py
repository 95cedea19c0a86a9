"""The hold of a hand that opens or closes: found at the closed or open object, and kept.

The second part is what the hand holds; the first one is what it keeps out of, in all states of the
joint while it holds, and where it is in each frame on its ways.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull
from torch import Tensor

from geneoh.choices import SIDES
from geneoh.generators.text2hoi.held_hands import (
    GRASPS,
    TOUCH,
    TRIES,
    HeldHands,
    mean_offsets,
    table_of,
)
from geneoh.generators.text2hoi.opening import BEGIN, joint_frames, opener, outward, rigid_part
from geneoh.generators.text2hoi.resting import touching_hands
from geneoh.generators.text2hoi.settling import kept_pose, settled_pose, shifts_out
from geneoh.geometry.mesh import Mesh, tidied
from geneoh.geometry.mirror import mirror_points
from geneoh.geometry.rigid import Rigid
from geneoh.synthesis.actions import Actions
from geneoh.synthesis.contact_pads import Table
from geneoh.synthesis.grasps import synthesize_grasps
from geneoh.synthesis.scans import MeshFolder, Scans, build_scans
from geneoh.synthesis.solids import SCAN, SOLIDS, Solids

GRIP = 4  # frames for which the hand holds the part before it moves and after it has moved
RISE = 6  # frames over which a hand is lifted out of the table
DEEPEST = 0.005  # metres that a hold may be in what it keeps out of, the soft table among it
FEWEST = 2  # pads of a hold of the part below which another one is looked for
STATES = SOLIDS - 1  # of the joint between its ends, in which a hold keeps out of the first part


@dataclass(frozen=True)
class PartShapes:
    """Grids of both parts of an object that stands closed on the table."""

    scans: Scans  # of the first part, then of the second one
    middles: tuple[Float[Tensor, " 3"], Float[Tensor, " 3"]]  # of their bounding boxes

    @classmethod
    def of(cls, meshes: tuple[Mesh, Mesh]) -> "PartShapes":
        """The grids of upright meshes, metres.

        The first part is filled, as its convex hull: a hand at the second one must not be shut in.
        """
        corners = meshes[0].verts
        filled = Mesh(
            corners, torch.from_numpy(ConvexHull(corners.double().numpy()).simplices).long()
        )
        meshes = tidied(filled), meshes[1]
        middles = [(mesh.verts.amin(0) + mesh.verts.amax(0)) / 2 for mesh in meshes]
        moved = (Mesh(m.verts - at, m.faces) for m, at in zip(meshes, middles, strict=True))
        names = ("the first part", "the second part")
        scans = build_scans(MeshFolder(names, (), "", tuple(moved)))
        return cls(scans, (middles[0], middles[1]))

    def seen_from(self, part: int, poses: Rigid) -> Solids:
        """Objects of one part, 0 or 1, and the other one at B x N `poses` of the joint.

        `poses` are of the second part in the frame of the first one; what is made is in the frame
        of the closed object moved to the middle of `part`, which is the first of its solids.
        """
        other, (batch, count) = 1 - part, poses.translation.shape[:2]
        poses = poses.inverse() if part else poses
        center = poses.apply(self.middles[other].expand(batch, count, 1, 3))[:, :, 0]
        center = torch.cat([torch.zeros(batch, 1, 3), center - self.middles[part]], 1)
        turn = torch.cat([torch.eye(3).expand(batch, 1, 3, 3), poses.rotation], 1)
        kind = torch.full((batch, count + 1), SCAN + other)
        kind[:, 0] = SCAN + part
        none = torch.zeros(batch, 3)
        return Solids(
            kind=kind,
            size=torch.ones(batch, count + 1, 3),
            rounding=torch.zeros(batch, count + 1),
            center=center,
            rotation=turn,
            part=torch.zeros_like(kind),
            axis=none,
            pivot=none,
            slides=torch.zeros(batch, dtype=torch.bool),
            travel=none[:, :2],
            scans=self.scans,
        )


def held_at_parts(
    actions: Actions, meshes: tuple[Mesh, Mesh], *, generator: torch.Generator
) -> Actions:
    """The first action with the hand that moves the joint at the second part while it moves.

    `meshes` stand closed, in the frame of the actions. The best of some drawn poses is brought to
    the surface and kept; on its ways to it and from it the hand is taken out of both parts and the
    table. So is another hand, at the first part if it is drawn there.
    """
    moves = torch.nonzero(joint_frames(actions)[0])[:, 0]
    if not len(moves):
        return actions
    shapes, parts = PartShapes.of(meshes), opener(actions, actions)[0].long()
    for number in torch.nonzero(actions.hands[0])[:, 0].tolist():
        actions = _with_hold(actions, shapes, number, int(parts[number]), moves, generator)
    return actions


def _with_hold(
    actions: Actions,
    shapes: PartShapes,
    number: int,
    part: int,
    moves: Int[Tensor, " M"],
    generator: torch.Generator,
) -> Actions:
    """The first action with one hand at one part while the joint moves, in the frames `moves`."""
    seen, middle = rigid_part(actions, part), shapes.middles[part]
    poses = Rigid(*actions.joint_poses())
    some = moves[torch.linspace(0, len(moves) - 1, STATES).long()]
    around = shapes.seen_from(part, Rigid(poses.rotation[:, some], poses.translation[:, some]))
    ways = shapes.seen_from(part, Rigid(poses.rotation[0, :, None], poses.translation[0, :, None]))
    if SIDES[number] == "left":
        around, ways = around.mirrored(), ways.mirrored()
    hand, table = HeldHands.of(seen, number, middle), table_of(seen, number, middle)
    last = int(actions.length[0]) - 1
    hold = torch.arange(max(0, int(moves[0]) - GRIP), min(last, int(moves[-1]) + GRIP) + 1)
    first = hold[: GRIP + 1 + len(moves) // BEGIN]
    if part or bool(touching_hands(seen)[0, number, first].any()):
        out = outward(actions)[0][0]
        out = out if SIDES[number] == "right" else mirror_points(out)
        held = _hold(around, hand.take(first, "N"), out, table.take(hold, "B"), part, generator)
        hand = over_table(kept_pose(ways, hand, held, hold, hold, table, None), table, hold)
    else:
        hand = replace(hand, wrist=hand.wrist + shifts_out(ways, hand, table))
    kept = hand.into(seen, number, middle)
    return replace(actions, pose=kept.pose, wrist=kept.wrist)


def _hold(
    around: Solids,
    drawn: HeldHands,
    out: Float[Tensor, " 3"],
    tables: Table,
    part: int,
    generator: torch.Generator,
) -> HeldHands:
    """The pose in which a hand holds a part: the best of those drawn, settled, or a new one.

    `tables` are those of the hold; the one counts in which the hand is lowest.
    """
    ends, frames = tables.take([0, -1], "B"), torch.arange(len(drawn.wrist))
    middle = drawn.take(frames[len(frames) // 2].expand(2), "N")
    lower = ends.depth(*middle.spheres).amax(1).argmax()
    table = ends.take(lower[None], "B")
    held, frame, _ = settled_pose(around, drawn, frames, None, table, around.take([0], "S"))
    pads, depth = _pads(around, held, out), _depth(around, held, table)
    if not part or (float(pads) >= FEWEST and float(depth) < DEEPEST):
        return held
    return found_hold(around, drawn.take(frame[None], "N"), out, table, generator) or held


def found_hold(
    around: Solids,
    drawn: HeldHands,
    out: Float[Tensor, " 3"],
    table: Table,
    generator: torch.Generator,
) -> HeldHands | None:
    """The grasp of the second part that is nearest to a drawn hand, beside the first part.

    It is looked for from the drawn hand's side, and then from `out`. Where no grasp passes the
    checks of the training data it is the one that is least deep and touches; None without any.
    """
    copies = torch.zeros(TRIES, dtype=torch.long)
    solids, offsets = around.take(copies, "B"), mean_offsets().expand(TRIES, -1, -1)
    side = torch.nn.functional.normalize(drawn.wrist[0], dim=-1)
    last = None
    for toward in (side, out, out):
        grasps = synthesize_grasps(
            solids,
            offsets,
            GRASPS,
            generator=generator,
            toward=toward.expand(TRIES, -1),
            table=table.take(copies, "B"),
        )
        found = HeldHands(grasps.pose, grasps.wrist)
        touching = _pads(around, found, out)
        depth = _depth(around, found, table)
        away = (found.spheres[0] - drawn.spheres[0]).norm(dim=-1).mean(1)
        if bool((good := grasps.kept & (touching >= FEWEST)).any()):
            return found.take(away.masked_fill(~good, torch.inf).argmin()[None], "N")
        if bool((some := (touching > 0) & (depth < DEEPEST)).any()):
            last = found.take(away.masked_fill(~some, torch.inf).argmin()[None], "N")
    return last


def _pads(around: Solids, hands: HeldHands, out: Float[Tensor, " 3"]) -> Float[Tensor, " N"]:
    """Number of pads of hands that touch the part itself, beyond its middle."""
    pads = hands.pads
    gap = around.take([0], "S").signed_distance(pads.flatten(0, 1)[None]).view(pads.shape[:2])
    return ((gap.abs() < TOUCH) & (pads @ out > 0)).sum(1).float()


def _depth(around: Solids, hands: HeldHands, table: Table) -> Float[Tensor, " N"]:
    """How deep the deepest sphere of hands is in both parts and the table, metres."""
    centers, radii = hands.spheres
    copies = torch.zeros(len(centers), dtype=torch.long)
    inside = radii - around.take(copies, "B").signed_distance(centers)
    return inside.maximum(table.take(copies, "B").depth(centers, radii)).amax(1)


def over_table(hand: HeldHands, table: Table, hold: Int[Tensor, " N"]) -> HeldHands:
    """A hand that is lifted out of the table, smoothly, on its ways to a hold and from it."""
    depth = table.depth(*hand.spheres).amax(1).clamp(min=0)
    frames = torch.arange(len(depth))
    highest = torch.nn.functional.max_pool1d(depth[None], 2 * RISE + 1, 1, RISE)[0]
    kernel = torch.exp(-0.5 * ((frames - frames[:, None]) * 2 / RISE) ** 2)
    rise = kernel / kernel.sum(1, keepdim=True) @ highest
    off = torch.maximum(hold[0] - frames, frames - hold[-1]).clamp(0, RISE) / RISE
    return replace(hand, wrist=hand.wrist + (off * rise)[:, None] * table.up)
