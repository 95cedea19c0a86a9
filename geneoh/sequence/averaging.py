"""Means over the time of one frame at a lower rate, so that resampling to it wastes no frame."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    matrix_to_axis_angle,
    nearest_rotations,
)
from geneoh.sequence.gaps import blendable, with_frames
from geneoh.sequence.sequence import Sequence


def averaged(sequence: Sequence, fps: float) -> Sequence:
    """The sequence with every frame the mean over 1 / `fps` seconds around it, gaps filled before.

    White noise of q frames a frame of the lower rate falls by the root of q. The sequence itself
    where it has no higher rate. Towards both ends means are over less, as much to either side.
    """
    if sequence.fps <= fps:
        return sequence
    mean = FrameMean(sequence.frames, sequence.fps / fps)
    motion = replace(
        sequence.object,
        rotation=mean.rotations(sequence.object.rotation),
        translation=mean.points(sequence.object.translation),
    )
    hands = tuple(
        with_frames(hand, hand.valid, mean.points, mean.pose)
        for hand in map(blendable, sequence.hands)
    )
    return replace(sequence, hands=hands, object=motion)


@dataclass(frozen=True)
class FrameMean:
    """Means over a time of `width` frames, more than one, around each of some frames."""

    frames: int
    width: float

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "T ..."]:
        """The means of values."""
        frames = torch.arange(self.frames, device=values.device)
        to_ends = torch.minimum(frames, frames.flip(0)) + 0.5
        half = to_ends.clamp(max=self.width / 2)
        total = torch.zeros_like(values)
        reach = int(self.width / 2 + 0.5)
        for offset in range(-reach, reach + 1):
            share = (half - abs(offset) + 0.5).clamp(0, 1) / (2 * half)
            there = values[(frames + offset).clamp(0, self.frames - 1)]
            total += share.to(values).view(-1, *[1] * (values.ndim - 1)) * there
        return total

    def rotations(self, rotation: Float[Tensor, "T *N 3 3"]) -> Float[Tensor, "T *N 3 3"]:
        """The rotations that are nearest to the means of matrices."""
        return nearest_rotations(self.points(rotation))

    def pose(self, pose: Float[Tensor, "T K 3"]) -> Float[Tensor, "T K 3"]:
        """The means of axis-angle vectors, as rotations."""
        return matrix_to_axis_angle(self.rotations(axis_angle_to_matrix(pose)))
