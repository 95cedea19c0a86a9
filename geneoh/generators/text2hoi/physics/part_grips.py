"""Holds by which a hand can open or close a part: their cost, and a search for better ones.

A palm that lies on a lid can press it shut but not lift it. The force of a hold along the motion of
the joint follows from the friction at its pads; the hinge or the slide bears all other forces. The
forearm counts too: a hold is impossible if the forearm passes through the table or the object.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.generators.text2hoi.physics.held_hands import PAD_TOUCH, HeldHands, new_grasps
from geneoh.geometry.forces import friction_cones, wrench_left
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.synthesis.grasping.contact_pads import Obstacles, OtherHands, Table
from geneoh.synthesis.grasping.grasp_energy import FRICTION
from geneoh.synthesis.shapes.solids import Solids

HOLDS_TRIED = 24  # new holds that are synthesised
GOOD = 0.8  # cost of a hold below which no new one is searched
FEWEST_PADS = 2  # least number of pads of a hold that touch the part
SKIN = 0.003  # distance by which the skin may exceed the spheres, metres
FOREARM = torch.tensor([0.06, 0.12, 0.18])  # distances of the forearm's spheres from the wrist
ARM_RADIUS = 0.03  # radius of these spheres, metres
UNMOVED, DEEP, FAR, SHORT, ARM = 4.0, 400.0, 5.0, 1.0, 30.0
"""Weights of a hold's costs: the share of a push along the joint that it cannot bear; penetration
depth (metres); distance from the sampled hand (metres); a missing lever arm (1 for none); and
penetration depth of the forearm (metres)."""


@dataclass(frozen=True)
class PartTask:
    """The task of a hand at a part, in the part's frame, mirrored for a left hand."""

    around: Solids
    """One object: the part, then the other part in several states of the joint; with the joint."""
    tables: Table  # in the frames of the hold
    out: Float[Tensor, " 3"]  # away from the hinge, or out of the first part
    way: float  # 1 to open, -1 to close, 0 to hold still
    other: OtherHands | None  # the other hand in some frames of the hold

    def costs(self, hands: HeldHands, drawn: HeldHands) -> Float[Tensor, " N"]:
        """Costs of N hands in place of a sampled one; infinite for those that touch the part with
        fewer than `FEWEST_PADS` pads."""
        pads = hands.pads
        part = self.around.take([0], "S").take([0] * len(pads), "B")
        gap, normal = part.distance_and_normal(pads)
        touching = gap.abs() < PAD_TOUCH
        weight = touching.float()[..., None]
        middle = (pads * weight).sum(1) / weight.sum(1).clamp(min=1)
        lever = (middle @ self.out) / (part.extents[0] @ self.out.abs())
        away = (hands.spheres[0] - drawn.spheres[0]).norm(dim=-1).mean(1)
        cost = (
            abs(self.way) * UNMOVED * unmoved(normal, touching, self.motion(middle))
            + abs(self.way) * SHORT * (1 - lever)
            + DEEP * (self.depth(hands) - PAD_TOUCH).clamp(min=0)
            + ARM * self.forearm_depth(hands)
            + FAR * away
        )
        return cost.masked_fill(touching.sum(1) < FEWEST_PADS, torch.inf)

    def motion(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, "N 3"]:
        """Unit directions in which points of the part are to move."""
        joint = self.around
        turning = torch.linalg.cross(joint.axis, points - joint.pivot)
        along = torch.where(joint.slides[:, None], joint.axis, turning)
        return self.way * torch.nn.functional.normalize(along, dim=-1)

    def depth(self, hands: HeldHands) -> Float[Tensor, " N"]:
        """Largest penetration depth of hands in the parts, the table or the other hand, metres."""
        return self._depth(*hands.spheres)

    def forearm_depth(self, hands: HeldHands) -> Float[Tensor, " N"]:
        """The same for the forearms of hands with straight wrists."""
        along = axis_angle_to_matrix(hands.pose[:, 0])[:, None, :, 0]  # hands point along -x
        centers = hands.wrist[:, None] + FOREARM[:, None] * along
        return self._depth(centers, torch.full(centers.shape[:2], ARM_RADIUS))

    def _depth(
        self, centers: Float[Tensor, "N K 3"], radii: Float[Tensor, "N K"]
    ) -> Float[Tensor, " N"]:
        copies = [0] * len(centers)
        deep = radii - self.around.take(copies, "B").signed_distance(centers)
        for end in (0, -1):  # of the hold: in between the joint moves in one direction
            table = self.tables.take([end], "B").take(copies, "B")
            deep = deep.maximum(table.depth(centers, radii + SKIN))
        if self.other is not None:
            deep = deep.maximum(self.other.take(copies, "B").depth(centers, radii))
        return deep.amax(1).clamp(min=0)


def unmoved(
    normals: Float[Tensor, "N P 3"], touching: Bool[Tensor, "N P"], motion: Float[Tensor, "N 3"]
) -> Float[Tensor, " N"]:
    """The share of a push along the motion of the joint that touching pads cannot bear, 0 to 1."""
    cones = friction_cones(torch.zeros_like(normals), normals, FRICTION) * touching[..., None, None]
    push = torch.cat([motion, torch.zeros_like(motion)], -1)[:, None]
    return wrench_left(cones.flatten(1, 2), push).norm(dim=-1)[:, 0].clamp(max=1)


def best_hold(
    task: PartTask, held: HeldHands, drawn: HeldHands, generator: torch.Generator
) -> HeldHands:
    """The hold `held` if its cost is below `GOOD`; else the cheapest of it and new ones."""
    if float(task.costs(held, drawn)) < GOOD:
        return held
    side = torch.nn.functional.normalize(drawn.wrist[0], dim=-1)
    toward = torch.stack([side, task.out]).repeat(HOLDS_TRIED // 2, 1)
    number = torch.arange(HOLDS_TRIED)
    tables = task.tables.take([0, -1], "B").take(number % 2, "B")
    other = task.other and task.other.take([0] * HOLDS_TRIED, "B")
    new, _ = new_grasps(task.around, toward, Obstacles(tables, other), generator)
    found = concatenated([held, new], "N")
    costs = task.costs(found, drawn)
    return found.take(costs.argmin()[None], "N")
