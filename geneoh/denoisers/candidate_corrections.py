"""Candidate corrections of a noisy hand, which MotionDiff mixes frame by frame.

They are precomputed because the network learns smoothing and surface snapping slowly. Each is a
change of the observed hand in the units of `HandParameters.moved`, the wrist's in canonical axes:
to the hand filtered over time; to flat fingers, a share of which shrinks a pose that is too large;
and to fingertips that touch the surface, the hand moved as a whole and bent finger by finger.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rotations import matrix_to_rotation_6d, rotation_6d_to_matrix, skew
from geneoh.hand.skeleton import MANO_FROM_OPENPOSE, TIP_KEYPOINTS, TIP_PARENTS
from geneoh.representation.parameters import UNIT, HandParameters

SMOOTHING_FRAMES = (1.5, 4.0, 10.0, 25.0)  # deviations of the filters of the observed hand
FLAT_FRAMES = 10.0  # the same for the pose that flat fingers undo, without the noise of frames
CONTACT_FRAMES = (4.0, 25.0)  # of the changes to the surface, which single frames show badly
CANDIDATES = len(SMOOTHING_FRAMES) + 1 + len(CONTACT_FRAMES)  # number of candidate corrections
PAD_DEPTH = 0.008  # distance from a fingertip's keypoint to the skin of its pad, metres
HAND_REACH, FINGER_REACH = 0.03, 0.05  # gaps over which a tip's weight decays, metres
SLIDING = 0.1  # weight of a gap along the surface, relative to one across it
DAMPING = 0.02  # lever in metres below which a joint closes no gap: it would turn too far
LARGEST_CHANGE = 6.0  # bound of the changes that bring fingertips to the surface, in units


def candidate_corrections(
    hand: HandParameters,
    trust: Float[Tensor, "B T"],
    nearest: Float[Tensor, "B T 21 3"],
    normals: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T 3 3"],
) -> Float[Tensor, "B T K 51"]:
    """All candidate corrections of an observed hand in the canonical frame, gaps filled. `nearest`
    are surface points next to the keypoints, with their outward `normals`; `rotation` is of the
    canonical frame to the world."""
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
    """Gaussian filters over time as matrices; frames without trust get almost no weight."""
    time = torch.arange(trust.shape[1], device=trust.device)
    apart = (time[:, None] - time).square()
    kernels = torch.stack([torch.exp(-0.5 * apart / width**2) for width in widths])
    weights = kernels * (trust + 1e-4)[:, None, None]
    return weights / weights.sum(-1, keepdim=True)


def filtered_changes(
    hand: HandParameters, kernels: Float[Tensor, "B K T T"]
) -> Float[Tensor, "B K T 51"]:
    """Changes from a hand to the same hand filtered over time."""
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
    """Changes of the whole hand that bring fingertips onto the tangent planes next to them.

    Damped least squares under a filter, for one shift in world axes, in which a tracker's offset is
    constant, and one turn in the hand's axes. Far tips count less; a tip may slide on its plane.
    """
    tips, gap, apart = tip_gaps(hand, nearest, normals)
    outward = normals[:, :, list(TIP_KEYPOINTS)]

    # the derivative of each tip by the shift and by the turn about the wrist
    arm = -skew(tips - hand.wrist[:, :, None]) @ hand.turn[:, :, None]
    shift = rotation.mT[:, :, None].expand_as(arm)
    lever = torch.cat([shift * UNIT[0], arm * UNIT[3]], dim=-1)  # (B, T, 5, 3, 6)
    across = outward[..., :, None] * outward[..., None, :]
    counts = across + SLIDING * (torch.eye(3).to(arm) - across)
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
    """Changes of each finger that bring its tip onto the surface, by damped least squares."""
    joints, turns = hand.posed
    tips, gap, apart = tip_gaps(hand, nearest, normals)

    # the derivative of each tip by the turns of its finger's three joints
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
