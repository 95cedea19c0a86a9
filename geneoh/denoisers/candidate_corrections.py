"""Candidate corrections of a noisy hand, which MotionDiff mixes frame by frame.

They are precomputed because the network learns smoothing and surface snapping slowly. Each is a
change of the observed hand in the units of `HandParameters.moved`, with the wrist's translation in
canonical axes. The candidates are: the low-pass filtered hand; flat fingers, a share of which
shrinks a pose that is too large; and fingertips on the surface, reached by moving the whole hand
and by bending each finger.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rotations import matrix_to_rotation_6d, rotation_6d_to_matrix, skew
from geneoh.hand.skeleton import MANO_FROM_OPENPOSE, TIP_KEYPOINTS, TIP_PARENTS
from geneoh.representation.parameters import UNIT, HandParameters

# standard deviations in frames of the Gaussian filters
SMOOTHING_FRAMES = (1.5, 4.0, 10.0, 25.0)  # of the observed hand
FLAT_FRAMES = 10.0  # of the finger pose that the flat-finger candidate subtracts
CONTACT_FRAMES = (4.0, 25.0)  # of the changes to the surface, which are noisy in single frames
CANDIDATES = len(SMOOTHING_FRAMES) + 1 + len(CONTACT_FRAMES)  # number of candidate corrections
PAD_DEPTH = 0.008  # distance from a fingertip's keypoint to the skin of its pad, metres
HAND_REACH, FINGER_REACH = 0.03, 0.05  # decay length of a tip's weight with its gap, metres
TANGENTIAL = 0.1  # weight of a tangential gap relative to a normal one
DAMPING = 0.02  # lever arm in metres below which the damping suppresses rotation
LARGEST_CHANGE = 6.0  # bound of the changes that bring fingertips to the surface, units of `UNIT`


def candidate_corrections(
    hand: HandParameters,
    trust: Float[Tensor, "B T"],
    nearest: Float[Tensor, "B T 21 3"],
    normals: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T 3 3"],
) -> Float[Tensor, "B T K 51"]:
    """All K candidate corrections of an observed hand in the canonical frame, gaps filled.

    `nearest` are the closest surface points to the keypoints, with their outward `normals`, and
    `rotation` maps the canonical frame to the world."""
    smooth, flatten, touch = (
        filter_kernels(trust, widths)
        for widths in (SMOOTHING_FRAMES, (FLAT_FRAMES,), CONTACT_FRAMES)
    )
    flat = torch.nn.functional.pad(-hand.fingers.flatten(2) / UNIT[-1], (6, 0))
    touching = whole_hand_to_touch(hand, nearest, normals, rotation, touch)
    touching = touching + touch @ fingers_to_touch(hand, nearest, normals)[:, None]
    touching = touching.clamp(-LARGEST_CHANGE, LARGEST_CHANGE)
    candidates = [filtered_changes(hand, smooth), flatten @ flat[:, None], touching]
    return torch.cat(candidates, dim=1).transpose(1, 2)


def filter_kernels(
    trust: Float[Tensor, "B T"], widths: tuple[float, ...]
) -> Float[Tensor, "B K T T"]:
    """Gaussian filters over time as T x T matrices; frames of zero trust have almost no weight."""
    time = torch.arange(trust.shape[1], device=trust.device)
    apart = (time[:, None] - time).square()
    kernels = torch.stack([torch.exp(-0.5 * apart / width**2) for width in widths])
    weights = kernels * (trust + 1e-4)[:, None, None]
    return weights / weights.sum(-1, keepdim=True)


def filtered_changes(
    hand: HandParameters, kernels: Float[Tensor, "B K T T"]
) -> Float[Tensor, "B K T 51"]:
    """Changes from a hand to its low-pass filtered versions."""
    six = matrix_to_rotation_6d(hand.turn)
    values = torch.cat([hand.wrist, six, hand.fingers.flatten(2)], dim=-1)
    wrist, six, fingers = (kernels @ values[:, None]).split([3, 6, 45], dim=-1)
    count = kernels.shape[1]
    many = hand.map(lambda value: value[:, None].expand(-1, count, *value.shape[1:]))
    goal = HandParameters(
        wrist, rotation_6d_to_matrix(six), fingers.unflatten(-1, (15, 3)), many.offsets
    )
    return many.change_to(goal)


def tip_gaps(
    hand: HandParameters, nearest: Float[Tensor, "B T 21 3"], normals: Float[Tensor, "B T 21 3"]
) -> tuple[Float[Tensor, "B T 5 3"], Float[Tensor, "B T 5 3"], Float[Tensor, "B T 5 1"]]:
    """Fingertip positions, the vector from each to its contact position, and its length."""
    joints, _ = hand.posed
    tips = joints[:, :, list(TIP_KEYPOINTS)]
    gap = (nearest + PAD_DEPTH * normals)[:, :, list(TIP_KEYPOINTS)] - tips
    return tips, gap, gap.norm(dim=-1, keepdim=True)


def whole_hand_to_touch(
    hand: HandParameters,
    nearest: Float[Tensor, "B T 21 3"],
    normals: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T 3 3"],
    kernels: Float[Tensor, "B K T T"],
) -> Float[Tensor, "B K T 51"]:
    """Rigid motions of the hand that bring fingertips onto the tangent planes next to them.

    Damped least squares on normal equations that are filtered over time. The unknowns are a
    translation in world axes, because a tracker's offset is constant there, and a rotation in the
    wrist's axes. Far tips have less weight, and sliding along the plane costs little.
    """
    tips, gap, apart = tip_gaps(hand, nearest, normals)
    outward = normals[:, :, list(TIP_KEYPOINTS)]

    # Jacobian of each tip in the translation and in the rotation about the wrist
    arm = -skew(tips - hand.wrist[:, :, None]) @ hand.turn[:, :, None]
    shift = rotation.mT[:, :, None].expand_as(arm)
    lever = torch.cat([shift * UNIT[0], arm * UNIT[3]], dim=-1)  # (B, T, 5, 3, 6)
    across = outward[..., :, None] * outward[..., None, :]
    counts = across + TANGENTIAL * (torch.eye(3).to(arm) - across)
    weighed = torch.exp(-apart / HAND_REACH)[..., None] * lever.mT @ counts
    square = (weighed @ lever).sum(2)
    goal = (weighed @ gap[..., None]).sum(2)

    square = torch.einsum("bktu,buij->bktij", kernels, square)
    goal = torch.einsum("bktu,buij->bktij", kernels, goal)
    calm = (0.5 * UNIT[0]) ** 2 * torch.eye(6).to(arm)
    shift, turn = torch.linalg.solve(square + calm, goal)[..., 0].split(3, dim=-1)
    change = torch.cat([(rotation.mT[:, None] @ shift[..., None])[..., 0], turn], dim=-1)
    return torch.nn.functional.pad(change, (0, 45))


def fingers_to_touch(
    hand: HandParameters, nearest: Float[Tensor, "B T 21 3"], normals: Float[Tensor, "B T 21 3"]
) -> Float[Tensor, "B T 51"]:
    """Rotations of each finger's joints that bring its tip to the surface; damped least squares."""
    joints, turns = hand.posed
    tips, gap, apart = tip_gaps(hand, nearest, normals)

    # Jacobian of each tip in the rotations of its finger's three joints
    last = torch.tensor(TIP_PARENTS)
    chain = torch.stack([last - 2, last - 1, last], dim=-1)  # (5, 3)
    pivot = joints[:, :, list(MANO_FROM_OPENPOSE)][:, :, chain]
    lever = -skew(tips[:, :, :, None] - pivot) @ turns[:, :, chain]  # (B, T, 5, 3, 3, 3)
    lever = lever.transpose(-2, -3).flatten(-2)  # (B, T, 5, 3, 9)
    goal = gap * torch.exp(-apart / FINGER_REACH)
    square = lever @ lever.mT + DAMPING**2 * torch.eye(3).to(lever)
    bend = (lever.mT @ torch.linalg.solve(square, goal[..., None]))[..., 0].unflatten(-1, (3, 3))
    fingers = torch.zeros_like(hand.fingers)
    fingers[:, :, chain.flatten() - 1] = bend.flatten(2, 3) / UNIT[-1]
    return torch.nn.functional.pad(fingers.flatten(2), (6, 0))
