"""Losses of the refiner: near the true hands, not in the object, touching where hands nearly do.

Source: Text2HOI, section 3.5. Squared distances, as the paper writes them.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import spread
from geneoh.choices import SIDES
from geneoh.config import Limited
from geneoh.generators.text2hoi.losses import UNIT, masked_mean
from geneoh.generators.text2hoi.refiner import nearest
from geneoh.generators.text2hoi.tokens import Tokens
from geneoh.hand.library import load_hand
from geneoh.synthesis.actions import NEAR

CENTIMETRE = 0.01
"""Depths and gaps are in this unit, metres, so that they are of order one."""


@dataclass(frozen=True)
class RefinerWeights(Limited):
    """Weights of the losses; those of the paper are 1, 1, 5, in squared metres, and 0."""

    simple: float = 1.0
    penetration: float = 1.0
    contact: float = 5.0
    keypoints: float = 1.0  # squared error of keypoints in units of a decimetre (ours)
    frames: int = 4  # frames of a clip whose contact and penetration are looked at (paper: all)


def refiner_loss(
    found: Tokens,
    coarse: Tokens,
    clean: Tokens,
    points: Float[Tensor, "B T P 3"],
    normals: Float[Tensor, "B T P 3"],
    weights: RefinerWeights,
) -> Float[Tensor, ""]:
    """All losses, weighted and added."""
    shown = clean.shown[:, :2]
    total = weights.simple * masked_mean((found.hands - clean.hands).square(), shown[..., None])
    joints = found.joints()
    if weights.keypoints:
        apart = (joints - clean.joints()).square().sum(-1) / UNIT**2
        total = total + weights.keypoints * masked_mean(apart, shown[..., None])
    every = spread(points.shape[1], weights.frames).unique()
    some, points, normals = found.take(every, "T"), points[:, every], normals[:, every]
    before = coarse.take(every, "T").joints()
    touch = contact_loss(joints[:, :, every], before, points, shown[:, :, every])
    inside = penetration_loss(some, points, normals)
    return total + weights.contact * touch + weights.penetration * inside


def contact_loss(
    joints: Float[Tensor, "B 2 T 21 3"],
    coarse: Float[Tensor, "B 2 T 21 3"],
    points: Float[Tensor, "B T P 3"],
    shown: Bool[Tensor, "B 2 T"],
) -> Float[Tensor, ""]:
    """Squared distance of keypoints to the point that is nearest to where they were, in cm2.

    Keypoints count that were within `NEAR` of the object.
    """
    goal = nearest(coarse, points)
    touches = ((goal - coarse).norm(dim=-1) < NEAR) & shown[..., None]
    return masked_mean((joints - goal).square().sum(-1) / CENTIMETRE**2, touches)


def penetration_loss(
    tokens: Tokens, points: Float[Tensor, "B T P 3"], normals: Float[Tensor, "B T P 3"]
) -> Float[Tensor, ""]:
    """Squared depth of the hands' vertices below the plane of the nearest point, in cm2.

    A mean over the vertices that are inside. Deeper than `NEAR` a vertex is on another side.
    """
    total, count = points.new_zeros(()), points.new_zeros(())
    for number, side in enumerate(SIDES):
        hand = load_hand(side).to(points.device).shaped(points.new_zeros(10))
        verts = hand.verts_from_rotations(
            tokens.rotations[:, number], tokens.hands[:, number, :, :3]
        )
        index = torch.cdist(verts.verts, points).argmin(-1)[..., None].expand(-1, -1, -1, 3)
        apart = verts.verts - points.gather(2, index)
        depth = -(apart * normals.gather(2, index)).sum(-1)
        inside = (depth > 0) & (apart.norm(dim=-1) < NEAR) & tokens.shown[:, number, :, None]
        total = total + torch.where(inside, depth, 0.0).square().sum() / CENTIMETRE**2
        count = count + inside.sum()
    return total / count.clamp(min=1)
