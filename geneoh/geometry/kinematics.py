"""Forward kinematics of any tree of joints: a hand's skeleton and a body's share it."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor


def tree_kinematics(
    rotations: Float[Tensor, "*#B J 3 3"],
    root: Float[Tensor, "*#B 3"],
    offsets: Float[Tensor, "*#B M 3"],
    parents: Sequence[int],
) -> tuple[Float[Tensor, "*B N 3"], Float[Tensor, "*B J 3 3"]]:
    """Positions of N points and the global rotations of the J joints among them, world frame.

    Args:
        rotations: rotation of each joint relative to its parent; the root's relative to the world.
        root: position of the root in the world, metres.
        offsets: rest offset of each point but the root from its parent, metres; M = N - 1.
        parents: parent index of each of the N points, lower than its own; -1 for the root, which
            comes first. Points beyond the J joints are ends of bones, such as fingertips.
    """
    turned, position = [rotations[..., 0, :, :]], [root]
    for point in range(1, len(parents)):
        parent = parents[point]
        step = turned[parent] @ offsets[..., point - 1, :, None]
        position.append(position[parent] + step[..., 0])
        if point < rotations.shape[-3]:
            turned.append(turned[parent] @ rotations[..., point, :, :])
    return torch.stack(torch.broadcast_tensors(*position), dim=-2), torch.stack(turned, dim=-3)
