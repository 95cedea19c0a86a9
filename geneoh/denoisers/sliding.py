"""Evidence of an error that lasts: at a wrong place the hand slides over the object that it holds.

A hand that holds an object stays where it is in the object's frame. An error that is constant in
the world turns there as the object turns, so the hand seems to slide. The network of SpatialDiff
looks at each frame by itself and cannot see this, and made hands slide less than real ones; so the
density is written down: sliding is normal, of a deviation that is not known beforehand. No preset
uses it (docs/training.md, "What was tried").
"""

import torch
from jaxtyping import Float
from torch import Tensor

SLIDING = 0.005
"""Deviation of a hand's place in the object's frame below which hardly any hand keeps, metres."""


def sliding_density(
    shifts: Float[Tensor, "B M 3"],
    joints: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T Q 3 3"],
    translation: Float[Tensor, "B T Q 3"],
    held: Float[Tensor, "B T Q"],
    noise: Float[Tensor, "B 2"],
    independent: float,
) -> Float[Tensor, "B M"]:
    """Logarithm of the density, up to a constant, of how a hand slides where it is shifted.

    World frame, metres. `held`, 0 to 1, is how surely the hand holds each part of the object in
    each frame; the part that is held longest counts. The density is normal with its deviation
    integrated out, a Student t: a hand that slides far, as one that lets go does, tells little. The
    place of a hand is the mean of its keypoints: people turn objects about it as they hold them.
    `noise` is the deviation of white noise on the object's rotation (rad) and translation (m): a
    hand that holds such an object seems to slide. `independent` is how many frames that tell
    something of their own there are in one of the T: slow sliding lasts.
    """
    each, longest = torch.arange(len(held)), held.sum(1).argmax(-1)
    rotation, translation, held = (x[each, :, longest] for x in (rotation, translation, held))
    back = rotation.mT
    middle = joints.mean(2) - translation
    share = held / held.sum(1, keepdim=True).clamp(min=1e-6)

    def from_mean(values: Float[Tensor, "B T *D"]) -> Float[Tensor, "B T *D"]:
        weights = share.view(*share.shape, *[1] * (values.ndim - 2))
        return values - (weights * values).sum(1, keepdim=True)

    own = (back @ middle[..., None])[..., 0]
    lever = (share * own.square().sum(-1)).sum(1, keepdim=True)
    least = SLIDING**2 + noise[:, :1].square() * lever + noise[:, 1:].square()
    slid = from_mean(own)
    turned = from_mean(back)
    # the mean square of |slid + turned @ shift|, without a place for each frame and shift
    square = (share[..., None, None] * turned.mT @ turned).sum(1)
    line = (share[..., None, None] * turned.mT @ slid[..., None]).sum(1)[..., 0]
    still = (share * slid.square().sum(-1)).sum(1, keepdim=True)
    size = ((shifts @ square) * shifts).sum(-1) + 2 * (shifts @ line[..., None])[..., 0] + still
    count = independent * held.sum(1, keepdim=True)
    return -1.5 * count * torch.log1p(size.clamp(min=0) / least)
