"""Contact pads on the hand's skin, and obstacles beside the object.

Right hands; pads face directions of the rest frame (fingers -x, palm -y, thumb +z); metres.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.distance import pairwise_distances
from geneoh.hand.skeleton import MANO_FROM_OPENPOSE

PAD_OF_THUMB = (-0.55, -0.50, -0.67)
PAD_OF_FINGER = (0.0, -1.0, 0.0)
PAD_OF_PALM = (0.0, -1.0, 0.0)
SIDE_OF_INDEX = (0.0, 0.0, 1.0)
PAD_JOINTS = (*range(1, 16), 2, 3, 0, 0)
"""Joints whose rotation the pads follow, in MANO order: 15 pads under the phalanges, two on the
thumb's side of the index's outer phalanges, two at the middle of the palm and below its fingers."""
PAD_RADII = (*(0.0105, 0.009, 0.008) * 4, 0.013, 0.011, 0.0085, 0.009, 0.0085, 0.017, 0.016)
"""Distance from the bone to the skin at each pad, metres."""
PAD_DIGITS = (0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 0, 0, 5, 5)
"""Digit of each pad: index, middle, pinky, ring, thumb, palm."""


@dataclass(frozen=True)
class OtherHands(Bundle):
    """The spheres that fill B hands, as obstacles for a hand at the same object."""

    centers: Float[Tensor, "B N 3"]
    radii: Float[Tensor, "B N"]

    def overlap(
        self, centers: Float[Tensor, "B K 3"], radii: Float[Tensor, "*B K"]
    ) -> Float[Tensor, "B K N"]:
        """Penetration depth of each passed sphere in each of these, metres; negative outside."""
        return radii[..., None] + self.radii[:, None] - pairwise_distances(centers, self.centers)

    def depth(
        self, centers: Float[Tensor, "B K 3"], radii: Float[Tensor, "*B K"]
    ) -> Float[Tensor, "B K"]:
        """Largest penetration depth of each passed sphere in these, metres; negative outside."""
        return self.overlap(centers, radii).amax(-1)


@dataclass(frozen=True)
class Table(Bundle):
    """The table plane in B objects' frames: a point p is `p @ up + height` above it, metres."""

    up: Float[Tensor, "B 3"]  # unit vectors
    height: Float[Tensor, " B"]  # of the frames' origins

    def depth(
        self, centers: Float[Tensor, "B K 3"], radii: Float[Tensor, "*B K"]
    ) -> Float[Tensor, "B K"]:
        """Penetration depth of spheres in the table, metres; negative above it."""
        return radii - torch.linalg.vecdot(centers, self.up[:, None]) - self.height[:, None]


@dataclass(frozen=True)
class Obstacles(Bundle):
    """What B hands stay out of beside the object they hold: a table, and perhaps other hands."""

    table: Table
    other: OtherHands | None = None


def contact_pads(
    joints: Float[Tensor, "*B 21 3"],
    turns: Float[Tensor, "*B 16 3 3"],
    scale: Float[Tensor, "*B 1"],
) -> tuple[Float[Tensor, "*B 19 3"], Float[Tensor, "*B 19 3"]]:
    """Points of the pads on the skin, and the outward directions that they face."""
    mano = joints[..., list(MANO_FROM_OPENPOSE), :]
    ends = [j + 1 if j % 3 else 16 + j // 3 - 1 for j in PAD_JOINTS[:17]] + [4, 4]
    start, end = mano[..., list(PAD_JOINTS), :], mano[..., ends, :]
    facing = joints.new_tensor(
        [PAD_OF_FINGER] * 12 + [PAD_OF_THUMB] * 3 + [SIDE_OF_INDEX] * 2 + [PAD_OF_PALM] * 2
    )
    facing = (turns[..., list(PAD_JOINTS), :, :] @ facing[..., None])[..., 0]
    radius = joints.new_tensor(PAD_RADII)
    along = joints.new_tensor([0.5, 0.5, 0.6] * 5 + [0.5, 0.5, 0.55, 0.85])
    middle = start + along[:, None] * (end - start)
    return middle + facing * (radius * scale)[..., None], facing
