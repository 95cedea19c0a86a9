"""Features of a posed body that the networks see: 198 of the body, 270 of the fingers.

Each set holds all positions first, then all 6D rotations, as two columns of their matrices (the
paper's code takes rows). Joints of the left hand's fingers come before those of the right hand.

Source: BOTH2Hands, section 4.1 (positions and rotations in the world) and 4.2 (hands alone). In the
frame "wrist", which is ours for the hands of both branches, a finger's position and rotation are in
the frame of its wrist, as in the code for section 4.2 (the text has rotations from the parent), and
a body's in that of its pelvis' heading: the features of a hand's shape then do not depend on where
the body goes.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from geneoh.body.motion import BodyMotion, PosedBody, body_local_rotations, pose
from geneoh.body.skeleton import BODY_JOINTS, FINGER_JOINTS, JOINT_NAMES, WRISTS, Skeleton
from geneoh.bundle import Bundle
from geneoh.choices import SIDES
from geneoh.geometry.rotations import matrix_to_rotation_6d, rotation_6d_to_matrix

HandsFrame = Literal["wrist", "world"]
"""Frame of the fingers' features: each wrist's, or the world's."""
BODY = 9 * BODY_JOINTS
FINGERS = len(JOINT_NAMES) - BODY_JOINTS
HANDS = 9 * FINGERS
WRIST_OF = tuple(WRISTS[side] for side in SIDES for _ in FINGER_JOINTS[side])
"""The wrist of each finger joint."""
Scaling = Literal["deviation", "range"]
"""How features are normalised: each by its standard deviation; or positions by their range, to -1
to 1, with rotations left as they are (paper's code)."""
LEAST_SCALE = (0.005, 0.02)
"""Lower bounds of the scale of a position (metres) and of a rotation's entry."""


def placed(motion: BodyMotion, frame: HandsFrame) -> BodyMotion:
    """The motion moved and turned so that the pelvis is above the origin and faces +z: in the first
    frame for "world", as in the paper, in every frame for "wrist"."""
    forward = motion.rotations[..., 0, :, 2]
    root = motion.root * motion.root.new_tensor([1.0, 0.0, 1.0])
    if frame == "world":
        forward, root = forward[..., :1, :], root[..., :1, :]
    away = heading(forward).mT
    turned = torch.cat(
        [away[..., None, :, :] @ motion.rotations[..., :1, :, :], motion.rotations[..., 1:, :, :]],
        dim=-3,
    )
    return BodyMotion((away @ (motion.root - root)[..., None])[..., 0], turned)


