"""A hand's trajectory as pose parameters in the canonical frame, and changes between two of them.

Forward kinematics with the person's own bones turns them into the trajectory of keypoints (paper
3.1). The noise of hand trackers is simple in these parameters: independent per parameter and
centred on the truth, while independent noise on keypoints changes bone lengths.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.skeleton import forward_kinematics
from geneoh.representation.region import ContactRegion

UNIT = (0.01,) * 3 + (0.08,) * 3 + (0.25,) * 45  # of wrist (m), rotation (rad), fingers (rad)


@dataclass(frozen=True)
class HandParameters(Bundle):
    """Right hands over T frames in a canonical frame, metres and radians."""

    wrist: Float[Tensor, "*B T 3"]
    turn: Float[Tensor, "*B T 3 3"]  # global rotation, hand to canonical
    fingers: Float[Tensor, "*B T 15 3"]  # axis-angle of the finger joints in MANO order
    offsets: Float[Tensor, "*B 20 3"]  # the person's skeleton (see `geneoh.hand.skeleton`)

    @classmethod
    def of_pose(
        cls,
        wrist: Float[Tensor, "*B T 3"],
        pose: Float[Tensor, "*B T 16 3"],
        offsets: Float[Tensor, "*B 20 3"],
    ) -> "HandParameters":
        """Parameters from full poses: axis-angle, global rotation first."""
        return cls(wrist, axis_angle_to_matrix(pose[..., 0, :]), pose[..., 1:, :], offsets)

    @property
    def pose(self) -> Float[Tensor, "*B T 16 3"]:
        """Axis-angle of the global rotation and the finger joints."""
        return torch.cat([matrix_to_axis_angle(self.turn)[..., None, :], self.fingers], dim=-2)

    @cached_property
    def posed(self) -> tuple[Float[Tensor, "*B T 21 3"], Float[Tensor, "*B T 16 3 3"]]:
        """Keypoints and the joints' global rotations by forward kinematics."""
        rotations = torch.cat(
            [self.turn[..., None, :, :], axis_angle_to_matrix(self.fingers)], dim=-3
        )
        return forward_kinematics(rotations, self.wrist, self.offsets[..., None, :, :])

    @property
    def joints(self) -> Float[Tensor, "*B T 21 3"]:
        """Keypoints by forward kinematics."""
        return self.posed[0]

    def to_canon(self, region: ContactRegion) -> "HandParameters":
        """Hands in the world frame, brought into the canonical frame of a region."""
        wrist = region.to_canon(self.wrist[..., None, :])[..., 0, :]
        return replace(self, wrist=wrist, turn=region.rotation.mT @ self.turn)

    def to_world(self, region: ContactRegion) -> "HandParameters":
        """Inverse of `to_canon`."""
        wrist = region.to_world(self.wrist[..., None, :])[..., 0, :]
        return replace(self, wrist=wrist, turn=region.rotation @ self.turn)

    def moved(self, change: Float[Tensor, "*B T 51"]) -> "HandParameters":
        """The hands after a change in units of `UNIT`: the wrist's translation in canonical axes,
        its rotation in the hand's own frame, then the fingers' axis-angle."""
        change = change * change.new_tensor(UNIT)
        return HandParameters(
            self.wrist + change[..., :3],
            self.turn @ axis_angle_to_matrix(change[..., 3:6]),
            self.fingers + change[..., 6:].unflatten(-1, (15, 3)),
            self.offsets,
        )

    def change_to(self, other: "HandParameters") -> Float[Tensor, "*B T 51"]:
        """The change that `moved` turns into `other`, in units of `UNIT`."""
        turn = matrix_to_axis_angle(self.turn.transpose(-1, -2) @ other.turn)
        fingers = (other.fingers - self.fingers).flatten(-2)
        change = torch.cat([other.wrist - self.wrist, turn, fingers], dim=-1)
        return change / change.new_tensor(UNIT)


def turned(
    change: Float[Tensor, "*B 51"], axes: Float[Tensor, "*#B 3 3"]
) -> Float[Tensor, "*B 51"]:
    """The same change with the wrist's translation in other axes (columns); the rest is kept."""
    wrist = (change[..., None, :3] @ axes)[..., 0, :]
    return torch.cat([wrist, change[..., 3:]], dim=-1)
