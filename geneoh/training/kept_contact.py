"""Hands that move more than they were made to, brought back to the surface that they touched.

Real hands slide over what they hold, turn on it and shift their fingers, and their skin stays at
the surface meanwhile. Motion that is added to a made hand takes it off the surface or into it.
"""

from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.config import Limited, Limits
from geneoh.fitting.terms import MOVES_KEYPOINT
from geneoh.hand.skeleton import MANO_FROM_OPENPOSE
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.parameters import UNIT, HandParameters
from geneoh.representation.region import ObjectSurface
from geneoh.synthesis.smoothing import smoothed


@dataclass(frozen=True)
class KeptContactConfig(Limited):
    """How many hands are brought back, and how exactly; lengths in metres."""

    LIMITS: ClassVar[Limits] = {
        "share": (0, 1),
        "rounds": (0, 20),
        **dict.fromkeys(("near", "fade", "deviation", "smoothing"), (1e-6, 1000)),
    }

    share: float = 0.0  # share of the windows whose hand is brought back
    rounds: int = 2  # corrections, one after the other; 0 leaves the hands where they are
    near: float = 0.012
    """Height of keypoints over the surface up to which they count as touching it."""
    fade: float = 0.006  # deviation of the bell curve by which higher ones count less
    deviation: float = 0.0015  # of the height that is kept
    smoothing: float = 1.5  # deviation over which corrections are smoothed, frames


def with_kept_contact(
    hand: HandParameters,
    before: HandParameters,
    surface: ObjectSurface,
    config: KeptContactConfig | None = None,
    chosen: Bool[Tensor, " B"] | None = None,
) -> HandParameters:
    """Hands whose keypoints are as high over the surface as they were `before`, where that is near.

    Others come no nearer than they were, or than `near`. World frame in and out, smooth over time.
    With `chosen`, the hands of the other windows stay as they are.
    """
    config = config or KeptContactConfig()
    wanted = _heights(before.joints, surface)[0]
    touching = torch.exp(-0.5 * ((wanted - config.near).clamp(min=0) / config.fade) ** 2)
    least = wanted.clamp(max=config.near)
    for _ in range(config.rounds):
        height, normal = _heights(hand.joints, surface)
        # keypoints that did not touch keep out of the object
        away = (height < least) & (touching < 0.5)
        weight = torch.where(away, 1.0, touching)
        missing = torch.where(away, least, wanted) - height
        change = smoothed(_correction(hand, normal, missing, weight, config), config.smoothing)
        hand = hand.moved(change if chosen is None else change * chosen[:, None, None])
    return hand


def _heights(
    joints: Float[Tensor, "B T 21 3"], surface: ObjectSurface
) -> tuple[Float[Tensor, "B T 21"], Float[Tensor, "B T 21 3"]]:
    """Heights of keypoints over the plane of the nearest surface point, and its outward normal."""
    near = nearest_on_parts(joints, surface)
    return ((joints - near.points) * near.normals).sum(-1), near.normals


def _correction(
    hand: HandParameters,
    normal: Float[Tensor, "B T 21 3"],
    missing: Float[Tensor, "B T 21"],
    weight: Float[Tensor, "B T 21"],
    config: KeptContactConfig,
) -> Float[Tensor, "B T 51"]:
    """The most probable change, in units of `UNIT`, that raises keypoints by `missing`.

    Units are the prior deviations, and heights have a deviation of their own: the mean of a
    Gaussian given 21 linear measurements.
    """
    joints, turn = hand.posed
    order = list(MANO_FROM_OPENPOSE)
    mano = joints[..., order, :]
    moved, by = MOVES_KEYPOINT.to(mano.device).unbind(1)
    # turning joint j by w in its own frame moves a point p by (G_j w) x (p - p_j)
    lever = torch.linalg.cross(
        mano[..., moved, :] - mano[..., by, :], normal[..., order, :][..., moved, :], dim=-1
    )
    rotate = mano.new_zeros(*mano.shape[:-1], 16, 3)
    rotate[..., moved, by, :] = (lever[..., None, :] @ turn[..., by, :, :])[..., 0, :]
    shift = normal[..., order, :]
    slope = torch.cat([shift, rotate.flatten(-2)], -1) * mano.new_tensor(UNIT)
    slope = slope * weight[..., order, None]
    wanted = (missing * weight)[..., order, None]
    system = slope @ slope.mT + config.deviation**2 * torch.eye(21).to(slope)
    return (slope.mT @ torch.linalg.solve(system, wanted))[..., 0]
