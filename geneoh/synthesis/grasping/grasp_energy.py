"""Attempts at grasps: the energy that the search for grasps minimises, and which grasps are kept.

Terms of the energy: penetration, contact of the wanted pads, finger clearance and distance to a
liked pose. Kept are hands that penetrate little and whose contacts can hold the object. Frames: the
right hand's rest frame (fingers -x, palm -y, thumb +z) and the object's frame; metres and radians.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.forces import friction_cones, wrench_left
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.hand.spheres import finger_clearance, hand_and_wrist_spheres, hand_scale, hand_spheres
from geneoh.synthesis.grasping.contact_pads import PAD_DIGITS, Obstacles, contact_pads
from geneoh.synthesis.grasping.grasp_types import FINGER_STD, GRASP_TYPES, beyond_range, of_type
from geneoh.synthesis.shapes.solids import Solids

SOFT = 0.004
"""Penetration of the table that costs nothing, metres: fingers that reach under an object are
soft."""
FRICTION = 1.0  # coefficient of friction of skin, which is moist and soft
PATCH = 0.01  # torque about the normal per newton of a pad's pressure, metres: pads are soft
PUSHES = torch.tensor(list(product((-1.0, 1.0), repeat=3))) / math.sqrt(3)
"""Directions in which the object is pushed to test a grip."""
LEVER = 0.02  # distance of a push from the middle of the pads, metres
LENGTH = 0.03  # torques are divided by this length to count as forces, metres


@dataclass(frozen=True)
class GraspEnergy:
    """Weights of the terms of the energy, and limits where terms start to count."""

    depth: float = 4e4  # of squared penetration of the hand's spheres, 1/m^2
    contact: float = 60.0  # of the distance of wanted pads to the surface, 1/m
    far_contact: float = 30.0
    """Of the squared distance relative to `contact`, 1/m: pulls pads far from the surface more."""
    facing: float = 0.25  # of 1 plus the cosine between a wanted pad's direction and the normal
    opposition: float = 3.0  # of the mean shortfall from `opposed`; grips only
    opposed: float = 1.0
    """Opposition of a thumb pad and a finger pad (at most 2, see `_unopposed`) that is enough."""
    clearance: float = 2e4  # of squared overlap of different fingers, 1/m^2
    liked: float = 0.12  # of the squared distance to the liked pose, in units of `FINGER_STD`
    range: float = 2.0  # `FINGER_STD` outside of the prior's range beyond which squares are added
    wrong_side: float = 1e5  # of the squared distance of a start to the requested side, 1/m^2


@dataclass(frozen=True)
class GraspAttempt(Bundle):
    """Targets of B hands: one type of grasp each, on one object each."""

    types: Int[Tensor, " B"]
    offsets: Float[Tensor, "B 20 3"]
    liked: Float[Tensor, "B 15 3"]  # finger pose that is drawn for the attempt, as a soft target
    wanted: Bool[Tensor, "B 19"]  # pads that should touch
    beside: Obstacles | None = None

    @cached_property
    def scale(self) -> Float[Tensor, "B 1"]:
        """Size of the hand, 1 for a mean adult."""
        return hand_scale(self.offsets)

    def depths_beside_object(
        self, joints: Float[Tensor, "B 21 3"], turns: Float[Tensor, "B 16 3 3"]
    ) -> list[Float[Tensor, "B K"]]:
        """Penetration depth of the spheres of hands and wrists in the table and in other hands, as
        far as they exist, metres; negative outside.
        """
        if self.beside is None:
            return []
        centers, radii = hand_and_wrist_spheres(joints, turns, self.scale)
        table, other = self.beside.table.depth(centers, radii) - SOFT, self.beside.other
        return [table] if other is None else [table, other.depth(centers, radii)]


@dataclass(frozen=True)
class Hands(Bundle):
    """Pose of B hands during the descent, in the object's frame; axis-angle."""

    wrist: Float[Tensor, "B 3"]
    orient: Float[Tensor, "B 3"]
    fingers: Float[Tensor, "B 15 3"]

    @property
    def pose(self) -> Float[Tensor, "B 16 3"]:
        """Axis-angle of the global rotation and the finger joints."""
        return torch.cat([self.orient[:, None], self.fingers], dim=1)

    def posed(self, attempt: GraspAttempt) -> tuple[Tensor, Tensor]:
        """Keypoints and the joints' global rotations."""
        return forward_kinematics(axis_angle_to_matrix(self.pose), self.wrist, attempt.offsets)


