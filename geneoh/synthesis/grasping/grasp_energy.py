"""Attempts at grasps, and the energy that the search for grasps minimises.

Its terms: penetration, contact of the wanted pads, finger clearance and distance to a liked pose.
Frames: the right hand's rest frame (fingers -x, palm -y, thumb +z) and the object's frame; metres
and radians.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.hand.spheres import finger_clearance, hand_and_wrist_spheres, hand_scale, hand_spheres
from geneoh.synthesis.grasping.contact_pads import PAD_DIGITS, OtherHands, Table, contact_pads
from geneoh.synthesis.grasping.grasp_types import GRASP_TYPES
from geneoh.synthesis.grasping.pose_prior import FINGER_STD, beyond_range
from geneoh.synthesis.shapes.solids import Solids

SOFT = 0.004
"""Penetration of the table that costs nothing, metres: fingers that reach under an object are
soft."""


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
    table: Table | None = None
    other: OtherHands | None = None

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
        centers, radii = hand_and_wrist_spheres(joints, turns, self.scale)
        depths = [] if self.table is None else [self.table.depth(centers, radii) - SOFT]
        return depths if self.other is None else [*depths, self.other.depth(centers, radii)]


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