def heading(forward: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3 3"]:
    """The rotation about y that turns +z to the horizontal direction of a vector."""
    angle = torch.atan2(forward[..., 0], forward[..., 2])
    sine, cosine, zero = angle.sin(), angle.cos(), torch.zeros_like(angle)
    rows = [cosine, zero, sine, zero, zero + 1, zero, -sine, zero, cosine]
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def body_features(posed: PosedBody) -> Float[Tensor, "*B T 198"]:
    """Features of the body's joints without the fingers."""
    return _flat(posed.positions[..., :BODY_JOINTS, :], posed.rotations[..., :BODY_JOINTS, :, :])


def hand_features(posed: PosedBody, frame: HandsFrame) -> Float[Tensor, "*B T 270"]:
    """Features of the fingers' joints."""
    places, turned = posed.positions[..., BODY_JOINTS:, :], posed.rotations[..., BODY_JOINTS:, :, :]
    if frame == "wrist":
        away = posed.rotations[..., WRIST_OF, :, :].mT
        places = (away @ (places - posed.positions[..., WRIST_OF, :])[..., None])[..., 0]
        turned = away @ turned
    return _flat(places, turned)


def with_fingers(
    motion: BodyMotion, posed: PosedBody, features: Float[Tensor, "*B T 270"], frame: HandsFrame
) -> BodyMotion:
    """The motion with finger rotations decoded from features, whose positions are not used.

    Features are those of `hand_features` in `frame`, or a prediction, whose rotations need not be
    orthonormal; in the frame "world" they belong to the wrists of `posed`, the motion's joints.
    """
    turned = rotation_6d_to_matrix(features[..., 3 * FINGERS :].unflatten(-1, (FINGERS, 6)))
    if frame == "wrist":
        turned = posed.rotations[..., WRIST_OF, :, :] @ turned
    whole = torch.cat([posed.rotations[..., :BODY_JOINTS, :, :], turned], dim=-3)
    return with_other_fingers(motion, body_local_rotations(whole)[..., BODY_JOINTS:, :, :])


def with_other_fingers(motion: BodyMotion, fingers: Float[Tensor, "*B T 30 3 3"]) -> BodyMotion:
    """The motion with other rotations of the finger joints, each in the frame of its parent."""
    body = motion.rotations[..., :BODY_JOINTS, :, :]
    return BodyMotion(motion.root, torch.cat([body, fingers], dim=-3))


def _flat(
    positions: Float[Tensor, "*B J 3"], rotations: Float[Tensor, "*B J 3 3"]
) -> Float[Tensor, "*B N"]:
    return torch.cat([positions.flatten(-2), matrix_to_rotation_6d(rotations).flatten(-2)], dim=-1)


@dataclass(frozen=True)
class PlacedBodies(Bundle):
    """B windows of bodies, placed as the networks see them."""

    skeleton: Skeleton
    motion: BodyMotion
    posed: PosedBody

    @staticmethod
    def of(skeleton: Skeleton, motion: BodyMotion) -> "PlacedBodies":
        """The joints of bodies after `features.placed`, each body with its own skeleton."""
        return PlacedBodies(skeleton, motion, pose(skeleton, motion))

    @property
    def body(self) -> Float[Tensor, "B T 198"]:
        """Features of the bodies."""
        return body_features(self.posed)

    def projected(
        self, local: Float[Tensor, "B T 270"], frame: HandsFrame
    ) -> Float[Tensor, "B T 270"]:
        """Features of hands in their wrists' frames, put onto the bodies (paper, equation 8).

        Forward kinematics of body and fingers starts at the root's position in the world, which the
        paper's code leaves out.
        """
        motion = with_fingers(self.motion, self.posed, local, "wrist")
        return hand_features(pose(self.skeleton, motion), frame)


class Scale(nn.Module):
    """Normalises features to about unit size, and back."""

    middle: Tensor
    size: Tensor

    def __init__(self, features: int) -> None:
        """Start as the identity until `fit`; the first third of the features are positions."""
        super().__init__()
        self.register_buffer("middle", torch.zeros(features))
        self.register_buffer("size", torch.ones(features))

    def normalise(self, features: Float[Tensor, "*B N"]) -> Float[Tensor, "*B N"]:
        """Normalised features."""
        return (features - self.middle) / self.size

    def denormalise(self, numbers: Float[Tensor, "*B N"]) -> Float[Tensor, "*B N"]:
        """Inverse of `normalise`."""
        return numbers * self.size + self.middle

    @torch.no_grad()
    def fit(
        self, features: Float[Tensor, "B T N"], real: Bool[Tensor, "B T"], scaling: Scaling
    ) -> None:
        """Fit the scale to those frames of the data that are not padding."""
        seen = features[real]
        positions = torch.arange(len(self.middle)) < len(self.middle) // 3
        least = torch.where(positions, *torch.tensor(LEAST_SCALE))
        if scaling == "deviation":
            self.middle.copy_(seen.mean(0))
            self.size.copy_(torch.maximum(seen.std(0, unbiased=False), least))
            return
        low, high = seen.amin(0), seen.amax(0)
        self.middle.copy_(((low + high) / 2) * positions)
        size = torch.maximum((high - low) / 2, least)
        self.size.copy_(torch.where(positions, size, torch.ones_like(size)))
