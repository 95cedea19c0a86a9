"""Forces through contacts: friction cones, and how much of a required wrench they can bear.

A wrench is a force and a torque, side by side.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

EDGES = 6  # forces that span a friction cone
STEPS = 100  # of projected gradient descent on the forces
PRESSURE_COST = 1e-3
"""Weight of the squared forces against the squared residual wrench; it bounds the forces."""


def friction_cones(
    arms: Float[Tensor, "*B P 3"],
    normals: Float[Tensor, "*B P 3"],
    friction: float,
    *,
    edges: int = EDGES,
    patch: float = 0.0,
) -> Float[Tensor, "*B P E 6"]:
    """Wrenches on an object along the edges of the friction cone of each contact.

    Each has one newton along the inward normal. The pyramid of the edges lies inside the cone.

    Args:
        arms: vectors from the centre of the torques to the contacts, metres.
        normals: unit normals of the object's surface there, outward.
        friction: coefficient of friction.
        edges: number of edges E of each pyramid.
        patch: torque about the normal that a soft contact bears per newton of normal force,
            metres; its sign alternates from edge to edge.
    """
    least = torch.nn.functional.one_hot(normals.abs().argmin(-1), 3).to(normals)
    aside = torch.linalg.cross(normals, least)
    aside = torch.nn.functional.normalize(aside, dim=-1)
    across = torch.linalg.cross(normals, aside)
    angle = 2 * math.pi * torch.arange(edges).to(normals) / edges
    edge = aside[..., None, :] * angle.cos()[:, None] + across[..., None, :] * angle.sin()[:, None]
    forces = friction * edge - normals[..., None, :]
    sense = 1 - 2 * (torch.arange(edges).to(normals) % 2)
    turns = patch * sense[:, None] * normals[..., None, :]
    torques = torch.linalg.cross(arms[..., None, :].expand_as(forces), forces) + turns
    return torch.cat([forces, torques], -1)


def wrench_left(
    spanned: Float[Tensor, "*B K 6"], wanted: Float[Tensor, "*B N 6"], *, steps: int = STEPS
) -> Float[Tensor, "*B N 6"]:
    """Residual of each required wrench after the best sum of K wrenches with weights >= 0.

    Non-negative least squares by accelerated projected gradient descent, with `PRESSURE_COST` on
    the squared weights. Newtons and newton metres count alike: divide torques by a length first.

    Source: Beck and Teboulle, A Fast Iterative Shrinkage-Thresholding Algorithm, 2009.
    """
    steepest = torch.linalg.eigvalsh(spanned.mT @ spanned)[..., -1]
    rate = 1 / (steepest + PRESSURE_COST)[..., None, None]
    size = wanted.new_zeros(*wanted.shape[:-1], spanned.shape[-2])
    ahead, before = size, 1.0
    for _ in range(steps):
        slope = (ahead @ spanned - wanted) @ spanned.mT + PRESSURE_COST * ahead
        pressed = (ahead - rate * slope).clamp(min=0)
        after = (1 + math.sqrt(1 + 4 * before**2)) / 2
        ahead = pressed + (before - 1) / after * (pressed - size)
        size, before = pressed, after
    return size @ spanned - wanted
