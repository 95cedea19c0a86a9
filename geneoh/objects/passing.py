"""Poses of an object in a gap in which it changes what it moves with.

An object that is taken, put down, or passed from hand to hand changes where its way from before the
gap is nearest to its way after it. If it rests before the gap, and after it elsewhere, a palm that
made just this motion in the gap has carried it.
"""

from dataclasses import dataclass
from itertools import permutations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import interpolate_rotations
from geneoh.objects.evidence import share_between
from geneoh.objects.movers import Mover, Resting, beside, better, pose_distance

MEETING, MISSING = 0.035, 0.07
"""Least distance of an object that moves as before a gap from one that moves as after it, metres:
up to the first bound it changed from one to the other, from the second on something else happened.
Of made and scanned clips with noise, 95 in 100 have at most 0.035."""
CARRIED_SHARE, OTHER_SHARE = 0.1, 0.25
"""Difference between the motion of an object from rest to rest and the best one of a palm, as a
share of the distance: up to the first bound the palm made it, from the second on something else
did. Made and scanned clips with noise have at most 0.08. The recording, whose object is taken,
turned in the hand and put back 6 cm away, has 0.67."""
LEAST_MOTION = 0.05  # distance from which on an object was moved from rest to rest, metres
REACH = 0.12  # distance of a palm from an object that it takes, beyond twice its radius, metres
CHANGE_FRAMES = 6.0  # frames in which an object changes from one way to the other
LONGEST = 300  # frames of a gap in which a motion from rest to rest is looked for


@dataclass(frozen=True)
class Gap:
    """Frames without a pose between frames with one."""

    path: Rigid
    """Poses of the object in all T frames, with its centre as origin, metres."""
    frames: slice
    known: Bool[Tensor, " T"]
    size: float  # radius of the object, metres

    @property
    def first(self) -> Rigid:
        """The last pose before the gap."""
        return self.path.at(slice(self.frames.start - 1, self.frames.start))

    @property
    def last(self) -> Rigid:
        """The first pose after the gap."""
        return self.path.at(slice(self.frames.stop, self.frames.stop + 1))

    def most_probable_change(self, palms: list[Mover]) -> tuple[Rigid, Float[Tensor, ""]]:
        """The most sure way of the object in the gap, and how sure it is, 0 to 1."""
        pairs = permutations((Resting.like(self.path), *palms), 2)
        ways = [self.passed(*pair) for pair in pairs]
        ways += [self.taken_and_put_down(palm) for palm in palms]
        return max(ways, key=lambda found: float(found[1]))

    def moves(self, mover: Mover) -> list[Float[Tensor, ""]]:
        """Whether something moves the object before the gap and after it, 0 to 1."""
        own = mover.holds(self.path).translation
        return [mover.moves(own, side) for side in beside(self.frames, self.known)]

    def passed(self, one: Mover, other: Mover) -> tuple[Rigid, Float[Tensor, ""]]:
        """The way of an object that goes from one mover to the other, and how sure that is, 0 to
        1."""
        before, after = self._with(one, self.first, 0), self._with(other, self.last, -1)
        apart = pose_distance(before, after, self.size)
        nearest = int(apart.argmin())
        way = changed(before, after, nearest)
        sure = share_between(apart[nearest], MEETING, MISSING)
        sure = sure * self.moves(one)[0] * self.moves(other)[1]
        return way, sure * self._better(way, max(one.error, other.error))

    def taken_and_put_down(self, palm: Mover) -> tuple[Rigid, Float[Tensor, ""]]:
        """The way of an object that rests until the palm takes it, and where the palm puts it down;
        and how sure that is, 0 to 1."""
        travel = float(pose_distance(self.first, self.last, self.size))
        rests = self.moves(Resting.like(self.path))
        count = self.frames.stop - self.frames.start
        if travel < LEAST_MOTION or min(map(float, rests)) == 0 or count > LONGEST:
            return self.first, torch.zeros_like(self.path.translation[0, 0])
        carrying = palm.pose.at(self.frames)
        own = carrying.inverse().compose(self.first)  # the resting object in the palm of each frame
        frames = torch.arange(count, device=own.translation.device)
        rows = Rigid(carrying.rotation[:, None], carrying.translation[:, None])
        apart = pose_distance(
            rows.compose(own), self.last, self.size
        )  # [put down in a frame, taken in one]
        apart = apart.masked_fill(frames[:, None] <= frames, torch.inf)
        far = own.translation.norm(dim=-1) > REACH + 2 * self.size
        apart = apart.masked_fill(far, torch.inf)
        put, taken = divmod(int(apart.argmin()), count)
        way = carrying.compose(own.at(slice(taken, taken + 1)))
        way = changed(changed(self.first, way, taken), self.last, put)
        left = apart[put, taken]
        sure = share_between(left / travel, CARRIED_SHARE, OTHER_SHARE)
        sure = sure.minimum(share_between(left, MEETING, MISSING))
        return way, sure * self._better(way, palm.error)

    def _with(self, mover: Mover, pose: Rigid, end: int) -> Rigid:
        """The way of an object that a mover carries in the gap as in a pose at its first or last
        end, 0 or -1."""
        at = self.frames.start - 1 if end == 0 else self.frames.stop
        own = mover.pose.at(slice(at, at + 1)).inverse().compose(pose)
        return mover.pose.at(self.frames).compose(own)

    def _better(self, way: Rigid, error: float) -> Float[Tensor, ""]:
        steps = torch.arange(1, len(way.translation) + 1).to(way.translation)
        share = steps[:, None] / (len(way.translation) + 1)
        line = self.first.translation.lerp(self.last.translation, share)
        return better(way.translation - line, error)


def changed(before: Rigid, after: Rigid, frame: int) -> Rigid:
    """The first of two ways up to a frame, then the other one, with an even change between them."""
    count = max(len(before.translation), len(after.translation))
    frames = torch.arange(count).to(before.translation)
    passed = ((frames - frame) / CHANGE_FRAMES + 0.5).clamp(0, 1)
    places = before.translation.lerp(after.translation, passed[:, None])
    return Rigid(interpolate_rotations(before.rotation, after.rotation, passed), places)
