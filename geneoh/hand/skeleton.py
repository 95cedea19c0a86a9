"""The hand's kinematic tree: joint names, keypoint order, forward kinematics without a mesh.

Conventions: the 16 joints stand in MANO order (wrist, index, middle, pinky, ring, thumb); the 21
keypoints in OpenPose order (wrist, thumb, index, middle, ring, pinky, each from base to tip). A
skeleton is 20 rest offsets in the flat hand's frame: 15 bones (parent joint to joint), then 5 tips
(distal joint to fingertip) in the order index, middle, pinky, ring, thumb.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry import kinematics

PARENTS = (-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 13, 14)
TIP_PARENTS = (3, 6, 9, 12, 15)
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
"""Fingers in the order of the joints."""
KEYPOINT_FINGERS = ("thumb", "index", "middle", "ring", "pinky")
"""Fingers in the order of the keypoints."""

OPENPOSE_FROM_MANO = (0, 13, 14, 15, 20, 1, 2, 3, 16, 4, 5, 6, 17, 10, 11, 12, 19, 7, 8, 9, 18)
"""Keypoint i is entry OPENPOSE_FROM_MANO[i] of the 16 MANO joints followed by the 5 tips."""
MANO_FROM_OPENPOSE = tuple(OPENPOSE_FROM_MANO.index(i) for i in range(21))
KEYPOINT_PARENTS = tuple(
    -1 if m == 0 else OPENPOSE_FROM_MANO.index(PARENTS[m] if m < 16 else TIP_PARENTS[m - 16])
    for m in OPENPOSE_FROM_MANO
)
"""Keypoint that the bone ending in keypoint i starts from; -1 for the wrist."""
TIP_KEYPOINTS = tuple(OPENPOSE_FROM_MANO.index(16 + i) for i in range(5))

SMALLEST_HAND, LARGEST_HAND = 0.03, 1.0
"""Limits in metres of the distance between the keypoints that are farthest apart. A child's fist
has 0.06, a spread adult hand 0.25, and the largest noise in use adds centimetres."""


def forward_kinematics(
    rotations: Float[Tensor, "*#B 16 3 3"],
    wrist: Float[Tensor, "*#B 3"],
    offsets: Float[Tensor, "*#B 20 3"],
) -> tuple[Float[Tensor, "*B 21 3"], Float[Tensor, "*B 16 3 3"]]:
    """Keypoints in OpenPose order and the joints' global rotations, in the frame of `wrist`.

    `rotations` are relative to the parent joint, the wrist's relative to the world.
    """
    points, glob = kinematics.tree_kinematics(rotations, wrist, offsets, (*PARENTS, *TIP_PARENTS))
    return points[..., list(OPENPOSE_FROM_MANO), :], glob


def rest_offsets(
    rotations: Float[Tensor, "T 16 3 3"],
    joints: Float[Tensor, "T 21 3"],
    trust: Float[Tensor, "T 21"],
) -> Float[Tensor, "20 3"]:
    """The rest skeleton of a posed track: forward kinematics solved for the offsets.

    Each bone is rotated back to the rest frame; the least-squares solution is the mean over frames,
    weighted by the trust in the keypoints at both ends. A bone without trust in any frame gets the
    unweighted mean over the frames in which any keypoint is trusted.
    """
    seen = trust.amax(-1) > 0
    at_rest = bones_at_rest(rotations[seen], joints[seen])
    weight = trust_of_bones(trust[seen].to(joints))[..., None]
    weight = torch.where(weight.sum(0) > 0, weight, 1.0)
    return (weight * at_rest).sum(0) / weight.sum(0)


def bones_at_rest(
    rotations: Float[Tensor, "T 16 3 3"], joints: Float[Tensor, "T 21 3"]
) -> Float[Tensor, "T 20 3"]:
    """The bones of each frame, rotated back to the rest frame; ordered as rest offsets."""
    _, glob = forward_kinematics(rotations, joints[:, 0], joints.new_zeros(20, 3))
    mano = joints[:, list(MANO_FROM_OPENPOSE)]
    parents = [*PARENTS[1:], *TIP_PARENTS]
    bones = mano[:, 1:] - mano[:, parents]
    return (glob[:, parents].transpose(-1, -2) @ bones[..., None])[..., 0]


def trust_of_bones(trust: Float[Tensor, "T 21"]) -> Float[Tensor, "T 20"]:
    """The product of the trust in the keypoints at both ends; ordered as rest offsets."""
    mano = trust[:, list(MANO_FROM_OPENPOSE)]
    return mano[:, 1:] * mano[:, [*PARENTS[1:], *TIP_PARENTS]]


def bone_lengths(joints: Float[Tensor, "*B 21 3"]) -> Float[Tensor, "*B 20"]:
    """Length of the 20 bones in metres, ordered by the keypoint (1 to 20) that each one ends in."""
    return (joints[..., 1:, :] - joints[..., list(KEYPOINT_PARENTS[1:]), :]).norm(dim=-1)
