"""Rigid motions: the pose of one frame in another."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix


def joint_poses(
    state: Float[Tensor, "B T"],
    axis: Float[Tensor, "B 3"],
    pivot: Float[Tensor, "B 3"],
    slides: Bool[Tensor, " B"],
) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
    """Rotation and translation of a part on a joint: `state` is the angle in radians about the
    axis through the pivot, or where the joint slides the distance in metres along the axis."""
    along = state[..., None] * axis[:, None]
    slide, pivot = slides[:, None, None], pivot[:, None]
    turn = axis_angle_to_matrix(torch.where(slide, 0.0, along))
    return turn, torch.where(slide, along, pivot - (turn @ pivot[..., None])[..., 0])


@dataclass(frozen=True)
class Rigid:
    """p_to = rotation @ p_from + translation; variables are named `pose_to_from`."""

    rotation: Float[Tensor, "*B 3 3"]
    translation: Float[Tensor, "*B 3"]

    def apply(self, points: Float[Tensor, "*#B P 3"]) -> Float[Tensor, "*#B P 3"]:
        """The P points of each batch entry in the other frame; batch axes broadcast."""
        return points @ self.rotation.transpose(-1, -2) + self.translation[..., None, :]

    def at(self, chosen: Bool[Tensor, " T"] | Int[Tensor, " N"] | slice) -> "Rigid":
        """The motion at some of the entries of the first batch axis."""
        return Rigid(self.rotation[chosen], self.translation[chosen])

    def inverse(self) -> "Rigid":
        """The inverse motion: pose_from_to."""
        back = self.rotation.transpose(-1, -2)
        return Rigid(back, -(back @ self.translation[..., None])[..., 0])

    def matrices(self) -> Float[Tensor, "*B 4 4"]:
        """The poses as matrices with the last row 0 0 0 1."""
        upper = torch.cat([self.rotation, self.translation[..., None]], -1)
        bottom = upper.new_tensor([0.0, 0.0, 0.0, 1.0]).expand(*upper.shape[:-2], 1, 4)
        return torch.cat([upper, bottom], -2)

    def compose(self, first: "Rigid") -> "Rigid":
        """`first`, then this: pose_a_b.compose(pose_b_c) is pose_a_c; batch axes broadcast."""
        moved = (self.rotation @ first.translation[..., None])[..., 0]
        return Rigid(self.rotation @ first.rotation, moved + self.translation)


def part_poses(
    first: Rigid, joint: Rigid
) -> tuple[Float[Tensor, "B T 2 3 3"], Float[Tensor, "B T 2 3"]]:
    """Rotations and translations of both parts of objects, from the pose of the first part (B, T)
    and the pose of the second part in the frame of the first."""
    second = first.compose(joint)
    return (
        torch.stack([first.rotation, second.rotation], 2),
        torch.stack([first.translation, second.translation], 2),
    )
