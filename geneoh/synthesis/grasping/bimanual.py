"""Two hands on one object: the second is a right hand on the object's mirror image."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.config import Limited
from geneoh.geometry.mirror import mirror_points
from geneoh.synthesis.grasping.grasps import Grasps
from geneoh.synthesis.shapes.solids import Solids


@dataclass(frozen=True)
class BimanualConfig(Limited):
    """How many second hands there are, and how they differ from the first."""

    share: float = 0.2
    """Attempted second hands, as a share of the first ones; many of them are not kept."""
    gap: float = 0.025  # least distance between keypoints of two hands, metres, with skin between
    bone_std: float = 0.005  # relative standard deviation of bone lengths between a person's hands


@dataclass(frozen=True)
class HandPairs:
    """Which of B clips show a second hand, on the mirror image of another clip's object."""

    first: Int[Tensor, " B"]
    """For a second hand, the index of the clip with the first hand; -1 for every other clip."""

    @classmethod
    def none(cls, count: int) -> "HandPairs":
        """No clip is of a second hand."""
        return cls(torch.full((count,), -1))

    @property
    def second(self) -> Bool[Tensor, " B"]:
        """Clips of second hands."""
        return self.first >= 0

    @property
    def leader(self) -> Int[Tensor, " B"]:
        """`first`, as an index that is valid for every clip: 0 where there is no first hand."""
        return self.first.clamp(min=0)

    @property
    def shared(self) -> Bool[Tensor, " B"]:
        """Clips whose object is held by two hands."""
        shared = self.second.clone()
        shared[self.first[self.second]] = True
        return shared


def bimanual_objects(solids: Solids, count: int, config: BimanualConfig) -> Int[Tensor, " C"]:
    """Indices of the largest of the first `count` objects, which have room for a second hand."""
    return solids.extents[:count].amax(-1).topk(int(config.share * count)).indices


def grasp_directions(
    solids: Solids, shared: Int[Tensor, " C"], standing: Bool[Tensor, " B"] | None = None
) -> Float[Tensor, "B 3"]:
    """Unit vector to the side that each hand approaches from, in the object's frame; zero for any.

    First hands (`shared`) and second hands (the last C) approach from opposite ends of the longest
    axis; for objects that are `standing` on a table, the z axis is left out.
    """
    extents = solids.extents
    if standing is not None:
        extents = extents * torch.where(standing[:, None], 1 - torch.eye(3)[2], 1.0)
    longest = torch.nn.functional.one_hot(extents.argmax(-1), 3).to(extents)
    direction = torch.zeros_like(longest)
    direction[shared] = longest[shared]
    direction[len(direction) - len(shared) :] = -mirror_points(longest[shared])
    return direction


def pair_hands(grasps: Grasps, shared: Int[Tensor, " C"], config: BimanualConfig) -> HandPairs:
    """The pairs of first hands (`shared`) and second ones (the last C) among the kept grasps.

    Two hands that would touch are not paired; each is kept as a single hand.
    """
    single = len(grasps.kept) - len(shared)
    joints, _ = grasps.posed()
    gap = torch.cdist(joints[shared], mirror_points(joints[single:])).amin((1, 2))
    both = grasps.kept[shared] & grasps.kept[single:] & (gap > config.gap)
    number = grasps.kept.cumsum(0) - 1
    first = torch.full((len(grasps.kept),), -1)
    first[single:] = torch.where(both, number[shared], -1)
    return HandPairs(first[grasps.kept])
