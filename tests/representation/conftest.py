"""A small scene that representations are taken of: a hand near a moving object of parts."""

from dataclasses import dataclass, replace

import pytest
import torch
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.region import ContactRegion, ObjectSurface, contact_region

FRAMES, POINTS, COUNT = 5, 80, 12


@dataclass(frozen=True)
class Scene(ObjectSurface):
    """World keypoints and what `contact_region` wants of the object."""

    joints: Tensor

    def region(self, count: int = COUNT, every: int = 1) -> ContactRegion:
        """Contact points of this scene's hand."""
        return contact_region(self.joints, self, count=count, every=every)

    def moved(self, motion: Rigid) -> "Scene":
        """The whole scene, hand and object, taken elsewhere."""
        return replace(
            self,
            joints=motion.apply(self.joints),
            rotation=motion.rotation @ self.rotation,
            translation=motion.apply(self.translation),
        )


def rigid(seed: int, *batch: int, turn: float = 1.0, shift: float = 0.5) -> Rigid:
    """A random rigid motion, or a batch of them."""
    generator = torch.Generator().manual_seed(seed)
    angle = turn * torch.randn(*batch, 3, generator=generator)
    return Rigid(axis_angle_to_matrix(angle), shift * torch.randn(*batch, 3, generator=generator))


def scene(seed: int = 0, parts: int = 1, frames: int = FRAMES) -> Scene:
    """Points on a 4 cm ball that turns and travels, keypoints 3 to 9 cm from its centre."""
    generator = torch.Generator().manual_seed(seed)
    normals = torch.nn.functional.normalize(torch.randn(POINTS, 3, generator=generator), dim=-1)
    away = torch.nn.functional.normalize(torch.randn(frames, 21, 3, generator=generator), dim=-1)
    away = away * (0.03 + 0.06 * torch.rand(frames, 21, 1, generator=generator))
    pose = rigid(seed + 1, frames, parts, turn=0.6, shift=0.03)
    start = rigid(seed + 2)
    return Scene(
        joints=start.apply(away),
        points=0.04 * normals,
        normals=normals,
        part=torch.arange(POINTS) % parts,
        rotation=start.rotation @ pose.rotation,
        translation=start.apply(pose.translation),
    )


@pytest.fixture(scope="session")
def make_scene():
    return scene


@pytest.fixture(scope="session")
def make_rigid():
    return rigid
