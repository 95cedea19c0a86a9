"""Simple answers to a noisy hand, which MotionDiff mixes frame by frame and parameter by parameter.

To average and to reach for a surface would take it long to learn.

Each is a change from the observed hand to a better guess, in units of
`geneoh.representation.parameters.UNIT`, the wrist's move in canonical axes. Three kinds: the hand
itself, filtered over time; the hand with flat fingers, for shares of it shrink a pose that is off;
and the hand whose fingertips touch the surface next to them, by moving as a whole and by bending
its fingers.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rotations import matrix_to_rotation_6d, rotation_6d_to_matrix, skew
from geneoh.hand.skeleton import MANO_FROM_OPENPOSE, TIP_KEYPOINTS, TIP_PARENTS
from geneoh.representation.parameters import UNIT, HandParameters

FILTERS = (1.5, 4.0, 10.0, 25.0)
"""Deviations in frames of the Gaussian filters."""
FLAT_FILTER = 10.0
"""The filter on the pose that flat fingers undo: the noise of a frame is none of it."""
TOUCH_FILTERS = (4.0, 25.0)
"""Those on the changes that make fingertips touch, which frames tell badly one by one."""
ANSWERS = len(FILTERS) + 1 + len(TOUCH_FILTERS)
"""How many answers there are."""
PAD = 0.008
"""From a fingertip's keypoint to the skin of its pad, metres."""
REACH, BEND_REACH = 0.03, 0.05
"""Distances over which a tip's gap counts less for the whole hand and for its finger, metres."""
SLIDING = 0.1
"""How much less than across it a gap along the surface counts."""
DAMPING = 0.02
"""Lever in metres below which a joint is not used to close a gap: it would turn too far."""
LARGEST = 6.0
"""Bound of the changes that make fingertips touch, in units."""


def simple_answers(
    hand: HandParameters,
    trust: Float[Tensor, "B T"],
    nearest: Float[Tensor, "B T 21 3"],
    normals: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T 3 3"],
) -> Float[Tensor, "B T K 51"]:
    """All answers to an observed hand, gaps filled; frames count by their trust.

    Args:
        hand: the observed hand, canonical frame.
        trust: of each frame, 0 to 1.
        nearest: surface point nearest to each keypoint, with its outward `normals`.
        rotation: of the canonical frame to the world.
    """
    kernels = filter_kernels(trust, (*FILTERS, FLAT_FILTER, *TOUCH_FILTERS)).split(
        [len(FILTERS), 1, len(TOUCH_FILTERS)], dim=1
    )
    flat = torch.nn.functional.pad(-hand.fingers.flatten(2) / UNIT[-1], (6, 0))
    touching = whole_hand_to_touch(hand, nearest, normals, rotation, kernels[2])
    touching = touching + kernels[2] @ fingers_to_touch(hand, nearest, normals)[:, None]
    answers = [
        filtered_changes(hand, kernels[0]),
        kernels[1] @ flat[:, None],
        touching.clamp(-LARGEST, LARGEST),
    ]
    return torch.cat(answers, dim=1).transpose(1, 2)


def filter_kernels(
    trust: Float[Tensor, "B T"], widths: tuple[float, ...]
) -> Float[Tensor, "B K T T"]:
    """Gaussian filters over time as matrices; untrusted frames hardly count."""
    time = torch.arange(trust.shape[1], device=trust.device)
    apart = (time[:, None] - time).square()
    kernels = torch.stack([torch.exp(-0.5 * apart / width**2) for width in widths])
    weights = kernels * (trust + 1e-4)[:, None, None]
    return weights / weights.sum(-1, keepdim=True)


