"""Grasps by batched gradient descent of a sphere-covered skeleton against analytic objects.

The hand starts with its palm towards a random point of the surface and slides down an energy of
penetration, finger-pad contact, finger clearance and distance to a natural pose. What passes the
checks of `Checks` is kept. Frames: the right hand's rest frame (fingers -x, palm -y, thumb +z) and
the object's frame; metres and radians.
"""

from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.skeleton import KEYPOINT_PARENTS, MANO_FROM_OPENPOSE, forward_kinematics
from geneoh.synthesis.objects import Solids

# Natural range of each joint, axis-angle in the right hand's frame: a finger flexes about the line
# across it, near +z; the thumb opposes by turning about +x at its base and flexes about
# THUMB_FLEXION.
THUMB_FLEXION = (0.31, -0.86, 0.39)
PAD_OF_THUMB = (-0.55, -0.50, -0.67)
PAD_OF_FINGER = (0.0, -1.0, 0.0)
FLEXION = (0.65, 0.7, 0.55)
"""Flexion of knuckle, middle and distal joint of a half closed finger (curl 1), radians."""
ACROSS = ((0.2, 0.0, 1.0), (-0.05, 0.0, 1.0), (-0.5, 0.0, 0.9), (-0.2, 0.0, 1.0))
"""Axes that index, middle, pinky and ring close about at the knuckle: they converge."""
_BASE_STD, _MIDDLE_STD, _DISTAL_STD = (0.3, 0.2, 0.5), (0.18, 0.05, 0.5), (0.06, 0.05, 0.4)
_THUMB = (
    ((1.05, 0.1, 0.2), (0.4, 0.3, 0.25)),
    ((0.06, -0.17, 0.08), (0.35, 0.2, 0.25)),
    ((0.1, -0.25, 0.1), (0.15, 0.3, 0.35)),
)


def curled(curl: Float[Tensor, "B 5"]) -> Float[Tensor, "B 15 3"]:
    """Hands whose fingers are closed by so much: 0 is flat, 1 half closed, 2 a fist.

    Fingers in MANO order; the thumb stays opposed and bends at its two outer joints.
    """
    axes, flexion = curl.new_tensor(ACROSS), curl.new_tensor(FLEXION)
    base = curl[:, :4, None] * flexion[0] * axes + curl.new_tensor([0.0, 0.05, 0.0])
    outer = curl[:, :4, None, None] * flexion[1:, None] * curl.new_tensor([0.0, 0.0, 1.0])
    fingers = torch.cat([base[:, :, None], outer], dim=2)
    thumb = curl.new_tensor([mean for mean, _ in _THUMB])
    share = torch.stack([torch.ones_like(curl[:, 4]), curl[:, 4], curl[:, 4]], dim=-1)
    return torch.cat([fingers, (share[..., None] * thumb)[:, None]], dim=1).flatten(1, 2)


NATURAL_MEAN = curled(torch.ones(1, 5))[0]
NATURAL_STD = torch.tensor(
    [_BASE_STD, _MIDDLE_STD, _DISTAL_STD] * 4 + [list(std) for _, std in _THUMB]
)
CURLS = (0.2, 2.5)
"""How far hands like to close on what they hold, from person to person and grasp to grasp."""

SPHERES_PER_BONE = 4
# Radius of the hand around its bones, metres, by the keypoint a bone ends in (measured medians of
# an adult hand, palm thinner than the measured distance because its bones fan out side by side).
BONE_RADIUS = torch.tensor(
    [0.016, 0.014, 0.0115, 0.009]
    + [0.014, 0.011, 0.01, 0.009]
    + [0.014, 0.011, 0.01, 0.009]
    + [0.014, 0.01, 0.009, 0.0085]
    + [0.014, 0.009, 0.008, 0.0075]
)
MEAN_SPAN = 0.18
"""Length of the chain wrist to middle fingertip that BONE_RADIUS belongs to, metres."""
PAD_JOINTS = tuple(range(1, 16))
"""Joints whose following bone carries a pad: every phalanx (15), in MANO order."""


@dataclass(frozen=True)
class Checks:
    """What a kept grasp must pass, metres."""

    depth: float = 0.003
    contact: float = 0.004
    fingers: int = 2
    """Other fingers that touch besides the thumb (or besides the first one, without the thumb)."""
    clearance: float = -0.004


