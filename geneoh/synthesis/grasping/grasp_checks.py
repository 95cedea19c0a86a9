"""Which grasps are kept: hands that penetrate little and whose contacts can hold the object."""

import math
from dataclasses import dataclass
from itertools import product

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.forces import friction_cones, wrench_left
from geneoh.hand.spheres import finger_clearance, hand_spheres
from geneoh.synthesis.grasping.contact_pads import PAD_DIGITS, contact_pads
from geneoh.synthesis.grasping.grasp_energy import GraspAttempt, Hands
from geneoh.synthesis.grasping.grasp_types import GRASP_TYPES, of_type
from geneoh.synthesis.grasping.pose_prior import beyond_range
from geneoh.synthesis.shapes.solids import Solids

FRICTION = 1.0  # coefficient of friction of skin, which is moist and soft
PATCH = 0.01  # torque about the normal per newton of a pad's pressure, metres: pads are soft
PUSHES = torch.tensor(list(product((-1.0, 1.0), repeat=3))) / math.sqrt(3)
"""Directions in which the object is pushed to test a grip."""
LEVER = 0.02  # distance of a push from the middle of the pads, metres
LENGTH = 0.03  # torques are divided by this length to count as forces, metres


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
