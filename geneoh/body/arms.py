"""Inverse kinematics of the arms: collars, shoulders, elbows and wrists from the wrists' poses.

Closed form by the law of cosines, frame by frame; differentiable away from a stretched arm.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import JOINT_NAMES, PARENTS, WRISTS, Skeleton
from geneoh.choices import SIDES, Side
from geneoh.geometry.rotations import axes_along, axis_angle_to_matrix, matrix_to_quat_wxyz

ELBOW_TOWARDS = (0.45, -1.0, -0.35)
"""Direction of a relaxed left elbow in the chest's frame: out (+x), down (-y), back (-z)."""
COLLAR_SHARE = 0.15
"""Share of the rotation from the T-pose arm to the wrist's direction that the collar takes. The
shoulder blade follows a raised arm by up to a third of its elevation (Inman et al. 1944)."""
MOST_COLLAR = 0.35
"""Largest rotation of the collar, radians."""
FOREARM_TWIST = 0.6
"""Share of the hand's twist about the forearm that the elbow takes; the wrist has the rest."""
LONGEST_REACH = 0.999
"""Largest distance from shoulder to wrist, as a share of the stretched arm's length."""


def reach(
    skeleton: Skeleton,
    motion: BodyMotion,
    positions: Float[Tensor, "*B T 2 3"],
    rotations: Float[Tensor, "*B T 2 3 3"],
    swivel: Float[Tensor, "*#B #T 2"] | None = None,
) -> BodyMotion:
    """The motion with arms that bring both wrists to target positions and rotations.

    Args:
        skeleton: bone offsets of the body.
        motion: its root, legs, spine and fingers are kept, its arms are replaced.
        positions: targets of the left and the right wrist in the world, metres. For a target out of
            reach the wrist is placed on the line from the shoulder to it.
        rotations: target wrist-to-world rotations, which are always met.
        swivel: rotation of each elbow from its relaxed position about the line from shoulder to
            wrist, radians; positive lifts the elbow outwards on both sides.
    """
    posed = pose(skeleton, motion)
    chest = JOINT_NAMES.index("spine3")
    local = motion.rotations.clone()
    for index, side in enumerate(SIDES):
        arm = _arm(side)
        turn = posed.rotations[..., chest, :, :]
        collar = posed.positions[..., arm[0], :]
        bones = [skeleton.offsets[..., None, joint, :] for joint in arm[1:]]
        angle = 0.0 if swivel is None else swivel[..., index]
        target, hand = positions[..., index, :] - collar, rotations[..., index, :, :]
        turned = _with_hand(_solve(side, turn, target, bones, angle), hand, bones[-1])
        above = [turn, *turned[:-1]]
        for joint, parent, each in zip(arm, above, turned, strict=True):
            local[..., joint, :, :] = parent.transpose(-1, -2) @ each
    return replace(motion, rotations=local)


def forearm(
    skeleton: Skeleton,
    side: Side,
    place: Float[Tensor, "*B 3"],
    swivel: Float[Tensor, "*#B"] | float = 0.0,
) -> Float[Tensor, "*B 3 3"]:
    """Rotation, in the chest's frame, of an untwisted forearm whose wrist is at `place`.

    Interpolated hand rotations stay anatomically possible relative to this forearm, but not
    relative to the chest. `place` is the wrist relative to the T-pose shoulder, in the chest's
    frame, metres; `swivel` is as in `reach`.
    """
    bones = [skeleton.offsets[joint] for joint in _arm(side)[1:]]
    chest = torch.eye(3).to(place).expand(*place.shape[:-1], 3, 3)
    return _solve(side, chest, place + bones[0], bones, swivel)[-1]


def _arm(side: Side) -> list[int]:
    """Joint indices of collar, shoulder, elbow and wrist."""
    joints = [WRISTS[side]]
    while JOINT_NAMES[joints[0]] != f"{side}_collar":
        joints.insert(0, PARENTS[joints[0]])
    return joints