@dataclass(frozen=True)
class Grasps:
    """Hands of B right-hand skeletons on B objects, in the objects' frames."""

    pose: Float[Tensor, "B 16 3"]
    wrist: Float[Tensor, "B 3"]
    offsets: Float[Tensor, "B 20 3"]
    kept: Bool[Tensor, " B"]

    def chosen(self, which: Bool[Tensor, " B"] | Int[Tensor, " C"]) -> "Grasps":
        """Some of the grasps."""
        return Grasps(*(getattr(self, field.name)[which] for field in fields(self)))


def _hand_spheres(
    joints: Float[Tensor, "*B 21 3"], scale: Float[Tensor, "*B 1"]
) -> tuple[Float[Tensor, "*B K 3"], Float[Tensor, "*B K"]]:
    """Centres and radii of the spheres that fill the hand, bone by bone."""
    start, end = joints[..., list(KEYPOINT_PARENTS[1:]), :], joints[..., 1:, :]
    along = torch.linspace(0.25, 1.0, SPHERES_PER_BONE, device=joints.device)
    along = along - 0.1  # the skin ends at the tip: the last sphere stays inside the bone
    centers = start[..., None, :] + along[:, None] * (end - start)[..., None, :]
    radii = BONE_RADIUS.to(joints.device)[:, None].expand(-1, SPHERES_PER_BONE)
    return centers.flatten(-3, -2), radii.reshape(-1) * scale


