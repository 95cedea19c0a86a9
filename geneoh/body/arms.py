"""Inverse kinematics of the arms: collars, shoulders, elbows and wrists from where the hands are.

Analytic, by the law of cosines, frame by frame; differentiable away from a stretched arm.
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
"""Where a relaxed elbow points, in the chest's frame: down, out and back; for the left arm."""
COLLAR_SHARE = 0.15
"""Of the turn from the arm of the T-pose to the hand, what the collar takes; the shoulder blade
follows a raised arm, by up to a third of its elevation (Inman et al. 1944)."""
MOST_COLLAR = 0.35
"""Radians that the collar turns at most."""
FOREARM_TWIST = 0.6
"""Of the turn of the hand about the forearm, what the elbow joint takes; the wrist has the rest."""
LONGEST_REACH = 0.999
"""Of the length of the stretched arm; a target beyond it is not reached."""


def reach(
    skeleton: Skeleton,
    motion: BodyMotion,
    positions: Float[Tensor, "*B T 2 3"],
    rotations: Float[Tensor, "*B T 2 3 3"],
    swivel: Float[Tensor, "*#B #T 2"] | None = None,
) -> BodyMotion:
    """The motion with arms that bring both wrists to where they should be.

    Args:
        skeleton: whose arms.
        motion: root, legs, spine and fingers, which stay; its arms are not used.
        positions: of the left and the right wrist in the world, metres. Beyond the reach of an arm
            the hand stays on the line from the shoulder to it.
        rotations: of the wrists against the world, which are always met.
        swivel: radians by which each elbow is turned from its relaxed place about the line from
            shoulder to wrist; positive lifts it outwards on both sides.
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
    """Rotation against the chest of a forearm that is not twisted, for a wrist at a place.

    Turns of the hand against it stay in the range of a person's where they are interpolated; those
    against the chest do not. `place` is that of the wrist from where the shoulder is in the T-pose,
    in the chest's frame, metres; `swivel` is as `reach` takes it.
    """
    bones = [skeleton.offsets[joint] for joint in _arm(side)[1:]]
    chest = torch.eye(3).to(place).expand(*place.shape[:-1], 3, 3)
    return _solve(side, chest, place + bones[0], bones, swivel)[-1]


def _arm(side: Side) -> list[int]:
    """Collar, shoulder, elbow and wrist."""
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
    """Global rotations of collar, shoulder and a forearm without twist; `target` is the wrist's
    place from the collar."""
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
    """Global rotations of collar, shoulder, elbow and wrist: the forearm follows a turned hand."""
    collar, shoulder, straight = solved
    axis = normalize(fore, dim=-1).expand_as(hand[..., 0])
    twist = _twist(straight.transpose(-1, -2) @ hand, axis)
    return [collar, shoulder, straight @ axis_angle_to_matrix(FOREARM_TWIST * twist), hand]


def _collar(upper: Float[Tensor, "*B 3"], target: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3 3"]:
    """The collar's turn in the chest's frame, towards a hand there."""
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
    # lifting the left elbow outwards turns it about the arm from below to the left
    return (axis_angle_to_matrix(turn[..., None] * along) @ relaxed[..., None])[..., 0]


def _aligned(
    rest_bone: Float[Tensor, "*B 3"],
    rest_hinge: Float[Tensor, "*B 3"],
    bone: Float[Tensor, "*B 3"],
    hinge: Float[Tensor, "*B 3"],
) -> Float[Tensor, "*B 3 3"]:
    """The rotation that takes one bone, and the plane of its hinge, to another."""
    return axes_along(bone, hinge) @ axes_along(rest_bone, rest_hinge).transpose(-1, -2)


def _twist(rotation: Float[Tensor, "*B 3 3"], axis: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3"]:
    """The part of a rotation about a unit axis, as an axis-angle vector within half a turn."""
    quat = matrix_to_quat_wxyz(rotation)
    along = (quat[..., 1:] * axis).sum(-1, keepdim=True)
    return 2 * torch.atan2(along, quat[..., :1]) * axis
