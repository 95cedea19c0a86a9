"""The skeleton that keypoints have, seen from a hand model that was fitted to them.

Trackers place joints each in their own way: the base of the thumb is 16 mm from the wrist in one
and 53 mm in another, and no shape of a hand model reaches both. What a fitted hand misses in the
same way in all frames, in the frames of its own bones, is no error but the tracker's skeleton.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.fitting.terms import HandState
from geneoh.hand.model import ShapedHand
from geneoh.hand.skeleton import bones_at_rest, forward_kinematics, trust_of_bones

ALIKE = 10.0  # frames for which errors of a tracker stay alike: they tell no more than one


@dataclass(frozen=True)
class OwnSkeleton:
    """Where the keypoints of a track are on the hand that was fitted to it."""

    offsets: Float[Tensor, "20 3"]  # its rest offsets, metres
    wrist: Float[Tensor, " 3"]  # its wrist from that of the hand, in the frame of the wrist, metres

    def carried(self, state: HandState) -> HandState:
        """The fitted parameters with the place of this skeleton's wrist."""
        moved = (state.rotations[..., 0, :, :] @ self.wrist[:, None])[..., 0]
        return replace(state, wrist=state.wrist + moved)

    def posed(self, state: HandState) -> Float[Tensor, "S T 21 3"]:
        """Keypoints of this skeleton on a fitted hand, metres, in its frame."""
        state = self.carried(state)
        return forward_kinematics(state.rotations, state.wrist, self.offsets)[0]


def own_skeleton(
    state: HandState,
    joints: Float[Tensor, "T 21 3"],
    trust: Float[Tensor, "T 21"],
    shaped: ShapedHand,
) -> OwnSkeleton:
    """The skeleton of keypoints by a hand of one sample that was fitted to them.

    Each bone is the mean over frames as far as it differs from the model's by more than its scatter
    explains; a single frame has the model's.
    """
    seen = trust.amax(-1) > 0
    turn, sure = state.rotations[0][seen], trust[seen].to(joints)
    joints = joints[seen]
    bones = bones_at_rest(turn, joints)
    off = joints[:, 0] - state.wrist[0][seen]
    off = (turn[:, 0].mT @ off[..., None])[..., 0]
    weight = torch.cat([sure[:, :1], trust_of_bones(sure)], dim=1)[..., None]
    missed = torch.cat([off[:, None], bones - shaped.offsets], dim=1)
    kept = _lasting(missed, torch.where(weight.sum(0) > 0, weight, 1.0))
    return OwnSkeleton(shaped.offsets + kept[1:], kept[0])


def _lasting(
    missed: Float[Tensor, "T N 3"], weight: Float[Tensor, "T N 1"]
) -> Float[Tensor, "N 3"]:
    """Weighted mean over frames, times the share of its square that chance does not explain."""
    count = weight.sum(0)
    mean = (weight * missed).sum(0) / count
    spread = (weight * (missed - mean).square()).sum(0) / (count - 1).clamp(min=1e-6)
    chance = ALIKE * spread.sum(-1, keepdim=True) / count
    square = mean.square().sum(-1, keepdim=True)
    share = ((square - chance) / square.clamp(min=1e-12)).clamp(min=0)
    return torch.where(count > 1, share, 0.0) * mean
