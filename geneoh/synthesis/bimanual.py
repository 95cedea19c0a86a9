"""Two hands on one object: the second is a right hand on the object's mirror image."""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.grasps import Grasps
from geneoh.synthesis.solids import FAR, TORUS, Solids

SHARE = 0.2
"""Second hands tried for each first one; not all are kept, and many meet the first."""
APART = 0.025
"""Least distance between keypoints of two hands, metres: each has skin around it."""
LIKENESS = 0.005
"""Relative spread of bone lengths between a person's two hands."""


def leads(solids: Solids, count: int) -> Int[Tensor, " C"]:
    """Those of so many objects that a second hand is tried on: the largest, where two have room."""
    return _extents(solids)[:count].amax(-1).topk(int(SHARE * count)).indices


def sides(solids: Solids, lead: Int[Tensor, " C"]) -> Float[Tensor, "B 3"]:
    """For each attempt the side of the object that its hand comes from; zero for any.

    First and second hands have the two ends of the longest axis, each in the frame of its object.
    """
    extents = _extents(solids)
    longest = torch.nn.functional.one_hot(extents.argmax(-1), 3).to(extents)
    side = torch.zeros_like(longest)
    side[lead] = longest[lead]
    side[len(side) - len(lead) :] = -longest[lead] * side.new_tensor([-1.0, 1.0, 1.0])
    return side


def _extents(solids: Solids) -> Float[Tensor, "B 3"]:
    """How far an object reaches along each axis of its frame, about, metres."""
    ring, tube, _ = solids.size.unbind(-1)
    flat = torch.stack([ring + tube, ring + tube, tube], dim=-1)
    size = torch.where((solids.kind == TORUS)[..., None], flat, solids.size)
    reach = solids.center.abs() + (solids.rotation.abs() @ size[..., None])[..., 0]
    return (reach * (solids.center[..., :1] < FAR / 2)).amax(1)


def first_hands(grasps: Grasps, lead: Int[Tensor, " C"]) -> Int[Tensor, " D"]:
    """Of the grasps that are kept, the number among them of the first hand of each second; else -1.

    Two hands that would meet are no pair, but each a hand alone.

    Args:
        grasps: as tried; the last are second hands.
        lead: their first hands.
    """
    single = len(grasps.kept) - len(lead)
    joints = forward_kinematics(axis_angle_to_matrix(grasps.pose), grasps.wrist, grasps.offsets)[0]
    flip = joints.new_tensor([-1.0, 1.0, 1.0])
    gap = torch.cdist(joints[lead], joints[single:] * flip).amin((1, 2))
    both = grasps.kept[lead] & grasps.kept[single:] & (gap > APART)
    place = grasps.kept.cumsum(0) - 1
    first = torch.full((len(grasps.kept),), -1)
    first[single:] = torch.where(both, place[lead], -1)
    return first[grasps.kept]
