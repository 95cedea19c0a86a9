"""Of several actions that were drawn for the same sentence, the one that is most like the others.

A single draw now and then falls between two ways of doing something, where no real action is; such
a one is far from the others.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.synthesis.actions import Actions

ARM = 0.1
"""Metres from its middle, along each of its axes, at which an object is compared."""


def most_typical(
    actions: Actions, draws: int, fits: Bool[Tensor, " B"] | None = None
) -> Int[Tensor, " G"]:
    """The number of one of each `draws` neighbours: the one nearest to the others on average.

    Where some of them fit, it is one of those, and they alone count as others. The distance is that
    of keypoints of hands that take part, plus that of the object, each a mean over the frames of a
    clip.
    """
    places, weight = compared_points(actions)
    groups = places.unflatten(0, (-1, draws))
    apart = (groups[:, :, None] - groups[:, None]).norm(dim=-1)
    distance = (apart * weight.unflatten(0, (-1, draws))[:, :, None]).sum((-1, -2))
    fits = torch.ones_like(weight[:, 0, 0], dtype=torch.bool) if fits is None else fits
    fitting = fits.unflatten(0, (-1, draws))
    fitting = fitting | ~fitting.any(1, keepdim=True)
    distance = (distance * fitting[:, None]).sum(2).masked_fill(~fitting, torch.inf)
    first = torch.arange(len(groups), device=distance.device) * draws
    return first + distance.argmin(1)


def compared_points(
    actions: Actions,
) -> tuple[Float[Tensor, "B T 45 3"], Float[Tensor, "B T 45"]]:
    """Keypoints of both hands and three points of the object, and how much each of them counts."""
    hands = actions.keypoints().transpose(1, 2).flatten(2, 3)
    object_ = actions.translation[:, :, None] + ARM * actions.rotation.mT
    frames, taking = actions.rotation.shape[1], actions.hands.to(hands)
    there = torch.arange(frames, device=hands.device) < actions.length[:, None]
    of_hands = (taking / taking.sum(1, keepdim=True)).repeat_interleave(21, dim=1) / 21
    each = torch.cat([of_hands, torch.full_like(of_hands[:, :3], 1 / 3)], dim=1)
    shares = there / actions.length[:, None]
    return torch.cat([hands, object_], dim=2), shares[..., None] * each[:, None]
