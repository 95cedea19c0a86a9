"""Training losses of the interaction network.

Source: Text2HOI, equations (4) to (7): squared error of the features, of distances to the object
where it is touched, and of the hands' orientations relative to the object. Ours: errors of
keypoints and of their velocities in metres.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.config import Limited
from geneoh.generators.text2hoi.networks.tokens import HAND, Tokens
from geneoh.synthesis.actions.action import TOUCHED, Actions
from geneoh.synthesis.draws import Draws

ERROR_UNIT = 0.1
"""Errors of keypoints and distances are in this unit, metres, so that they are of order one."""
VELOCITY_UNIT = 0.02  # errors of velocities are in this unit, metres from frame to frame
VELOCITY_AT = 0.1  # metres from the object's origin at which its velocity is compared


@dataclass(frozen=True)
class LossWeights(Limited):
    """Weights of the losses beside the simple one; distance and orientation are the paper's."""

    distance: float = 0.5
    orientation: float = 1.0
    keypoints: float = 0.5
    velocity: float = 0.5
    frames: int = 30  # length of the random stretch that all losses but the simple one see
    sharp: bool = True
    """Whether these losses count less for noisier samples, by the signal's share of the variance:
    predictions under much noise are means, which have no sharp geometry (paper: no)."""
    points: int = 64  # points of an object that are compared, the touched ones first (paper: all)


def masked_mean(
    values: Float[Tensor, "*S"], mask: Bool[Tensor, "*#S"], share: Float[Tensor, " B"] | None = None
) -> Float[Tensor, ""]:
    """Mean of the values where the broadcast mask is true; zero if it is true nowhere.

    `share` is a weight of each item of the batch.
    """
    mask = mask.expand_as(values)
    if share is not None:
        values = values * share.view(-1, *[1] * (values.ndim - 1))
    return torch.where(mask, values, 0.0).sum() / mask.sum().clamp(min=1)


def simple_loss(
    found: Float[Tensor, "B T 208"], clean: Float[Tensor, "B T 208"], mask: Bool[Tensor, "B T 208"]
) -> Float[Tensor, ""]:
    """Squared error of normalised features: one mean each for left hand, right hand and object,
    added."""
    square = (found - clean).square()
    ends = (slice(0, HAND), slice(HAND, 2 * HAND), slice(2 * HAND, None))
    return torch.stack([masked_mean(square[..., e], mask[..., e]) for e in ends]).sum()


def geometric_loss(
    found: Tokens,
    clean: Tokens,
    actions: Actions,
    contact: Float[Tensor, "B P"],
    weights: LossWeights,
    draws: Draws,
    share: Float[Tensor, " B"],
) -> Float[Tensor, ""]:
    """All losses but the simple one, weighted and added; `actions` are the clean ones.

    `share` is the weight of each clip.
    """
    start = draws.whole.integers(0, max(1, clean.valid.shape[1] - weights.frames + 1))[0]
    some = slice(int(start), int(start) + weights.frames)
    found, clean, actions = found.take(some, "T"), clean.take(some, "T"), actions.take(some, "T")
    shown = clean.shown[:, :2]
    joints, true = found.joints_on_object(), clean.joints_on_object()
    apart = (joints - true).square().sum(-1) / ERROR_UNIT**2
    total = weights.keypoints * masked_mean(apart, shown[..., None], share)
    total = total + weights.orientation * orientation_loss(found, clean, share)
    total = total + weights.velocity * velocity_loss(found, clean, joints, true, share)
    return total + weights.distance * distance_loss(
        joints, true, actions, contact, shown, weights, draws, share
    )


def orientation_loss(
    found: Tokens, clean: Tokens, share: Float[Tensor, " B"] | None = None
) -> Float[Tensor, ""]:
    """Squared error of the rotations of hands relative to the object, where they are shown."""
    apart = (found.turns_on_object() - clean.turns_on_object()).square().mean((-1, -2))
    return masked_mean(apart, clean.shown[:, :2], share)


def velocity_loss(
    found: Tokens,
    clean: Tokens,
    joints: Float[Tensor, "B 2 T 21 3"],
    true: Float[Tensor, "B 2 T 21 3"],
    share: Float[Tensor, " B"] | None = None,
) -> Float[Tensor, ""]:
    """Squared error of velocities: of keypoints in the object frame, of the object in the world.

    The object's are those of its origin and of points on its axes.
    """
    shown, valid = clean.shown[:, :2], clean.valid
    hands = (joints - true).diff(dim=2).square().sum(-1) / VELOCITY_UNIT**2
    apart = object_places(found) - object_places(clean)
    thing = apart.diff(dim=1).square().sum(-1) / VELOCITY_UNIT**2
    of_hands = masked_mean(hands, (shown[..., 1:] & shown[..., :-1])[..., None], share)
    return of_hands + masked_mean(thing, (valid[:, 1:] & valid[:, :-1])[..., None], share)


def object_places(tokens: Tokens) -> Float[Tensor, "B T 4 3"]:
    """The object's origin, and the points at `VELOCITY_AT` on each of its axes, in the world."""
    origin = tokens.object[..., None, :3]
    return torch.cat([origin, origin + VELOCITY_AT * tokens.object_rotation.mT], dim=2)


def distance_loss(
    joints: Float[Tensor, "B 2 T 21 3"],
    true: Float[Tensor, "B 2 T 21 3"],
    actions: Actions,
    contact: Float[Tensor, "B P"],
    shown: Bool[Tensor, "B 2 T"],
    weights: LossWeights,
    draws: Draws,
    share: Float[Tensor, " B"] | None = None,
) -> Float[Tensor, ""]:
    """Squared error of the distances between object points and keypoints.

    Only pairs that are truly within `TOUCHED` of each other count (paper), of random points. Both
    distances are to the object in the true state of its joint.
    """
    pick = drawn_points(contact, weights.points, draws)
    pick = pick[:, None, :, None].expand(-1, joints.shape[2], -1, 3)
    points = actions.posed_points().gather(2, pick)
    points = points[:, None].expand(-1, 2, -1, -1, -1)
    apart, wanted = (torch.cdist(points, places) for places in (joints, true))
    near = (wanted < TOUCHED) & shown[..., None, None]
    return masked_mean((apart - wanted).square() / ERROR_UNIT**2, near, share)


def drawn_points(contact: Float[Tensor, "B P"], count: int, draws: Draws) -> Int[Tensor, "B C"]:
    """Indices of random points of each object, the touched ones first."""
    order = draws.share(contact.shape[1]).to(contact) + contact
    return order.topk(min(count, contact.shape[1]), dim=1).indices
