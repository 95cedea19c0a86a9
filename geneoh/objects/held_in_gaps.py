"""Poses of an object in gaps of its track: one that a hand moves is moved by the palm there, too.

Trackers lose an object most often while a hand covers and moves it. On the straight line from the
last pose before a gap to the first one after it, the object is centimetres off, and in its frame
the hand seems to leave it and to come back, in all windows of the stages that see the gap.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import interpolate_rotations
from geneoh.objects.carrying import COMPARED_FRAMES, REST_DEVIATION, carried, scatters
from geneoh.objects.evidence import share_between
from geneoh.objects.palms import RigidMotion
from geneoh.sequence.gaps import observed_around
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

KEPT, CHANGED = 0.035, 0.05
"""Distance between the usual places of the object in the palm before and after a gap, metres: up to
the first bound the hand kept it, from the second on it was taken or put down in the gap. Of made
and scanned clips with noise, held objects have at most 0.032 and others 0.065 or more."""
NOISE_LEFT = 0.25
"""Deviation of a smoothed palm from the true one, in standard deviations of its noise."""


def held_in_gaps(motion: ObjectTrack, palms: Iterable[RigidMotion]) -> ObjectTrack:
    """The track with other poses in those gaps beside which a palm moves the object.

    `motion` has finite poses in all frames. They stay as they are in frames that are observed, and
    in gaps beside which no palm moves with the object. Palms count if they are seen for long enough
    to tell noise from motion.
    """
    gaps = [part for part in motion.seen_parts if not bool(motion.observed[:, part].all())]
    calm = [Carrying.of(palm, motion.rotation) for palm in palms if palm.is_long] if gaps else []
    if not calm:
        return motion
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    for part in gaps:
        known = motion.observed[:, part]
        center = motion.meshes[part].center().to(rotation)
        turns = rotation[:, part]
        path = Rigid(turns.double(), (turns @ center + translation[:, part]).double())
        path = carried_path(path, known, calm)
        turns = path.rotation.to(rotation)
        rotation[~known, part] = turns[~known]
        places = path.translation.to(rotation) - turns @ center
        translation[~known, part] = places[~known]
    return replace(motion, rotation=rotation, translation=translation)


def carried_path(path: Rigid, known: Bool[Tensor, " T"], palms: "list[Carrying]") -> Rigid:
    """A path with gaps in which the object is carried by the palm that moves with it most."""
    every = [palm.through_gaps(path, known) for palm in palms]
    share, best = torch.stack([share for _, share in every]).max(0)
    frames = torch.arange(len(share), device=share.device)
    turns, places = (
        torch.stack([getattr(held, name) for held, _ in every])[best, frames]
        for name in ("rotation", "translation")
    )
    turned = interpolate_rotations(path.rotation, turns, share)
    return Rigid(turned, path.translation.lerp(places, share[:, None]))


@dataclass(frozen=True)
class Carrying:
    """A palm that may carry an object."""

    pose: Rigid  # without white noise
    error: float  # of its position, metres

    @classmethod
    def of(cls, palm: RigidMotion, like: Tensor) -> "Carrying":
        """The palm on the device of a tensor."""
        calm = palm.without_noise()
        turns, places = torch.from_numpy(calm.turns.as_matrix()), torch.from_numpy(calm.places)
        pose = Rigid(turns.to(like.device), places.to(like.device))
        return cls(pose, NOISE_LEFT * palm.place_noise())

    def through_gaps(
        self, path: Rigid, known: Bool[Tensor, " T"]
    ) -> tuple[Rigid, Float[Tensor, " T"]]:
        """The path with gaps in which the object keeps its pose in the palm, or changes it evenly;
        and the extent, 0 to 1, to which the palm carries it there."""
        own, between = self.pose.inverse().compose(path), observed_around(known)
        turns = between.rotations(own.rotation[:, None])[:, 0]
        held = self.pose.compose(Rigid(turns, between.points(own.translation)))
        share = torch.zeros_like(path.translation[:, 0])
        for gap in runs((~known).cpu().numpy()):
            apart = (held.translation - path.translation)[gap].square().sum(-1).mean()
            seen = apart / (apart + self.error**2).clip(1e-12)
            first, last = self.carries(own.translation, beside(gap, known))
            share[gap] = seen * first.lerp(last, between.fraction[gap].to(first))
        return held, share

    def carries(
        self, own: Float[Tensor, "T 3"], ends: list[Bool[Tensor, " T"]]
    ) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
        """Whether the palm carries an object at both ends of a gap, 0 to 1: it moves with it beside
        them, and has it in the same place after the gap as before. `own` are places in the palm."""
        usual = [own[some].median(0).values for some in ends]
        kept = share_between((usual[-1] - usual[0]).norm(), KEPT, CHANGED)
        both = self.moves(own, torch.stack(ends).any(0))
        first, last = (kept * self.moves(own, ends[end]).maximum(both) for end in (0, -1))
        return first, last

    def moves(self, own: Float[Tensor, "T 3"], chosen: Bool[Tensor, " T"]) -> Float[Tensor, ""]:
        """Whether the palm moves an object in the chosen frames, 0 to 1; 0 if it rests."""
        over, moved = scatters(self.pose.at(chosen), own[chosen])
        return torch.where(moved < REST_DEVIATION**2, 0.0, carried(over, moved))


def beside(gap: slice, known: Bool[Tensor, " T"]) -> list[Bool[Tensor, " T"]]:
    """The known frames before a gap and after it, or on the one side that there is."""
    numbers = torch.arange(len(known), device=known.device)
    ends = [end for end in (gap.start - 1, gap.stop) if 0 <= end < len(known)]
    return [known & ((numbers - end).abs() <= COMPARED_FRAMES) for end in ends]
