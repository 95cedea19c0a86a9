"""What may move an object while it is not seen: a palm that carries it, or nothing, so it rests."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.objects.carrying import COMPARED_FRAMES, REST_DEVIATION, carried, scatters
from geneoh.objects.palms import RigidMotion

LEAST_RESTING = 4  # frames from which on a place that does not change tells of rest
NOISE_LEFT = 0.25
"""Deviation of a smoothed palm from the true one, in standard deviations of its noise."""


@dataclass(frozen=True)
class Mover:
    """A palm that may carry an object."""

    pose: Rigid  # without white noise
    error: float  # of its position, metres

    @classmethod
    def of(cls, palm: RigidMotion, like: Tensor) -> "Mover":
        """The palm on the device of a tensor."""
        calm = palm.without_noise
        turns, places = torch.from_numpy(calm.turns.as_matrix()), torch.from_numpy(calm.places)
        pose = Rigid(turns.to(like.device), places.to(like.device))
        return cls(pose, NOISE_LEFT * palm.place_noise())

    def holds(self, path: Rigid) -> Rigid:
        """The poses of an object, seen from the palm."""
        return self.pose.inverse().compose(path)

    def moves(self, own: Float[Tensor, "T 3"], chosen: Bool[Tensor, " T"]) -> Float[Tensor, ""]:
        """Whether the palm moves an object in the chosen frames, 0 to 1; 0 if it rests. `own` are
        places in the palm, metres."""
        over, moved = scatters(self.pose.at(chosen), own[chosen])
        return torch.where(moved < REST_DEVIATION**2, 0.0, carried(over, moved))


class Resting(Mover):
    """The world, in which an object rests that no palm carries."""

    @classmethod
    def like(cls, path: Rigid) -> "Resting":
        """The world in the frames of a path."""
        still = torch.eye(3).to(path.rotation).expand_as(path.rotation)
        return cls(Rigid(still, torch.zeros_like(path.translation)), 0.0)

    def moves(self, own: Float[Tensor, "T 3"], chosen: Bool[Tensor, " T"]) -> Float[Tensor, ""]:
        """Whether an object rests in the chosen frames, 0 or 1; 0 if they are too few to tell."""
        moved, _ = scatters(self.pose.at(chosen), own[chosen])
        return ((moved < REST_DEVIATION**2) & (chosen.sum() >= LEAST_RESTING)).to(own)


def beside(gap: slice, known: Bool[Tensor, " T"]) -> list[Bool[Tensor, " T"]]:
    """The known frames before a gap and after it, or on the one side that there is."""
    numbers = torch.arange(len(known), device=known.device)
    ends = [end for end in (gap.start - 1, gap.stop) if 0 <= end < len(known)]
    return [known & ((numbers - end).abs() <= COMPARED_FRAMES) for end in ends]


def pose_distance(one: Rigid, other: Rigid, size: float) -> Float[Tensor, "*B"]:
    """Distance between poses of an object at its surface, metres. Their origin is its centre, and
    `size` its radius, metres."""
    turned = matrix_to_axis_angle(one.rotation.mT @ other.rotation).norm(dim=-1)
    return (one.translation - other.translation).norm(dim=-1) + size * turned


def better(off: Float[Tensor, "N 3"], error: float) -> Float[Tensor, ""]:
    """Share, 0 to 1, of a path that is `off` the straight line where its own error is expected to
    have this size; metres."""
    apart = off.square().sum(-1).mean()
    return apart / (apart + error**2).clip(1e-12)
