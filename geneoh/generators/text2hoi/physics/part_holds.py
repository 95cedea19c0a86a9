"""The hold of a hand that opens or closes an object, kept while the joint moves.

The hand holds the second part and avoids the first one: in all states of the joint during the hold,
and in the state of each frame on the ways to and from it.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull
from torch import Tensor

from geneoh.choices import SIDES
from geneoh.generators.text2hoi.physics.held_hands import HeldHands, table_of
from geneoh.generators.text2hoi.physics.opening import (
    BEGIN,
    joint_frames,
    opener,
    outward,
    rigid_part,
)
from geneoh.generators.text2hoi.physics.part_grips import PartTask, best_hold
from geneoh.generators.text2hoi.physics.settling import kept_pose, settled_pose
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.joint import Joint
from geneoh.geometry.mesh import Mesh, tidied
from geneoh.geometry.mirror import mirror_points
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.solid import build_solid
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.grasping.contact_pads import Obstacles, OtherHands, Table
from geneoh.synthesis.shapes.scans import HAND_SPAN, WIDE_SHARE, MeshFolder, Scans, build_scans
from geneoh.synthesis.shapes.solids import SCAN, Solids

GRIP = 4  # frames for which the hand holds the part before and after its motion
LIFTED_OFF = 0.5
"""Upward share of the way of a part that slides, from which the part is lifted off: nothing but the
hand holds it then, at the end of the clip, or at its start if it is put back."""
RISE = 6  # frames over which a hand is lifted out of the table
FREE, CLEAR = 0.005, 0.001
"""Distance from the first part above which a finger fits behind the second one, or can touch it,
metres."""
FLAT = 1e-5  # distance of a mesh's vertices from a plane below which it is flat, metres
AVOIDED_STATES = 7  # states of the joint, ends included, in which a hold avoids the first part


@dataclass(frozen=True)
class PartShapes:
    """Signed distance grids of both parts of an object that stands closed on the table."""

    scans: Scans  # of the first part, then of the second one
    middles: tuple[Float[Tensor, " 3"], Float[Tensor, " 3"]]  # of their bounding boxes

    @classmethod
    def of(cls, meshes: tuple[Mesh, Mesh], out: Float[Tensor, " 3"]) -> "PartShapes":
        """The grids of upright meshes, metres; a hand opens the second part towards `out`.

        The first part is replaced by its convex hull, so that no hand is shut in.
        """
        meshes = hull(meshes[0]), meshes[1]
        middles = [mesh.center() for mesh in meshes]
        moved = (Mesh(m.verts - at, m.faces) for m, at in zip(meshes, middles, strict=True))
        names = ("the first part", "the second part")
        scans = build_scans(MeshFolder(names, (), "", tuple(moved)))
        grasped = torch.stack([scans.grasped[0], graspable(scans, meshes[1], middles, out)])
        return cls(replace(scans, grasped=grasped), (middles[0], middles[1]))

    def seen_from(self, part: int, poses: Rigid, joint: Joint) -> Solids:
        """B objects of one part, 0 or 1, and the other one in N poses each.

        `poses` (B x N) are of the second part in the frame of the first one. The result is in the
        closed object's frame with the origin at the middle of `part`, which is the first solid.
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
            axis=joint.axis.expand(batch, 3),
            pivot=(joint.pivot - self.middles[part]).expand(batch, 3),
            slides=torch.tensor([joint.slides]).expand(batch),
            travel=none[:, :2],
            scans=self.scans,
        )


def hull(mesh: Mesh) -> Mesh:
    """The convex hull of a mesh, or of the wall that a flat mesh gets as a solid."""
    verts = mesh.verts.double()
    if float(torch.linalg.svdvals(verts - verts.mean(0)).amin()) < FLAT:
        verts = build_solid(mesh).surface.verts.double()
    return tidied(Mesh(verts.float(), torch.from_numpy(ConvexHull(verts.numpy()).simplices).long()))


def graspable(
    scans: Scans, second: Mesh, middles: list[Float[Tensor, " 3"]], out: Float[Tensor, " 3"]
) -> Float[Tensor, " M"]:
    """Relative probability that a hand grasps the second part at each of its points.

    It is high where fingers reach both sides (a handle, a knob or an edge beyond the first part),
    low elsewhere beyond the middle of the part, and nearly zero next to the first part.
    """
    points, normals = scans.points[1], scans.normals[1]
    field = SurfaceDistance(Mesh(second.verts - middles[1], second.faces))
    across, _ = field.exits(points - 1e-5 * normals, -normals)
    behind = points - across.clamp(max=1.0)[:, None] * normals
    first, apart = torch.zeros(2, dtype=torch.long), middles[1] - middles[0]
    gap, gap_behind = scans.distance(first, torch.stack([points, behind]) + apart)
    held = (across < HAND_SPAN) & (gap > FREE) & (gap_behind > FREE)
    outer = (points @ out > 0) & (gap > min(CLEAR, float(gap.amax()) / 2))
    return torch.where(outer, torch.where(held, 1.0, WIDE_SHARE), 1e-6)