def _solve(
    side: Side,
    chest: Float[Tensor, "*B 3 3"],
    target: Float[Tensor, "*B 3"],
    bones: list[Tensor],
    swivel: Tensor | float,
) -> list[Tensor]:
    """World rotations of collar, shoulder and an untwisted forearm; `target` is the position of the
    wrist relative to the collar, in the world."""
    to_shoulder, upper, fore = (bone.expand_as(target) for bone in bones)
    collar = chest @ _collar(upper, (chest.transpose(-1, -2) @ target[..., None])[..., 0])
    target = target - (collar @ to_shoulder[..., None])[..., 0]
    first, second = upper.norm(dim=-1), fore.norm(dim=-1)
    shortest = (first - second).abs() / LONGEST_REACH
    distance = target.norm(dim=-1).clamp(min=shortest.clamp(min=1e-3))
    distance = torch.minimum(distance, LONGEST_REACH * (first + second))
    along, aside = normalize(target, dim=-1), _elbow_side(side, chest, target, swivel)
    cosine = (first**2 + distance**2 - second**2) / (2 * first * distance)
    sine = (1 - cosine**2).clamp(min=0).sqrt()
    elbow = first[..., None] * (cosine[..., None] * along + sine[..., None] * aside)
    hinge = torch.linalg.cross(aside, along)
    rest_hinge = upper.new_tensor((0.0, -1.0 if side == "left" else 1.0, 0.0)).expand_as(upper)
    shoulder = _aligned(upper, rest_hinge, elbow, hinge)
    straight = _aligned(fore, rest_hinge, distance[..., None] * along - elbow, hinge)
    return [collar, shoulder, straight]


def _with_hand(
    solved: list[Tensor], hand: Float[Tensor, "*B 3 3"], fore: Float[Tensor, "*#B 3"]
) -> list[Tensor]:
    """World rotations of collar, shoulder, elbow and wrist; the elbow takes its share of twist."""
    collar, shoulder, straight = solved
    axis = normalize(fore, dim=-1).expand_as(hand[..., 0])
    twist = _twist(straight.transpose(-1, -2) @ hand, axis)
    return [collar, shoulder, straight @ axis_angle_to_matrix(FOREARM_TWIST * twist), hand]


def _collar(upper: Float[Tensor, "*B 3"], target: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3 3"]:
    """Rotation of the collar in the chest's frame, towards a wrist at `target` in this frame."""
    start, end = normalize(upper, dim=-1), normalize(target, dim=-1)
    across = torch.linalg.cross(start, end)
    sine = across.norm(dim=-1, keepdim=True)
    angle = torch.atan2(sine, (start * end).sum(-1, keepdim=True))
    angle = (COLLAR_SHARE * angle).clamp(max=MOST_COLLAR)
    return axis_angle_to_matrix(angle * across / sine.clamp(min=1e-6))


def _elbow_side(
    side: Side,
    chest: Float[Tensor, "*B 3 3"],
    target: Float[Tensor, "*B 3"],
    swivel: Tensor | float,
) -> Float[Tensor, "*B 3"]:
    """Unit direction in which the elbow leaves the line from shoulder to wrist."""
    out, down, back = ELBOW_TOWARDS
    sign = 1.0 if side == "left" else -1.0
    relaxed = (chest @ chest.new_tensor((sign * out, down, back))[:, None])[..., 0]
    along = normalize(target, dim=-1)
    relaxed = normalize(relaxed - (relaxed * along).sum(-1, keepdim=True) * along, dim=-1)
    turn = sign * torch.as_tensor(swivel, dtype=target.dtype, device=target.device)
    # a positive rotation about `along` lifts the left elbow outwards, and lowers the right one
    return (axis_angle_to_matrix(turn[..., None] * along) @ relaxed[..., None])[..., 0]


def _aligned(
    rest_bone: Float[Tensor, "*B 3"],
    rest_hinge: Float[Tensor, "*B 3"],
    bone: Float[Tensor, "*B 3"],
    hinge: Float[Tensor, "*B 3"],
) -> Float[Tensor, "*B 3 3"]:
    """The rotation that maps a rest bone and its hinge axis to a posed bone and its hinge axis."""
    return axes_along(bone, hinge) @ axes_along(rest_bone, rest_hinge).transpose(-1, -2)


def _twist(rotation: Float[Tensor, "*B 3 3"], axis: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3"]:
    """The twist of a rotation about a unit axis, as an axis-angle vector of at most half a turn."""
    quat = matrix_to_quat_wxyz(rotation)
    along = (quat[..., 1:] * axis).sum(-1, keepdim=True)
    return 2 * torch.atan2(along, quat[..., :1]) * axis
