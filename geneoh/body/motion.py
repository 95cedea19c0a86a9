"""Motion of a body with fingers: rotations to positions and back."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.body.skeleton import PARENTS, REST_BODY, Skeleton
from geneoh.bundle import Bundle
from geneoh.geometry.kinematics import tree_kinematics

FOOT_HEIGHT = REST_BODY["left_foot"][1]
"""Height of the lowest joint of a body that stands on the ground, metres."""


@dataclass(frozen=True)
class BodyMotion(Bundle):
    """T frames of one body, whatever its skeleton; world frame with y up."""

    root: Float[Tensor, "*B T 3"]
    """Position of the pelvis in the world, metres."""
    rotations: Float[Tensor, "*B T 52 3 3"]
    """Rotation of each joint in its parent's frame, of the root in the world; the identity in the
    T-pose with flat hands."""


@dataclass(frozen=True)
class PosedBody(Bundle):
    """The joints of a body in the world frame, y up."""

    positions: Float[Tensor, "*B T 52 3"]
    """Metres."""
    rotations: Float[Tensor, "*B T 52 3 3"]
    """Joint-to-world rotations."""


def pose(skeleton: Skeleton, motion: BodyMotion) -> PosedBody:
    """The joints of a skeleton that moves; batch axes broadcast."""
    offsets = skeleton.offsets[..., None, 1:, :]
    return PosedBody(*tree_kinematics(motion.rotations, motion.root, offsets, PARENTS))


def body_local_rotations(rotations: Float[Tensor, "*B T 52 3 3"]) -> Float[Tensor, "*B T 52 3 3"]:
    """Rotations in the parents' frames from joint-to-world ones; the inverse of `pose`."""
    above = rotations[..., list(PARENTS[1:]), :, :].transpose(-1, -2)
    return torch.cat([rotations[..., :1, :, :], above @ rotations[..., 1:, :, :]], dim=-3)


def turned_body(motion: BodyMotion, world: Float[Tensor, "3 3"]) -> BodyMotion:
    """The same motion in a rotated world frame: p_new = world @ p."""
    rotations = motion.rotations.clone()
    rotations[..., 0, :, :] = world @ motion.rotations[..., 0, :, :]
    return BodyMotion(motion.root @ world.T, rotations)


def grounded(skeleton: Skeleton, motion: BodyMotion) -> BodyMotion:
    """The same motion over ground at y = 0: the lowest joint of all frames is at `FOOT_HEIGHT`.

    Heights in files are unreliable: SMPL's translation lacks the pelvis' height if the body model
    is unknown, and BOTH57M begins every clip at the origin.
    """
    lowest = pose(skeleton, motion).positions[..., 1].amin((-2, -1))[..., None, None]
    up = motion.root.new_tensor((0.0, 1.0, 0.0))
    return BodyMotion(motion.root + (FOOT_HEIGHT - lowest) * up, motion.rotations)
