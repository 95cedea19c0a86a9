"""Actions as the features that the networks of Text2HOI read and write, and back.

Source: Text2HOI, section 3.2. Rotations are 6D: two columns of the matrix, flattened row by row.
"""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    matrix_to_axis_angle,
    rotation_6d_to_matrix,
)
from geneoh.hand.library import mean_skeletons
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.actions.action import Actions

HAND, OBJECT = 99, 10  # number of features of a hand and of the object in a frame
NUMBERS = 2 * HAND + OBJECT  # number of features of a frame: left hand, right hand, object

HandFrame = Literal["object", "world"]
"""Coordinate frame of the hands: that of the object's first part at the same time (ours), in which
a hand that holds it stands still, or the world (paper)."""


@dataclass(frozen=True)
class Tokens(Bundle):
    """B clips of at most T frames; what is not `shown` is zero."""

    hands: Float[Tensor, "B 2 T 99"]
    """Left and right: position of the wrist (m), then 16 rotations, the global one first."""
    object: Float[Tensor, "B T 10"]
    """Of the first part in the world: translation (m), rotation, state of the joint
    (rad, or dm where it slides: ours)."""
    valid: Bool[Tensor, "B T"]  # frames before the end
    present: Bool[Tensor, "B 2"]  # hands that take part
    jointed: Bool[Tensor, " B"]  # objects with a joint
    frame: HandFrame = "object"

    @property
    def shown(self) -> Bool[Tensor, "B 3 T"]:
        """Mask of the frames in which left hand, right hand and object have features."""
        agents = torch.cat([self.present, self.present.new_ones(len(self.present), 1)], dim=1)
        return agents[:, :, None] & self.valid[:, None]

    @property
    def flat(self) -> Float[Tensor, "B T 208"]:
        """All features of each frame: left hand, right hand, object."""
        return torch.cat([*self.hands.unbind(1), self.object], dim=-1)

    @property
    def defined(self) -> Bool[Tensor, "B T 208"]:
        """Mask of the features in `flat` that are defined."""
        return defined_numbers(self.present, self.valid, self.jointed)

    @staticmethod
    def of_flat(
        flat: Float[Tensor, "B T 208"],
        valid: Bool[Tensor, "B T"],
        present: Bool[Tensor, "B 2"],
        jointed: Bool[Tensor, " B"],
        frame: HandFrame,
    ) -> "Tokens":
        """Clips from all features of each frame; the inverse of `flat`."""
        left, right, thing = flat.split([HAND, HAND, OBJECT], dim=-1)
        hands = torch.stack([left, right], dim=1)
        return Tokens(hands, thing, valid, present, jointed, frame).masked()

    def with_flat(self, flat: Float[Tensor, "B T 208"]) -> "Tokens":
        """The same with other features."""
        return Tokens.of_flat(flat, self.valid, self.present, self.jointed, self.frame)

    def with_hands(self, hands: Float[Tensor, "B 2 T 99"]) -> "Tokens":
        """The same with other hands."""
        return replace(self, hands=hands).masked()

    def masked(self) -> "Tokens":
        """The same with zeros where nothing is shown."""
        hands = self.hands * self.shown[:, :2, :, None]
        return replace(self, hands=hands, object=self.object * self.valid[..., None])

    @property
    def rotations(self) -> Float[Tensor, "B 2 T 16 3 3"]:
        """Rotations of the hands' joints; they are meaningless for hands that are not shown."""
        return from_columns(self.hands[..., 3:].unflatten(-1, (16, 6)))

    @property
    def object_rotation(self) -> Float[Tensor, "B T 3 3"]:
        """Rotation of the object's first part, object to world."""
        return from_columns(self.object[..., 3:9])

    def joints(self) -> Float[Tensor, "B 2 T 21 3"]:
        """Keypoints of hands of the mean shape, in the hands' coordinate frame, metres."""
        offsets = mean_skeletons().to(self.hands)
        return forward_kinematics(self.rotations, self.hands[..., :3], offsets)[0]

    def joints_on_object(self) -> Float[Tensor, "B 2 T 21 3"]:
        """Keypoints in the frame of the object's first part."""
        if self.frame == "object":
            return self.joints()
        turn, shift = self.object_rotation[:, None], self.object[:, None, :, None, :3]
        return (self.joints() - shift) @ turn

    def turns_on_object(self) -> Float[Tensor, "B 2 T 3 3"]:
        """Global rotations of the hands in the frame of the object's first part."""
        turns = self.rotations[..., 0, :, :]
        return turns if self.frame == "object" else self.object_rotation[:, None].mT @ turns


