"""Whether a grip holds its object when that is pushed: friction cones at the pads that touch."""

import math
from itertools import product

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.forces import friction_cones, wrench_left

FRICTION = 1.0  # coefficient of friction of skin on an object, which is moist and soft
PATCH = 0.01  # torque about the normal per newton of a pad's pressure, metres: pads are soft
PUSHES = torch.tensor(list(product((-1.0, 1.0), repeat=3))) / math.sqrt(3)
"""Directions in which the object is pushed."""
LEVER = 0.02  # distance from the middle of the pads at which it is pushed, metres
LENGTH = 0.03  # torques are divided by this length to count as forces, metres


def unheld(
    pads: Float[Tensor, "B P 3"],
    normals: Float[Tensor, "B P 3"],
    touching: Bool[Tensor, "B P"],
) -> Float[Tensor, " B"]:
    """The share of the worst push that touching pads cannot bear: 0 is firm, 1 no grip at all.

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
