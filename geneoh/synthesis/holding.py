"""Whether a grip holds its object when that is pushed: friction cones at the pads that touch."""

import math
from itertools import product

import torch
from jaxtyping import Bool, Float
from torch import Tensor

FRICTION = 1.0  # coefficient of friction of skin on an object, which is moist and soft
PATCH = 0.01  # torque about the normal per newton of a pad's pressure, metres: pads are soft
EDGES = 6  # forces that span a friction cone
PUSHES = torch.tensor(list(product((-1.0, 1.0), repeat=3))) / math.sqrt(3)
"""Directions in which the object is pushed."""
LEVER = 0.02  # distance from the middle of the pads at which it is pushed, metres
LENGTH = 0.03  # torques are divided by this length to count as forces, metres
STEPS = 100  # of projected gradient descent on the forces
PRESSURE_COST = 1e-3
"""Of the squared forces, against the squared push that they leave: bounds what pads can press."""


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
    forces, torques = _cones(pads - middle, normals)
    spanned = torch.cat([forces, torques / LENGTH], -1) * weight[..., None]
    spanned = spanned.flatten(1, 2)
    torque = torch.linalg.cross(LEVER * PUSHES.roll(1, 0), PUSHES)
    push = torch.cat([PUSHES, torque / LENGTH], -1).expand(len(pads), -1, -1)
    steepest = torch.linalg.eigvalsh(spanned.mT @ spanned)[:, -1]
    rate = 1 / (steepest + PRESSURE_COST)[:, None, None]
    size = torch.zeros(*push.shape[:2], spanned.shape[1])
    ahead, before = size, 1.0
    for _ in range(STEPS):  # accelerated, Beck and Teboulle 2009
        slope = (ahead @ spanned - push) @ spanned.mT + PRESSURE_COST * ahead
        pressed = (ahead - rate * slope).clamp(min=0)
        after = (1 + math.sqrt(1 + 4 * before**2)) / 2
        ahead = pressed + (before - 1) / after * (pressed - size)
        size, before = pressed, after
    left = (size @ spanned - push).norm(dim=-1) / push.norm(dim=-1)
    return left.amax(1)


def _cones(
    arms: Float[Tensor, "B P 3"], normals: Float[Tensor, "B P 3"]
) -> tuple[Float[Tensor, "B P E 3"], Float[Tensor, "B P E 3"]]:
    """Forces along the edges of each friction cone, and their torques; half turn each way."""
    least = torch.nn.functional.one_hot(normals.abs().argmin(-1), 3).to(normals)
    aside = torch.linalg.cross(normals, least)
    aside = torch.nn.functional.normalize(aside, dim=-1)
    across = torch.linalg.cross(normals, aside)
    angle = 2 * math.pi * torch.arange(EDGES) / EDGES
    edge = aside[:, :, None] * angle.cos()[:, None] + across[:, :, None] * angle.sin()[:, None]
    forces = FRICTION * edge - normals[:, :, None]
    turns = PATCH * (1 - 2 * (torch.arange(EDGES) % 2))[:, None] * normals[:, :, None]
    return forces, torch.linalg.cross(arms[:, :, None].expand_as(forces), forces) + turns