def grasp_energy(
    solids: Solids, attempt: GraspAttempt, hands: Hands, weight: GraspEnergy
) -> Float[Tensor, " B"]:
    """Energy of each hand; the lower, the better the grasp."""
    joints, turns = hands.posed(attempt)
    centers, radii = hand_spheres(joints, attempt.scale)
    pads, facing = contact_pads(joints, turns, attempt.scale)
    points = torch.cat([centers, pads], 1)
    there, slope = solids.distance_and_normal(points.detach())
    # the same distance, whose gradient is the normal: one evaluation serves both
    distance = there + ((points - points.detach()) * slope).sum(-1)
    depth = (radii - distance[:, : centers.shape[1]]).clamp(min=0)
    for other in attempt.depths_beside_object(joints, turns):
        wrist = other.shape[1] - depth.shape[1]  # zero once the wrist was added
        depth = torch.nn.functional.pad(depth, (0, wrist)) + other.clamp(min=0)
    gap, normal = distance[:, centers.shape[1] :], slope[:, centers.shape[1] :]
    alignment = (1 + (facing * normal).sum(-1)) * attempt.wanted
    overlap = (-finger_clearance(centers, radii)).clamp(min=0)
    unlike = (hands.fingers - attempt.liked) / FINGER_STD
    beyond = (beyond_range(hands.fingers) - weight.range).clamp(min=0)
    missing = gap.abs() + weight.far_contact * gap.square()
    return (
        weight.depth * depth.square().sum(-1)
        + weight.contact * (attempt.wanted * missing).sum(-1)
        + weight.facing * alignment.sum(-1)
        + weight.opposition * _unopposed(attempt, facing, normal, weight.opposed)
        + weight.clearance * overlap.square().sum(-1)
        + (weight.liked * unlike.square() + beyond.square()).sum((-1, -2))
    )


def _unopposed(
    attempt: GraspAttempt,
    facing: Float[Tensor, "B 19 3"],
    normal: Float[Tensor, "B 19 3"],
    opposed: float,
) -> Float[Tensor, " B"]:
    """Mean shortfall from `opposed` of the wanted pairs of a thumb pad and a finger pad."""
    thumb = torch.tensor(PAD_DIGITS) == 4
    grips = torch.tensor([each.bears is None for each in GRASP_TYPES])[attempt.types]
    pairs = (attempt.wanted & thumb)[:, :, None] & (attempt.wanted & ~thumb)[:, None]
    pairs = pairs & grips[:, None, None]
    # each pad should face along the surface normal at the other pad
    agree = facing @ normal.mT + normal @ facing.mT
    return (opposed - agree).clamp(min=0).mul(pairs).sum((1, 2)) / pairs.sum((1, 2)).clamp(min=1)


@dataclass(frozen=True)
class GraspChecks:
    """What a kept grasp must pass."""

    depth: float = 0.003  # no sphere of the hand is deeper in the object, metres
    contact: float = 0.004
    """Distance to the surface below which a pad that the type of grasp uses touches, metres."""
    fingers: int = 0
    """Touching digits required in addition to `GraspType.needed`; if < 0, contacts are ignored."""
    clearance: float = -0.004
    """Gap between spheres of different fingers, metres; less than zero because skin gives way."""
    deviations: float = 2.2
    """Limit of how far an axis-angle component of a finger joint is outside of the range of the
    pose prior, in standard deviations of the prior (`FINGER_STD`)."""
    opposing: float = -0.2
    """Grips: the least cosine between the surface normals at two touching pads is below this."""
    bearing: float = 0.5
    """Hook and support: the cosine between the surface normal and `GraspType.bears` is above this
    at one touching pad or more, and below its negative at none."""
    unheld: float = 0.35
    """Grips: limit of the share of a push that friction at touching pads cannot resist."""
    skin: float = 0.0035
    """How much deeper than `depth` skin may penetrate, metres: spheres omit the palm's flesh."""