def filtered_changes(
    hand: HandParameters, kernels: Float[Tensor, "B K T T"]
) -> Float[Tensor, "B K T 51"]:
    """Changes from a hand to itself, filtered."""
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
    hand: HandParameters,
    nearest: Float[Tensor, "B T 21 3"],
    normals: Float[Tensor, "B T 21 3"],
) -> tuple[Float[Tensor, "B T 5 3"], Float[Tensor, "B T 5 3"], Float[Tensor, "B T 5 1"]]:
    """Fingertips, the way from each to where its pad touches the surface, and how far that is."""
    joints, _ = hand.posed
    tips = joints[:, :, list(TIP_KEYPOINTS)]
    gap = (nearest + PAD * normals)[:, :, list(TIP_KEYPOINTS)] - tips
    return tips, gap, gap.norm(dim=-1, keepdim=True)


def whole_hand_to_touch(
    hand: HandParameters,
    nearest: Float[Tensor, "B T 21 3"],
    normals: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T 3 3"],
    kernels: Float[Tensor, "B K T T"],
) -> Float[Tensor, "B K T 51"]:
    """What brings fingertips onto the planes next to them by moving the hand as a whole.

    Damped least squares over all frames of a filter at once, for one shift in the world's axes (a
    tracker that is off stays off in these) and one turn in the hand's. Far tips count less, and
    along its plane a tip may slide.
    """
    tips, gap, apart = tip_gaps(hand, nearest, normals)
    outward = normals[:, :, list(TIP_KEYPOINTS)]

    # tip by tip, how a shift and a turn about the wrist move it
    arm = -skew(tips - hand.wrist[:, :, None]) @ hand.turn[:, :, None]
    shift = rotation.mT[:, :, None].expand_as(arm)
    lever = torch.cat([shift * UNIT[0], arm * UNIT[3]], dim=-1)  # (B, T, 5, 3, 6)
    across = outward[..., :, None] * outward[..., None, :]
    counts = across + SLIDING * (torch.eye(3).to(arm) - across)
    weighed = torch.exp(-apart / REACH)[..., None] * lever.mT @ counts
    square = (weighed @ lever).sum(2)
    goal = (weighed @ gap[..., None]).sum(2)

    square = torch.einsum("bktu,buij->bktij", kernels, square)
    goal = torch.einsum("bktu,buij->bktij", kernels, goal)
    calm = (0.5 * UNIT[0]) ** 2 * torch.eye(6).to(arm)
    shift, turn = torch.linalg.solve(square + calm, goal)[..., 0].split(3, dim=-1)
    change = torch.cat([(rotation.mT[:, None] @ shift[..., None])[..., 0], turn], dim=-1)
    return torch.nn.functional.pad(change, (0, 45))


def fingers_to_touch(
    hand: HandParameters,
    nearest: Float[Tensor, "B T 21 3"],
    normals: Float[Tensor, "B T 21 3"],
) -> Float[Tensor, "B T 51"]:
    """What brings fingertips onto the surface next to them by bending each finger by itself.

    Damped least squares, finger by finger. Far tips count less.
    """
    joints, turns = hand.posed
    tips, gap, apart = tip_gaps(hand, nearest, normals)

    # how a turn of each of a finger's joints moves the tip
    last = torch.tensor(TIP_PARENTS)
    chain = torch.stack([last - 2, last - 1, last], dim=-1)  # (5, 3)
    pivot = joints[:, :, list(MANO_FROM_OPENPOSE)][:, :, chain]
    lever = -skew(tips[:, :, :, None] - pivot) @ turns[:, :, chain]  # (B, T, 5, 3, 3, 3)
    lever = lever.transpose(-2, -3).flatten(-2)  # (B, T, 5, 3, 9)
    goal = gap * torch.exp(-apart / BEND_REACH)
    square = lever @ lever.mT + DAMPING**2 * torch.eye(3).to(lever)
    bend = (lever.mT @ torch.linalg.solve(square, goal[..., None]))[..., 0].unflatten(-1, (3, 3))
    fingers = torch.zeros_like(hand.fingers)
    fingers[:, :, chain.flatten() - 1] = bend.flatten(2, 3) / UNIT[-1]
    return torch.nn.functional.pad(fingers.flatten(2), (6, 0))
