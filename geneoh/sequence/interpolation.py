"""Interpolation between frames: points on straight lines, rotations on the shorter arc."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.bundle import FRAMES
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    interpolate_rotations,
    matrix_to_axis_angle,
)
from geneoh.sequence.sequence import HandTrack


@dataclass(frozen=True)
class FrameInterpolation:
    """N instants, each between two frames of a track; fraction 0 is exactly the first of them."""

    before: Int[Tensor, " N"]
    after: Int[Tensor, " N"]
    fraction: Float[Tensor, " N"]

    def points(self, values: Float[Tensor, "T ..."]) -> Float[Tensor, "N ..."]:
        """Values of each frame, interpolated on a straight line."""
        start, end = values[self.before], values[self.after]
        fraction = self.fraction.to(values).reshape(-1, *[1] * (values.ndim - 1))
        return start + fraction * (end - start)

    def rotations(self, rotation: Float[Tensor, "T K 3 3"]) -> Float[Tensor, "N K 3 3"]:
        """Rotation matrices, interpolated on the shorter arc."""
        fraction = self.fraction.to(rotation)[:, None]
        turned = interpolate_rotations(rotation[self.before], rotation[self.after], fraction)
        # At fraction 0 the frame itself is taken: the interpolation would round it.
        exact = (fraction == 0)[..., None, None]
        return torch.where(exact, rotation[self.before], turned)

    def pose(self, pose: Float[Tensor, "T K 3"]) -> Float[Tensor, "N K 3"]:
        """Axis-angle vectors, interpolated as rotations."""
        turned = matrix_to_axis_angle(self.rotations(axis_angle_to_matrix(pose)))
        return torch.where((self.fraction == 0)[:, None, None], pose[self.before], turned)

    def hand(self, hand: HandTrack, valid: Bool[Tensor, " N"]) -> HandTrack:
        """The hand at these instants; `valid` marks those that count as observed."""
        moved = hand.map(
            lambda values: (
                self.points(values) if values.is_floating_point() else values[self.before]
            ),
            FRAMES,
        )
        pose = None if hand.pose is None else self.pose(hand.pose)
        ray = None if moved.camera_ray is None else normalize(moved.camera_ray, dim=-1)
        return replace(moved, valid=valid, pose=pose, camera_ray=ray)
