"""Spheres along the hand's bones that fill it, and the gaps between those of different fingers."""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.hand.skeleton import KEYPOINT_PARENTS

SPHERES_PER_BONE = 4
# Radius of the hand around each bone, metres, in the order of the keypoints at the bones' ends:
# medians of an adult hand; less in the palm, where bones lie side by side.
BONE_RADIUS = torch.tensor(
    [0.016, 0.014, 0.0115, 0.009, *(0.014, 0.011, 0.01, 0.009) * 2]
    + [0.014, 0.01, 0.009, 0.0085, 0.014, 0.009, 0.008, 0.0075]
)
MEAN_SPAN = 0.18  # bone lengths from wrist to middle fingertip of that adult hand, metres
WRIST_RADIUS = 0.022  # of two spheres that fill the wrist of that hand, metres
WRIST_SPHERES = torch.tensor([[0.008, 0.0, 0.008], [0.008, 0.0, -0.008]])
# their centres relative to the wrist joint, in the frame of a right hand at rest (fingers -x)
FIRM = 0.85  # share of the radii at which fingers that press against each other are apart


def hand_scale(offsets: Float[Tensor, "*B 20 3"]) -> Float[Tensor, "*B 1"]:
    """Size of each hand, 1 for a mean adult."""
    return offsets[..., [3, 4, 5, 16], :].norm(dim=-1).sum(-1, keepdim=True) / MEAN_SPAN


def hand_spheres(
    joints: Float[Tensor, "*B 21 3"], scale: Float[Tensor, "*#B 1"]
) -> tuple[Float[Tensor, "*B K 3"], Float[Tensor, "*#B K"]]:
    """Centres and radii of the spheres that fill the hand, bone by bone."""
    radii = BONE_RADIUS.to(joints.device)[:, None].expand(-1, SPHERES_PER_BONE)
    return sphere_centers(joints), radii.reshape(-1) * scale


def hand_and_wrist_spheres(
    joints: Float[Tensor, "*B 21 3"],
    turns: Float[Tensor, "*B 16 3 3"],
    scale: Float[Tensor, "*B 1"],
) -> tuple[Float[Tensor, "*B K 3"], Float[Tensor, "*B K"]]:
    """Those of `hand_spheres`, then two that fill the wrist; `turns` are the global rotations of
    the joints of a right hand."""
    centers, radii = hand_spheres(joints, scale)
    apart = scale[..., None] * WRIST_SPHERES.to(joints) @ turns[..., 0, :, :].mT
    radii = torch.cat([radii, WRIST_RADIUS * scale.expand(*scale.shape[:-1], 2)], -1)
    return torch.cat([centers, joints[..., :1, :] + apart], -2), radii


def sphere_centers(points: Float[Tensor, "*B 21 D"]) -> Float[Tensor, "*B K D"]:
    """Centres of the spheres, or any other quantity of the keypoints at these places."""
    start, end = points[..., list(KEYPOINT_PARENTS[1:]), :], points[..., 1:, :]
    along = torch.linspace(0.25, 1.0, SPHERES_PER_BONE, device=points.device)
    along = along - 0.1  # the skin ends at the tip, so the last sphere stays inside of the bone
    centers = start[..., None, :] + along[:, None] * (end - start)[..., None, :]
    return centers.flatten(-3, -2)


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
    centers: Float[Tensor, "*B K 3"], radii: Float[Tensor, "*#B K"]
) -> Float[Tensor, "*B C"]:
    """Gap between spheres of different fingers beyond the knuckles, metres; an overlap is < 0."""
    a, b = PAIRS_OF_FINGERS
    gap = (centers[..., a, :] - centers[..., b, :]).norm(dim=-1)
    return gap - FIRM * (radii[..., a] + radii[..., b])
