"""Actions: interactions of one or two hands, labelled with the verb that they perform."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle, where
from geneoh.geometry.mirror import mirror_axes, mirror_axis_angle, mirror_points, mirror_rotations
from geneoh.geometry.rigid import Rigid, joint_poses, part_poses
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import mean_skeletons
from geneoh.hand.skeleton import forward_kinematics
from geneoh.language.vocabulary import VERB_WORDS

TOUCHED = 0.02
"""Distance from a keypoint within which a point of the object counts as touched, metres (paper)."""
FPS = 30.0  # frames a second of all actions
DECIMETRES = 10.0  # decimetres per metre
LONGEST = 150  # most frames of an action (paper: 5 s)

VERBS = tuple(VERB_WORDS)  # what hands do to objects; `Actions.verb` is an index into them


@dataclass(frozen=True)
class Actions(Bundle):
    """B actions of at most T frames in the world frame, whose z axis points up, at 30 frames a
    second.

    The object's frame has z up, the object's lowest point at z = 0 and the mean of its surface
    points above the origin, so that the identity pose puts it upright on the table. Hands are of
    the mean shape. Frames from `length` on repeat the last one; pose and wrist of an absent hand
    are zero.
    """

    verb: Int[Tensor, " B"]
    name: Int[Tensor, " B"]  # index of the object in the families and scanned objects of the shard
    hands: Bool[Tensor, "B 2"]  # whether the left, and whether the right hand takes part
    length: Int[Tensor, " B"]
    pose: Float[Tensor, "B 2 T 16 3"]  # left, then right; each in its own side's MANO axes
    wrist: Float[Tensor, "B 2 T 3"]  # position of the wrist joint (convention W), metres
    rotation: Float[Tensor, "B T 3 3"]  # of the object's first part, object to world
    translation: Float[Tensor, "B T 3"]
    joint: Float[Tensor, "B T"]  # state of the second part's joint, radians or metres
    points: Float[Tensor, "B P 3"]  # of the surface, in the object's frame, with the joint at 0
    normals: Float[Tensor, "B P 3"]  # outward
    part: Int[Tensor, "B P"]  # of each point: 0 first, 1 on the joint
    axis: Float[Tensor, "B 3"]  # of the joint, a unit vector through `pivot`; zero for rigid ones
    pivot: Float[Tensor, "B 3"]
    slides: Bool[Tensor, " B"]  # whether the joint slides along the axis (metres) or turns about it

    @property
    def joint_units(self) -> Float[Tensor, "B 1"]:
        """Factor on states of the joint before a network reads them: slides are scaled to
        decimetres, because in metres they are much smaller than turns in radians.
        """
        return torch.where(self.slides, DECIMETRES, 1.0)[:, None]

    @property
    def valid(self) -> Bool[Tensor, "B T"]:
        """Frames before the end of each action."""
        return torch.arange(self.joint.shape[1], device=self.length.device) < self.length[:, None]

    def joint_poses(self) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
        """Rotation and translation of the second part in the frame of the first one."""
        return joint_poses(self.joint, self.axis, self.pivot, self.slides)

    def part_poses(self) -> tuple[Float[Tensor, "B T 2 3 3"], Float[Tensor, "B T 2 3"]]:
        """Rotation and translation of both parts, object to world; equal for a rigid object."""
        return part_poses(Rigid(self.rotation, self.translation), Rigid(*self.joint_poses()))

    def posed_points(self) -> Float[Tensor, "B T P 3"]:
        """Surface points in the object's frame, moved by the joint."""
        turn, shift = self.joint_poses()
        moved = self.points[:, None] @ turn.mT + shift[:, :, None]
        return torch.where((self.part > 0)[:, None, :, None], moved, self.points[:, None])

    def posed_normals(self) -> Float[Tensor, "B T P 3"]:
        """Normals of the surface points in the object's frame, turned by the joint."""
        turned = self.normals[:, None] @ self.joint_poses()[0].mT
        moved = (self.part > 0)[:, None, :, None]
        return torch.where(moved, turned, self.normals[:, None])

    def keypoints(self) -> Float[Tensor, "B 2 T 21 3"]:
        """Keypoints of left and right hand in the world frame; meaningless for an absent hand."""
        offsets = mean_skeletons().to(self.wrist)
        return forward_kinematics(axis_angle_to_matrix(self.pose), self.wrist, offsets)[0]

    def ended(self) -> "Actions":
        """The same actions with every frame after the end a copy of the last one before it."""
        frames = torch.arange(self.joint.shape[1]).to(self.length)
        return self.at_frames(frames.minimum(self.length[:, None] - 1))

    def at_frames(self, frames: Int[Tensor, "B S"]) -> "Actions":
        """The same actions at some of their frames; `length` is not changed."""
        rows = torch.arange(len(frames), device=frames.device)[:, None]
        return replace(
            self,
            pose=self.pose.transpose(1, 2)[rows, frames].transpose(1, 2),
            wrist=self.wrist.transpose(1, 2)[rows, frames].transpose(1, 2),
            rotation=self.rotation[rows, frames],
            translation=self.translation[rows, frames],
            joint=self.joint[rows, frames],
        )

    def mirrored(self, chosen: Bool[Tensor, " B"] | None = None) -> "Actions":
        """The actions, of which those `chosen` (None: all) are mirrored at x = 0, left to right."""
        flip = torch.ones_like(self.slides) if chosen is None else chosen
        image = replace(
            self,
            hands=self.hands.flip(1),
            pose=mirror_axis_angle(self.pose.flip(1)),
            wrist=mirror_points(self.wrist.flip(1)),
            rotation=mirror_rotations(self.rotation),
            translation=mirror_points(self.translation),
            points=mirror_points(self.points),
            normals=mirror_points(self.normals),
            axis=mirror_axes(self.axis, self.slides),
            pivot=mirror_points(self.pivot),
        )
        return where(flip, image, self)
