"""Frame-to-frame steps of keypoints over the object: the temporal relations that our own stages
use. They are relative to the one surface point nearest to a keypoint, because a finger slides on
what it touches. The paper's T, of all contact points, is in `geneoh.representation.temporal`."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.region import ObjectSurface


@dataclass(frozen=True)
class SurfaceMotion(Bundle):
    """Hands over T frames and the surface near them, in the frame of the object's first part."""

    joints: Float[Tensor, "B T 21 3"]  # metres
    nearest: Float[Tensor, "B T 21 3"]  # the surface point nearest to each keypoint
    normals: Float[Tensor, "B T 21 3"]  # outward, there
    carried: Float[Tensor, "B T 21 3"]
    """Step to the next frame of a point that is at the keypoint and moves rigidly with the nearest
    object part; zero for the first part. The last frame's step is unused."""
    rotation: Float[Tensor, "B T 3 3"]  # first part's frame to world
    translation: Float[Tensor, "B T 3"]

    @classmethod
    def of(cls, joints: Float[Tensor, "B T 21 3"], surface: ObjectSurface) -> "SurfaceMotion":
        """From hands in the world frame and an object's surface."""
        near = nearest_on_parts(joints, surface)
        rotation, translation = surface.rotation[:, :, 0], surface.translation[:, :, 0]
        own = (joints - translation[:, :, None]) @ rotation
        carried = torch.zeros_like(joints)
        for part in range(1, surface.rotation.shape[2]):
            turn, shift = surface.rotation[:, :, part], surface.translation[:, :, part, None]
            local = (joints - shift) @ turn
            after = local[:, :-1] @ turn[:, 1:].mT + shift[:, 1:]
            after = (after - translation[:, 1:, None]) @ rotation[:, 1:]
            step = torch.nn.functional.pad(after - own[:, :-1], (0, 0, 0, 0, 0, 1))
            carried = torch.where((near.part == part)[..., None], step, carried)
        return cls(
            own,
            (near.points - translation[:, :, None]) @ rotation,
            near.normals @ rotation,
            carried,
            rotation,
            translation,
        )

    @property
    def steps(self) -> Float[Tensor, "B T 21 3"]:
        """Step of each keypoint to the next frame, relative to the surface; 0 in the last frame."""
        over = self.joints.diff(dim=1) - self.carried[:, :-1]
        return torch.nn.functional.pad(over, (0, 0, 0, 0, 0, 1))

    def from_world(self, joints: Float[Tensor, "B T 21 3"]) -> Float[Tensor, "B T 21 3"]:
        """Other keypoints, from the world frame into the frame of the first part."""
        return (joints - self.translation[:, :, None]) @ self.rotation
