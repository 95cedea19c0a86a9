"""Hand motions that do not pass through the object: drawn again until penetration is small."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import Limited
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.hand.spheres import hand_scale, hand_spheres
from geneoh.synthesis.motions.hand_motion import HandPath
from geneoh.synthesis.shapes.solids import PARTS, Solids


@dataclass(frozen=True)
class ClearanceConfig(Limited):
    """How deep moving hands may penetrate the object, and how often a motion is drawn again."""

    depth: float = 0.006
    """Penetration depth of the spheres along the bones above which another motion is drawn, metres:
    a little more than the checks of grasps allow."""
    draws: int = 8  # most motions that are drawn per hand; the shallowest of them is taken
    every: int = 2  # depths are measured in each `every`-th frame


@dataclass(frozen=True)
class MovingSolids(Bundle):
    """B moving objects of two parts, with the parts' poses in the world or another frame."""

    solids: Solids
    rotation: Float[Tensor, "B T 2 3 3"]
    translation: Float[Tensor, "B T 2 3"]

    @classmethod
    def on_joint(
        cls, solids: Solids, turn: Float[Tensor, "B T 3 3"], shift: Float[Tensor, "B T 3"]
    ) -> "MovingSolids":
        """Objects in the frame of their first part, whose second part is moved by its joint."""
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
        """Penetration depth of each hand's deepest sphere, metres; negative if all are outside."""
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
    """For each hand, the first drawn motion that stays out of the object, else the shallowest one.

    `draw` draws a motion for each of the hands with the passed indices.
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