def _pads(
    joints: Float[Tensor, "*B 21 3"],
    glob: Float[Tensor, "*B 16 3 3"],
    scale: Float[Tensor, "*B 1"],
) -> tuple[Float[Tensor, "*B 15 3"], Float[Tensor, "*B 15 3"]]:
    """Skin points under each phalanx and the directions they face."""
    mano = joints[..., list(MANO_FROM_OPENPOSE), :]
    ends = [j + 1 if j % 3 else 16 + j // 3 - 1 for j in PAD_JOINTS]
    start, end = mano[..., list(PAD_JOINTS), :], mano[..., ends, :]
    facing = joints.new_tensor([PAD_OF_FINGER] * 12 + [PAD_OF_THUMB] * 3)
    facing = (glob[..., 1:, :, :] @ facing[..., None])[..., 0]
    radius = joints.new_tensor([0.0105, 0.009, 0.008] * 4 + [0.013, 0.011, 0.0085]) * scale
    middle = start + joints.new_tensor([0.5, 0.5, 0.6] * 5)[:, None] * (end - start)
    return middle + facing * radius[..., None], facing


def _clearance(
    centers: Float[Tensor, "*B K 3"], radii: Float[Tensor, "*B K"]
) -> Float[Tensor, "*B C"]:
    """Gap between spheres of different fingers beyond their knuckles, metres; overlap is < 0."""
    per_finger = 4 * SPHERES_PER_BONE
    finger = torch.arange(5).repeat_interleave(per_finger)
    free = torch.arange(5 * per_finger) % per_finger >= SPHERES_PER_BONE + 1
    a, b = torch.triu_indices(len(finger), len(finger), 1)
    pick = free[a] & free[b] & (finger[a] != finger[b]) & (a % 2 == 0) & (b % 2 == 0)
    a, b = a[pick], b[pick]
    gap = (centers[..., a, :] - centers[..., b, :]).norm(dim=-1)
    return gap - 0.85 * (radii[..., a] + radii[..., b])


def _approach(
    solids: Solids, offsets: Float[Tensor, "B 20 3"], *, generator: torch.Generator
) -> tuple[Float[Tensor, "B 3 3"], Float[Tensor, "B 3"]]:
    """Wrist poses with the palm over a random surface point, turned at random about its normal."""
    surface, normals = solids.surface_points(1, generator=generator)
    point, normal = surface[:, 0], normals[:, 0]
    # palm normal -y of the hand looks against the surface normal, fingers point in a random tangent
    random = torch.randn(point.shape, generator=generator)
    fingers = torch.nn.functional.normalize(torch.linalg.cross(normal, random), dim=-1)
    third = torch.linalg.cross(-fingers, normal)
    rotation = torch.stack([-fingers, normal, third], dim=-1)
    tilt = 0.25 * torch.randn(point.shape, generator=generator)
    rotation = rotation @ axis_angle_to_matrix(tilt)
    reach = torch.rand(len(point), 1, generator=generator) * 0.5 + 0.75
    palm = reach * offsets[:, 3] + offsets.new_tensor([0.0, -0.045, 0.0])
    return rotation, point - (rotation @ palm[..., None])[..., 0]


def synthesize_grasps(
    solids: Solids,
    offsets: Float[Tensor, "B 20 3"],
    *,
    generator: torch.Generator,
    steps: int = 140,
    checks: Checks | None = None,
) -> Grasps:
    """One grasp attempt per object; `kept` tells which ones pass the checks.

    Args:
        solids: the objects.
        offsets: the hands' rest offsets (see `geneoh.hand.skeleton`).
        generator: source of every random choice.
        steps: descent steps of Adam with a cosine rate.
        checks: limits on depth, contact and clearance.
    """
    checks = checks or Checks()
    batch = len(offsets)
    scale = offsets[:, [3, 4, 5, 16]].norm(dim=-1).sum(-1, keepdim=True) / MEAN_SPAN
    rotation, wrist = _approach(solids, offsets, generator=generator)
    orient = matrix_to_axis_angle(rotation)
    mean, std = NATURAL_MEAN, NATURAL_STD
    curl = CURLS[0] + (CURLS[1] - CURLS[0]) * torch.rand(batch, 1, generator=generator)
    curl = curl * (0.3 * torch.randn(batch, 5, generator=generator)).exp()
    habit = 0.6 * std * torch.randn(batch, 15, 3, generator=generator)
    liked = curled(curl) + habit
    opened = torch.rand(batch, 1, generator=generator) * 0.8
    fingers = curled(curl * opened) + 0.5 * habit
    # which pads should touch: thumb and two to four fingers at their tips, sometimes whole fingers
    touch = torch.rand(batch, 5, generator=generator) < torch.tensor([0.95, 0.9, 0.5, 0.7, 0.95])
    power = torch.rand(batch, 1, 1, generator=generator) < 0.4
    wanted = touch[:, :, None] * torch.where(
        power, torch.tensor([0.5, 0.8, 1.0]), torch.tensor([0.0, 0.1, 1.0])
    )
    wanted = wanted.reshape(batch, 15)

    parameters = [wrist.requires_grad_(True), orient.requires_grad_(True)]
    parameters.append(fingers.requires_grad_(True))
    optimizer = torch.optim.Adam(
        [
            {"params": parameters[0], "lr": 0.004},
            {"params": parameters[1], "lr": 0.03},
            {"params": parameters[2], "lr": 0.03},
        ]
    )
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps, eta_min=1e-4)
    for _ in range(steps):
        pose = torch.cat([parameters[1][:, None], parameters[2]], dim=1)
        joints, glob = forward_kinematics(axis_angle_to_matrix(pose), parameters[0], offsets)
        centers, radii = _hand_spheres(joints, scale)
        pads, facing = _pads(joints, glob, scale)
        distance = solids.signed_distance(torch.cat([centers, pads], 1))
        depth = (radii - distance[:, : centers.shape[1]]).clamp(min=0)
        gap = distance[:, centers.shape[1] :]
        _, normal = solids.distance_and_normal(pads.detach())
        alignment = (1 + (facing * normal).sum(-1)) * wanted
        crowded = (-_clearance(centers, radii)).clamp(min=0)
        apart = (parameters[2] - liked) / std
        beyond = ((parameters[2] - mean) / std).abs()
        energy = (
            4e4 * depth.square().sum(-1)
            + 60.0 * (wanted * (gap.abs() + 30 * gap.square())).sum(-1)
            + 0.25 * alignment.sum(-1)
            + 2e4 * crowded.square().sum(-1)
            + (0.12 * apart.square() + 1.0 * (beyond - 2.0).clamp(min=0).square()).sum((-1, -2))
        )
        optimizer.zero_grad()
        energy.sum().backward()
        optimizer.step()
        schedule.step()

    with torch.no_grad():
        pose = torch.cat([parameters[1][:, None], parameters[2]], dim=1)
        joints, glob = forward_kinematics(axis_angle_to_matrix(pose), parameters[0], offsets)
        centers, radii = _hand_spheres(joints, scale)
        pads, _ = _pads(joints, glob, scale)
        deep = (radii - solids.signed_distance(centers)).amax(-1)
        reached = (solids.signed_distance(pads).abs() < checks.contact).reshape(batch, 5, 3).any(-1)
        kept = (
            (deep < checks.depth)
            & (reached.sum(-1) > checks.fingers)
            & (_clearance(centers, radii).amin(-1) > checks.clearance)
        )
        return Grasps(pose.detach(), parameters[0].detach(), offsets, kept)
