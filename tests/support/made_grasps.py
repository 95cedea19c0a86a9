"""Grasps that are not searched for: hands at given places, and a search that takes any grasp."""

import torch
from torch import Tensor

from geneoh.hand.library import load_hand
from geneoh.synthesis.grasping.grasp_energy import GraspChecks
from geneoh.synthesis.grasping.grasp_types import FINGER_MEAN, GRASP_TYPES
from geneoh.synthesis.grasping.grasps import GraspConfig, Grasps

ANY_GRASP = GraspConfig(steps=1, checks=GraspChecks(depth=1.0, fingers=-1, clearance=-1.0))
"""Grasps that hardly descend and always pass: what they are like is tested elsewhere."""


def grasps_at(wrist: Tensor, orient: Tensor | None = None, kind: str = "power") -> Grasps:
    """Half closed right hands of the mean shape whose wrists (B, 3) are somewhere, turned or not.

    Whether they touch is not what moves them.
    """
    count = len(wrist)
    orient = torch.zeros(count, 3) if orient is None else orient
    pose = torch.cat([orient[:, None], FINGER_MEAN.expand(count, 15, 3)], 1)
    offsets = load_hand("right").shaped(torch.zeros(count, 10)).offsets
    types = torch.full((count,), [each.name for each in GRASP_TYPES].index(kind))
    return Grasps(pose, wrist, offsets, torch.ones(count, dtype=torch.bool), types)
