"""Ways of hands that do not lead through the object: drawn again until they stay out of it."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import Limited
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.grasping.contact_pads import hand_scale, hand_spheres
from geneoh.synthesis.motions.hand_motion import HandPath
from geneoh.synthesis.shapes.solids import PARTS, Solids


@dataclass(frozen=True)
class ClearanceConfig(Limited):
    """How deep hands may be in the object on their ways, and how often a way is drawn again."""

    depth: float = 0.006
    """Depth of the spheres along the bones in the object from which on another way is drawn,
    metres: a little more than the checks of grasps allow."""
    draws: int = 8  # ways that are drawn at most; the shallowest of them is taken
    every: int = 2  # frames from one in which depths are measured to the next


@dataclass(frozen=True)
class MovingSolids(Bundle):
    """B objects of two parts that move, in the frame of the world or of what moves with it."""

    solids: Solids
    rotation: Float[Tensor, "B T 2 3 3"]
    translation: Float[Tensor, "B T 2 3"]

    @classmethod
    def on_joint(
        cls, solids: Solids, turn: Float[Tensor, "B T 3 3"], shift: Float[Tensor, "B T 3"]
    ) -> "MovingSolids":
        """Objects whose first part rests and whose second one is moved by its joint."""
        turns = torch.stack([torch.eye(3).expand_as(turn), turn], 2)
        return cls(solids, turns, torch.stack([torch.zeros_like(shift), shift], 2))

    def signed_distance(self, points: Float[Tensor, "B T P 3"]) -> Float[Tensor, "B T P"]:
        """Signed distance of points to the object in each frame, metres; negative inside."""
        each = []
        for part in range(PARTS):
            shift = self.translation[:, :, part, None]
            there = ((points - shift) @ self.rotation[:, :, part]).flatten(1, 2)
            each.append(self.solids.only(part).signed_distance(there))
        return torch.minimum(*each).unflatten(1, points.shape[1:3])

    def depth(self, hands: HandPath, offsets: Float[Tensor, "B 20 3"]) -> Float[Tensor, "B T"]:
        """How deep the deepest sphere of each hand is in the object, metres; negative beside it."""
        turns = axis_angle_to_matrix(hands.pose)
        joints = forward_kinematics(turns, hands.wrist, offsets[:, None])[0]
        centers, radii = hand_spheres(joints, hand_scale(offsets)[:, None])
        return (radii - self.signed_distance(centers)).amax(-1)


def clear_ways(
    draw: Callable[[Int[Tensor, " C"]], HandPath],
    objects: MovingSolids,
    offsets: Float[Tensor, "B 20 3"],
    config: ClearanceConfig,
) -> HandPath:
    """Of several motions of each hand one in which it stays out of the object, or the shallowest.

    `draw` draws a motion for the hands of the given numbers.
    """
    some = slice(None, None, config.every)
    measured = objects[some]
    hands = draw(torch.arange(len(offsets)))
    deepest = measured.depth(hands[some], offsets).amax(1)
    for _ in range(config.draws - 1):
        again = torch.nonzero(deepest > config.depth)[:, 0]
        if not len(again):
            break
        other = draw(again)
        depth = measured.take(again, "B").depth(other[some], offsets[again]).amax(1)
        better = depth < deepest[again]
        hands = hands.replaced(again[better], other.take(better, "B"))
        deepest[again] = torch.minimum(depth, deepest[again])
    return hands
