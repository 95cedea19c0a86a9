"""One frame of a stream, as it is known and clean, and what lies between two of them."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import FRAMES, concatenated
from geneoh.sequence.gaps import FrameInterpolation, blendable
from geneoh.sequence.sequence import HandTrack, ObjectTrack

DIGITS = 9  # decimals kept of places between frames, so that frames which coincide are found


@dataclass(frozen=True)
class CleanHand:
    """One frame of a clean hand."""

    track: HandTrack
    contact: Float[Tensor, " 5"] | None
    """Probability that each finger touches the object, from the thumb; None without an object."""


def lost_like(hand: HandTrack) -> HandTrack:
    """One frame of a track in which its hand was lost."""
    lost = hand[:1].map(lambda values: torch.full_like(values, torch.nan), FRAMES)
    return replace(lost, valid=torch.zeros_like(lost.valid))


@dataclass(frozen=True)
class Observed:
    """What is known of one frame: a hand, or None where it was lost, and the object's motion."""

    hand: HandTrack | None
    object: ObjectTrack

    def completed(self, earlier: "Observed | None") -> "Observed":
        """With what an earlier frame has and this one lacks."""
        if earlier is None:
            return self
        hand = earlier.hand if self.hand is None else self.hand
        return Observed(hand, completed(self.object, earlier.object))


def completed(motion: ObjectTrack, other: ObjectTrack) -> ObjectTrack:
    """An object's track with the poses of another one where it has none."""
    lost = motion.translation.isnan().any(-1, keepdim=True)
    rotation = torch.where(lost[..., None], other.rotation, motion.rotation)
    translation = torch.where(lost, other.translation, motion.translation)
    return replace(motion, rotation=rotation, translation=translation)


def between(before: Observed, after: Observed, fraction: float) -> Observed:
    """What lies between two neighbouring frames; what one of them lacks is that of the nearer."""
    fraction = round(fraction, DIGITS)
    motion = (before if fraction < 0.5 else after).object
    if fraction not in (0.0, 1.0):
        both, at = concatenated([before.object, after.object]), instant(fraction)
        turn, place = at.rotations(both.rotation), at.points(both.translation)
        motion = completed(replace(motion, rotation=turn, translation=place), motion)
    return Observed(hand_between(before.hand, after.hand, fraction), motion)


def hand_between(
    before: HandTrack | None, after: HandTrack | None, fraction: float
) -> HandTrack | None:
    """The hand between two neighbouring frames; where one has none, what the nearer has."""
    fraction = round(fraction, DIGITS)
    near = before if fraction < 0.5 else after
    if before is None or after is None or near is None or fraction in (0.0, 1.0):
        return near
    both = blendable(concatenated([before, after]))
    return instant(fraction).hand(both, both.valid[:1] if near is before else both.valid[1:])


def clean_between(
    before: CleanHand | None, after: CleanHand | None, fraction: float
) -> tuple[HandTrack | None, Float[Tensor, " 5"] | None]:
    """The clean hand between two neighbouring frames, and which of its fingers touch."""
    hand = hand_between(before and before.track, after and after.track, fraction)
    known = [each.contact for each in (before, after) if each and each.contact is not None]
    return hand, known[0].lerp(known[-1], fraction) if known and hand is not None else None


def instant(fraction: float) -> FrameInterpolation:
    """One instant between the first and the second of two frames."""
    place = torch.tensor([fraction], dtype=torch.float64)
    return FrameInterpolation(torch.tensor([0]), torch.tensor([1]), place)
