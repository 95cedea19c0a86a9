"""Rigid motions: the pose of one frame in another."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True)
class Rigid:
    """p_to = rotation @ p_from + translation; variables are named `pose_to_from`."""

    rotation: Float[Tensor, "*B 3 3"]
    translation: Float[Tensor, "*B 3"]

    def apply(self, points: Float[Tensor, "*#B P 3"]) -> Float[Tensor, "*#B P 3"]:
        """The P points of each batch entry in the other frame; batch axes broadcast."""
        return points @ self.rotation.transpose(-1, -2) + self.translation[..., None, :]

    def inverse(self) -> "Rigid":
        """The inverse motion: pose_from_to."""
        back = self.rotation.transpose(-1, -2)
        return Rigid(back, -(back @ self.translation[..., None])[..., 0])

    def compose(self, first: "Rigid") -> "Rigid":
        """`first`, then this: pose_a_b.compose(pose_b_c) is pose_a_c; batch axes broadcast."""
        moved = (self.rotation @ first.translation[..., None])[..., 0]
        return Rigid(self.rotation @ first.rotation, moved + self.translation)