def defined_numbers(
    present: Bool[Tensor, "B 2"], valid: Bool[Tensor, "B T"], jointed: Bool[Tensor, " B"]
) -> Bool[Tensor, "B T 208"]:
    """Mask of defined features: of valid frames, hands that take part, and joints that exist."""
    parts = [*present.unbind(1), torch.ones_like(jointed), jointed]
    sizes = torch.tensor([HAND, HAND, OBJECT - 1, 1], device=valid.device)
    of_frame = torch.stack(parts, dim=1).repeat_interleave(sizes, dim=1)
    return valid[..., None] & of_frame[:, None]


def columns(rotation: Float[Tensor, "*B 3 3"]) -> Float[Tensor, "*B 6"]:
    """The first two columns of a rotation, flattened row by row."""
    return rotation[..., :2].flatten(-2)


def from_columns(numbers: Float[Tensor, "*B 6"]) -> Float[Tensor, "*B 3 3"]:
    """The rotation of two columns, made orthonormal; inverse of `columns`."""
    return rotation_6d_to_matrix(numbers.unflatten(-1, (3, 2)).mT.flatten(-2))


def tokens_of(actions: Actions, frame: HandFrame = "object") -> Tokens:
    """The features of actions, with hands in the coordinate frame `frame`."""
    rotations = axis_angle_to_matrix(actions.pose)
    wrist, turn = actions.wrist, rotations[..., 0, :, :]
    if frame == "object":
        axes = actions.rotation[:, None].mT
        wrist = (axes @ (wrist - actions.translation[:, None])[..., None])[..., 0]
        turn = axes @ turn
    rotations = torch.cat([turn[..., None, :, :], rotations[..., 1:, :, :]], dim=-3)
    hands = torch.cat([wrist, columns(rotations).flatten(-2)], dim=-1)
    jointed = (actions.part > 0).any(1)
    joint = actions.joint * actions.joint_units * jointed[:, None]
    object = torch.cat([actions.translation, columns(actions.rotation), joint[..., None]], dim=-1)
    return Tokens(hands, object, actions.valid, actions.hands, jointed, frame).masked()


def actions_of(tokens: Tokens, like: Actions) -> Actions:
    """Actions decoded from features; objects, verbs and names are those of `like`."""
    object_rotation, shift = tokens.object_rotation, tokens.object[..., :3]
    rotations, wrist = tokens.rotations, tokens.hands[..., :3]
    turn = rotations[..., 0, :, :]
    if tokens.frame == "object":
        axes = object_rotation[:, None]
        wrist = (axes @ wrist[..., None])[..., 0] + shift[:, None]
        turn = axes @ turn
    rotations = torch.cat([turn[..., None, :, :], rotations[..., 1:, :, :]], dim=-3)
    there = tokens.present[:, :, None, None]
    joint = tokens.object[..., 9] / like.joint_units
    return replace(
        like,
        hands=tokens.present,
        length=tokens.valid.sum(1),
        pose=torch.where(there[..., None], matrix_to_axis_angle(rotations), 0.0),
        wrist=torch.where(there, wrist, 0.0),
        rotation=object_rotation,
        translation=shift,
        joint=torch.where(tokens.jointed[:, None], joint, 0.0),
    ).ended()