def passes(
    solids: Solids, attempt: GraspAttempt, hands: Hands, checks: GraspChecks
) -> Bool[Tensor, " B"]:
    """Grasps that pass every check."""
    joints, turns = hands.posed(attempt)
    centers, radii = hand_spheres(joints, attempt.scale)
    deep = (radii - solids.signed_distance(centers)).amax(-1)
    for other in attempt.depths_beside_object(joints, turns):
        deep = torch.maximum(deep, other.amax(-1))
    kept = (
        (deep < checks.depth)
        & (finger_clearance(centers, radii).amin(-1) > checks.clearance)
        & (beyond_range(hands.fingers).amax((-1, -2)) < checks.deviations)
    )
    if checks.fingers < 0:
        return kept
    pads, _ = contact_pads(joints, turns, attempt.scale)
    return kept & _holds(solids, attempt.types, pads, turns[:, 0], checks)


def _holds(
    solids: Solids,
    types: Int[Tensor, " B"],
    pads: Float[Tensor, "B 19 3"],
    turn: Float[Tensor, "B 3 3"],
    checks: GraspChecks,
) -> Bool[Tensor, " B"]:
    """Whether enough digits touch, on opposing surfaces or under a weight, as the type needs."""
    gap, normal = solids.distance_and_normal(pads)
    likely = of_type("digits", types)[:, list(PAD_DIGITS)] * of_type("pads", types)
    touching = (gap.abs() < checks.contact) & (likely > 0)
    digit = torch.nn.functional.one_hot(torch.tensor(PAD_DIGITS)).bool()
    touches = (touching[..., None] & digit).any(1).sum(-1)
    both = touching[:, :, None] & touching[:, None]
    opposed = torch.where(both, normal @ normal.mT, 1.0).amin((-1, -2)) < checks.opposing
    bears = torch.tensor([each.bears or (0.0, 0.0, 0.0) for each in GRASP_TYPES])[types]
    load = (normal @ (turn @ bears[..., None]))[..., 0]
    lifts = (torch.where(touching, load, -1.0).amax(-1) > checks.bearing) & (
        torch.where(touching, load, 1.0).amin(-1) > -checks.bearing
    )
    firm = opposed & (unheld(pads, normal, touching) < checks.unheld)
    held = torch.where(bears.any(-1), lifts, firm)
    return held & (touches >= of_type("needed", types) + checks.fingers)


def unheld(
    pads: Float[Tensor, "B P 3"], normals: Float[Tensor, "B P 3"], touching: Bool[Tensor, "B P"]
) -> Float[Tensor, " B"]:
    """Share of the worst push that friction at touching pads cannot resist: 0 firm, 1 no grip.

    `normals` are those of the object at the pads, outward.
    """
    weight = touching.float()[..., None]
    middle = (pads * weight).sum(1, keepdim=True) / weight.sum(1, keepdim=True).clamp(min=1)
    scale = pads.new_tensor([1.0] * 3 + [LENGTH] * 3)
    spanned = friction_cones(pads - middle, normals, FRICTION, patch=PATCH) / scale
    spanned = (spanned * weight[..., None]).flatten(1, 2)
    torque = torch.linalg.cross(LEVER * PUSHES.roll(1, 0), PUSHES)
    push = torch.cat([PUSHES, torque / LENGTH], -1).expand(len(pads), -1, -1)
    left = wrench_left(spanned, push).norm(dim=-1) / push.norm(dim=-1)
    return left.amax(1)
