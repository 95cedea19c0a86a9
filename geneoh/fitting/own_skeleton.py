"""The tracker's own rest skeleton, estimated from keypoints and a hand model fitted to them.

Trackers define joints differently: the base of the thumb is 16 mm from the wrist in one and 53 mm
in another, and no shape of a hand model reaches both. A residual of the fitted hand that is
constant over all frames in the local frame of a bone belongs to the tracker's skeleton.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.fitting.terms import HandState
from geneoh.hand.model import ShapedHand
from geneoh.hand.skeleton import (
    MANO_FROM_OPENPOSE,
    bones_at_rest,
    forward_kinematics,
    trust_of_bones,
)

UNSTEADY = 0.1
"""Standard deviation of a bone's measured length, as a share of it, from which it is not taken."""
CORRELATION_FRAMES = 10.0  # of tracker errors: so many frames count as one sample


@dataclass(frozen=True)
class OwnSkeleton:
    """A tracker's rest skeleton, relative to the hand that was fitted to its keypoints."""

    offsets: Float[Tensor, "20 3"]  # rest offsets of this skeleton, metres
    wrist: Float[Tensor, " 3"]  # offset from the fitted wrist to this one, local frame, metres

    def with_lengths(
        self, lengths: Float[Tensor, " 20"], noise: Float[Tensor, " 20"]
    ) -> "OwnSkeleton":
        """The skeleton with bones of `measured_lengths`, as far as these are the same in all
        frames: where the fitted hand bends in another way, mean residuals shorten bones."""
        order = [keypoint - 1 for keypoint in MANO_FROM_OPENPOSE[1:]]
        share = (1 - (noise / (UNSTEADY * lengths)).square()).clamp(min=0).nan_to_num(0.0)[order]
        longer = lengths.nan_to_num(0.0)[order] / self.offsets.norm(dim=-1) - 1
        return replace(self, offsets=self.offsets * (1 + share * longer)[:, None])

    def carried(self, state: HandState) -> HandState:
        """The fitted parameters with the wrist position of this skeleton."""
        moved = (state.rotations[..., 0, :, :] @ self.wrist[:, None])[..., 0]
        return replace(state, wrist=state.wrist + moved)

    def posed(self, state: HandState) -> Float[Tensor, "S T 21 3"]:
        """Keypoints of this skeleton in the pose of a fitted hand, metres, frame of `state`."""
        state = self.carried(state)
        return forward_kinematics(state.rotations, state.wrist, self.offsets)[0]


def own_skeleton(
    state: HandState,
    joints: Float[Tensor, "T 21 3"],
    trust: Float[Tensor, "T 21"],
    shaped: ShapedHand,
) -> OwnSkeleton:
    """The skeleton of keypoints, from the one-sample hand `state` that was fitted to them.

    Each rest offset is the model's plus the mean residual over frames, shrunk by the share that
    scatter between frames explains. A single frame keeps the model's skeleton, and so do bones
    without trust at one end in every frame.
    """
    seen = trust.amax(-1) > 0
    turn, sure = state.rotations[0][seen], trust[seen].to(joints)
    joints = joints[seen]
    bones = bones_at_rest(turn, joints)
    offset = joints[:, 0] - state.wrist[0][seen]
    offset = (turn[:, 0].mT @ offset[..., None])[..., 0]
    weight = torch.cat([sure[:, :1], trust_of_bones(sure)], dim=1)[..., None]
    missed = torch.cat([offset[:, None], bones - shaped.offsets], dim=1)
    kept = _lasting(missed, weight)
    return OwnSkeleton(shaped.offsets + kept[1:], kept[0])


def _lasting(
    missed: Float[Tensor, "T N 3"], weight: Float[Tensor, "T N 1"]
) -> Float[Tensor, "N 3"]:
    """Weighted mean over frames, shrunk by the share of its square that sampling error explains;
    zero without weight."""
    count = weight.sum(0).clamp(min=1e-6)
    mean = (weight * missed).sum(0) / count
    spread = (weight * (missed - mean).square()).sum(0) / (count - 1).clamp(min=1e-6)
    chance = CORRELATION_FRAMES * spread.sum(-1, keepdim=True) / count
    square = mean.square().sum(-1, keepdim=True)
    share = ((square - chance) / square.clamp(min=1e-12)).clamp(min=0)
    return torch.where(count > 1, share, 0.0) * mean
