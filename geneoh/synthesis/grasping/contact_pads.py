"""Spheres along the hand's bones, contact pads on its skin, and obstacles beside the object.

Right hands; pads face directions of the rest frame (fingers -x, palm -y, thumb +z); metres.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.distance import pairwise_distances
from geneoh.hand.skeleton import KEYPOINT_PARENTS, MANO_FROM_OPENPOSE

PAD_OF_THUMB = (-0.55, -0.50, -0.67)
PAD_OF_FINGER = (0.0, -1.0, 0.0)
PAD_OF_PALM = (0.0, -1.0, 0.0)
SIDE_OF_INDEX = (0.0, 0.0, 1.0)
SPHERES_PER_BONE = 4
# Radius of the hand around each bone, metres, in the order of the keypoints at the bones' ends:
# medians of an adult hand; less in the palm, where bones lie side by side.
BONE_RADIUS = torch.tensor(
    [0.016, 0.014, 0.0115, 0.009, *(0.014, 0.011, 0.01, 0.009) * 2]
    + [0.014, 0.01, 0.009, 0.0085, 0.014, 0.009, 0.008, 0.0075]
)
MEAN_SPAN = 0.18  # bone lengths from wrist to middle fingertip of that adult hand, metres
PAD_JOINTS = (*range(1, 16), 2, 3, 0, 0)
"""Joints whose rotation the pads follow, in MANO order: 15 pads under the phalanges, two on the
thumb's side of the index's outer phalanges, two at the middle of the palm and below its fingers."""
PAD_RADII = (*(0.0105, 0.009, 0.008) * 4, 0.013, 0.011, 0.0085, 0.009, 0.0085, 0.017, 0.016)
"""Distance from the bone to the skin at each pad, metres."""
PAD_DIGITS = (0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 0, 0, 5, 5)
"""Digit of each pad: index, middle, pinky, ring, thumb, palm."""


def hand_scale(offsets: Float[Tensor, "B 20 3"]) -> Float[Tensor, "B 1"]:
    """Size of each hand, 1 for a mean adult."""
    return offsets[:, [3, 4, 5, 16]].norm(dim=-1).sum(-1, keepdim=True) / MEAN_SPAN


def hand_spheres(
    joints: Float[Tensor, "*B 21 3"], scale: Float[Tensor, "*#B 1"]
) -> tuple[Float[Tensor, "*B K 3"], Float[Tensor, "*#B K"]]:
    """Centres and radii of the spheres that fill the hand, bone by bone."""
    start, end = joints[..., list(KEYPOINT_PARENTS[1:]), :], joints[..., 1:, :]
    along = torch.linspace(0.25, 1.0, SPHERES_PER_BONE, device=joints.device)
    along = along - 0.1  # the skin ends at the tip, so the last sphere stays inside of the bone
    centers = start[..., None, :] + along[:, None] * (end - start)[..., None, :]
    radii = BONE_RADIUS.to(joints.device)[:, None].expand(-1, SPHERES_PER_BONE)
    return centers.flatten(-3, -2), radii.reshape(-1) * scale


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


def pairs_of_fingers() -> tuple[Int[Tensor, " C"], Int[Tensor, " C"]]:
    """Spheres of different fingers beyond the knuckles, every other one, in pairs."""
    per_finger = 4 * SPHERES_PER_BONE
    finger = torch.arange(5).repeat_interleave(per_finger)
    free = torch.arange(5 * per_finger) % per_finger >= SPHERES_PER_BONE + 1
    a, b = torch.triu_indices(len(finger), len(finger), 1)
    pick = free[a] & free[b] & (finger[a] != finger[b]) & (a % 2 == 0) & (b % 2 == 0)
    return a[pick], b[pick]


PAIRS_OF_FINGERS = pairs_of_fingers()


def finger_clearance(
    centers: Float[Tensor, "*B K 3"], radii: Float[Tensor, "*B K"]
) -> Float[Tensor, "*B C"]:
    """Gap between spheres of different fingers beyond the knuckles, metres; an overlap is < 0."""
    a, b = PAIRS_OF_FINGERS
    gap = (centers[..., a, :] - centers[..., b, :]).norm(dim=-1)
    return gap - 0.85 * (radii[..., a] + radii[..., b])