def held_at_parts(
    actions: Actions, meshes: tuple[Mesh, Mesh], *, generator: torch.Generator
) -> Actions:
    """The first action with the hand that moves the joint at the second part while it moves.

    `meshes` stand closed, in the frame of the actions. On the ways to and from the hold the hand is
    pushed out of both parts and the table. A second hand holds the first part and avoids the hand
    that moves the joint.
    """
    moves = torch.nonzero(joint_frames(actions)[0])[:, 0]
    if not len(moves):
        return actions
    shapes = PartShapes.of(meshes, outward(actions)[0][0])
    moving = int(opener(actions, actions)[0].long().argmax())
    actions = _with_hold(actions, shapes, (moving, 1), None, moves, generator)
    if bool(actions.hands[0].all()):
        actions = _with_hold(actions, shapes, (1 - moving, 0), moving, moves, generator)
    return actions


def _with_hold(
    actions: Actions,
    shapes: PartShapes,
    hand_at: tuple[int, int],
    before: int | None,
    moves: Int[Tensor, " M"],
    generator: torch.Generator,
) -> Actions:
    """The first action with a hand at a part while the joint moves, in the frames `moves`.

    `hand_at` are the indices of hand and part; `before` is the index of a hand to avoid.
    """
    number, part = hand_at
    seen, middle = rigid_part(actions, part), shapes.middles[part]
    poses = Rigid(*actions.joint_poses())
    some = moves[torch.linspace(0, len(moves) - 1, AVOIDED_STATES).long()]
    joint = Joint(actions.axis[0], actions.pivot[0], bool(actions.slides[0]))
    states = Rigid(poses.rotation[:, some], poses.translation[:, some])
    around = shapes.seen_from(part, states, joint)
    every = Rigid(poses.rotation[0, :, None], poses.translation[0, :, None])
    ways = shapes.seen_from(part, every, joint)
    out = outward(actions)[0][0]
    if SIDES[number] == "left":
        around, ways, out = around.mirrored(), ways.mirrored(), mirror_points(out)
    hand, table = HeldHands.of(seen, number, middle), table_of(seen, number, middle)
    way = float((actions.joint[0, moves[-1]] - actions.joint[0, moves[0]]).sign()) if part else 0.0
    rises = way * float(joint.axis[2]) if joint.slides else 0.0
    hold = hold_frames(moves, int(actions.length[0]) - 1, rises)
    first = hold[: GRIP + 1 + len(moves) // BEGIN]
    other = None if before is None else HeldHands.of(seen, before, middle).mirrored_spheres
    task = PartTask(around, table.take(hold, "B"), out, way, other and at_once(other, some))
    held = _hold(task, hand.take(first, "N"), generator)
    hand = over_table(kept_pose(ways, hand, held, hold, hold, Obstacles(table, other)), table, hold)
    kept = hand.into(seen, number, middle)
    return replace(actions, pose=kept.pose, wrist=kept.wrist)


def hold_frames(moves: Int[Tensor, " M"], last: int, rises: float) -> Int[Tensor, " N"]:
    """The frames in which the hand holds a part that moves in `moves`, of a clip with frames 0 to
    `last`; `rises` is the upward share of the part's way, negative downwards."""
    start = 0 if rises < -LIFTED_OFF else max(0, int(moves[0]) - GRIP)
    stop = last if rises > LIFTED_OFF else min(last, int(moves[-1]) + GRIP)
    return torch.arange(start, stop + 1)


def at_once(hands: OtherHands, frames: Int[Tensor, " N"]) -> OtherHands:
    """The spheres of a hand in all of some frames, as one obstacle."""
    some = hands.take(frames, "B")
    return OtherHands(some.centers.flatten(0, 1)[None], some.radii.flatten()[None])


def _hold(task: PartTask, drawn: HeldHands, generator: torch.Generator) -> HeldHands:
    """The pose in which a hand holds a part: the best optimised sample, or a new grasp.

    The table is that of the hold's first or last frame, whichever the hand penetrates more.
    """
    ends, frames = task.tables.take([0, -1], "B"), torch.arange(len(drawn.wrist))
    middle = drawn.take(frames[len(frames) // 2].expand(2), "N")
    lower = ends.depth(*middle.spheres).amax(1).argmax()
    around, beside = task.around, Obstacles(ends.take(lower[None], "B"), task.other)
    held, frame, _ = settled_pose(around, drawn, frames, beside, around.take([0], "S"))
    return best_hold(task, held, drawn.take(frame[None], "N"), generator)


def over_table(hand: HeldHands, table: Table, hold: Int[Tensor, " N"]) -> HeldHands:
    """A hand that is lifted out of the table, smoothly, on the ways to and from its hold."""
    depth = table.depth(*hand.spheres).amax(1).clamp(min=0)
    frames = torch.arange(len(depth))
    highest = torch.nn.functional.max_pool1d(depth[None], 2 * RISE + 1, 1, RISE)[0]
    kernel = torch.exp(-0.5 * ((frames - frames[:, None]) * 2 / RISE) ** 2)
    rise = kernel / kernel.sum(1, keepdim=True) @ highest
    apart = torch.maximum(hold[0] - frames, frames - hold[-1]).clamp(0, RISE) / RISE
    return replace(hand, wrist=hand.wrist + (apart * rise)[:, None] * table.up)
