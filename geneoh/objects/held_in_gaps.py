"""Poses of an object in gaps of its track: one that a hand moves is moved by the palm there, too.

Trackers lose an object most often while a hand covers and moves it. On the straight line from the
last pose before a gap to the first one after it, the object is centimetres off, and in its frame
the hand seems to leave it and to come back, in all windows of the stages that see the gap. An
object that is taken, put down, or passed from hand to hand in a gap changes what it moves with
where both ways are nearest to each other.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import permutations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import interpolate_rotations, matrix_to_axis_angle
from geneoh.objects.carrying import COMPARED_FRAMES, REST_DEVIATION, carried, scatters
from geneoh.objects.evidence import radius, share_between
from geneoh.objects.palms import RigidMotion
from geneoh.sequence.gaps import observed_around
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

KEPT, CHANGED = 0.035, 0.05
"""Distance between the usual places of the object in the palm before and after a gap, metres: up to
the first bound the hand kept it, from the second on it was taken or put down in the gap. Of made
and scanned clips with noise, held objects have at most 0.032 and others 0.065 or more."""
MEETING, MISSING = 0.035, 0.07
"""Least distance of an object that moves as before a gap from one that moves as after it, metres:
up to the first bound it was taken, put down or passed there, from the second on something else
happened. Of made and scanned clips with noise, 95 in 100 have at most 0.035."""
CHANGE_FRAMES = 6.0  # frames in which an object changes from one way to the other
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
        path = carried_path(path, known, calm, radius(motion.meshes[part]))
        turns = path.rotation.to(rotation)
        rotation[~known, part] = turns[~known]
        places = path.translation.to(rotation) - turns @ center
        translation[~known, part] = places[~known]
    return replace(motion, rotation=rotation, translation=translation)


def carried_path(
    path: Rigid, known: Bool[Tensor, " T"], palms: "list[Carrying]", size: float
) -> Rigid:
    """A path with gaps in which the object is carried by the palm that moves with it most, or goes
    from one to another or to rest. `size` is the radius of the object, metres."""
    every = [palm.through_gaps(path, known) for palm in palms]
    pairs = permutations((Resting.like(path), *palms), 2)
    every += [changing_in_gaps(path, known, pair, size) for pair in pairs]
    share, best = torch.stack([share for _, share in every]).max(0)
    frames = torch.arange(len(share), device=share.device)
    turns, places = (
        torch.stack([getattr(held, name) for held, _ in every])[best, frames]
        for name in ("rotation", "translation")
    )
    turned = interpolate_rotations(path.rotation, turns, share)
    return Rigid(turned, path.translation.lerp(places, share[:, None]))


def changing_in_gaps(
    path: Rigid, known: Bool[Tensor, " T"], movers: "tuple[Carrying, Carrying]", size: float
) -> tuple[Rigid, Float[Tensor, " T"]]:
    """The path with gaps in which the object goes from one mover to the other; and the extent, 0 to
    1, to which it does so there."""
    turns, places = path.rotation.clone(), path.translation.clone()
    share = torch.zeros_like(places[:, 0])
    for gap in runs((~known).cpu().numpy()):
        if gap.start == 0 or gap.stop == len(known):
            continue
        (one, other), sides = movers, beside(gap, known)
        before, first = one.continued(path, gap, sides[0], gap.start - 1)
        after, last = other.continued(path, gap, sides[1], gap.stop)
        apart = distance(before, after, size)
        nearest = int(apart.argmin())
        frames = torch.arange(len(apart)).to(places) - nearest
        passed = (frames / CHANGE_FRAMES + 0.5).clamp(0, 1)
        turns[gap] = interpolate_rotations(before.rotation, after.rotation, passed)
        places[gap] = before.translation.lerp(after.translation, passed[:, None])
        met = share_between(apart[nearest], MEETING, MISSING)
        seen = better((places - path.translation)[gap], max(one.error, other.error))
        share[gap] = met * first * last * seen
    return Rigid(turns, places), share


def better(off: Float[Tensor, "N 3"], error: float) -> Float[Tensor, ""]:
    """Share, 0 to 1, of a path that is `off` the straight line where its own error is expected to
    have this size; metres."""
    apart = off.square().sum(-1).mean()
    return apart / (apart + error**2).clip(1e-12)


def distance(one: Rigid, other: Rigid, size: float) -> Float[Tensor, " N"]:
    """Distance between two poses of an object of a radius in metres, at its surface, metres."""
    turned = matrix_to_axis_angle(one.rotation.mT @ other.rotation).norm(dim=-1)
    return (one.translation - other.translation).norm(dim=-1) + size * turned


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
            seen = better((held.translation - path.translation)[gap], self.error)
            first, last = self.carries(own.translation, beside(gap, known))
            share[gap] = seen * first.lerp(last, between.fraction[gap].to(first))
        return held, share

    def continued(
        self, path: Rigid, gap: slice, side: Bool[Tensor, " T"], end: int
    ) -> tuple[Rigid, Float[Tensor, ""]]:
        """The path in a gap if the palm carries the object there as in the frame `end` beside it,
        and whether it moves it in the frames `side`, 0 to 1."""
        own = self.pose.inverse().compose(path)
        way = self.pose.at(gap).compose(own.at(slice(end, end + 1)))
        return way, self.moves(own.translation, side)

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


class Resting(Carrying):
    """The world, in which an object rests that no palm carries."""

    @classmethod
    def like(cls, path: Rigid) -> "Resting":
        """The world in the frames of a path."""
        still = torch.eye(3).to(path.rotation).expand_as(path.rotation)
        return cls(Rigid(still, torch.zeros_like(path.translation)), 0.0)

    def moves(self, own: Float[Tensor, "T 3"], chosen: Bool[Tensor, " T"]) -> Float[Tensor, ""]:
        """Whether an object rests in the chosen frames, 0 or 1."""
        moved, _ = scatters(self.pose.at(chosen), own[chosen])
        return (moved < REST_DEVIATION**2).to(own)


def beside(gap: slice, known: Bool[Tensor, " T"]) -> list[Bool[Tensor, " T"]]:
    """The known frames before a gap and after it, or on the one side that there is."""
    numbers = torch.arange(len(known), device=known.device)
    ends = [end for end in (gap.start - 1, gap.stop) if 0 <= end < len(known)]
    return [known & ((numbers - end).abs() <= COMPARED_FRAMES) for end in ends]
