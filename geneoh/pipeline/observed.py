"""Frames of a stream, observed and clean, and interpolation between two of them."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import FRAMES, concatenated
from geneoh.geometry.rigid import Rigid
from geneoh.sequence.gaps import FrameInterpolation, blendable
from geneoh.sequence.placing import placed_hand, placed_object
from geneoh.sequence.sequence import HandTrack, ObjectTrack

DIGITS = 9  # decimals that times in frames are rounded to, so that coinciding frames are detected


@dataclass(frozen=True)
class CleanHand:
    """One frame of a clean hand."""

    track: HandTrack
    contact: Float[Tensor, " 5"] | None
    """Contact probability of each finger, from the thumb; None without an object."""


def lost_like(hand: HandTrack) -> HandTrack:
    """One invalid frame with the same fields as a track."""
    lost = hand[:1].map(lambda values: torch.full_like(values, torch.nan), FRAMES)
    return replace(lost, valid=torch.zeros_like(lost.valid))


@dataclass(frozen=True)
class Observed:
    """One observed frame: a hand, or None if it was lost, and the object's pose, NaN if lost."""

    hand: HandTrack | None
    object: ObjectTrack

    def placed(self, pose: Rigid) -> "Observed":
        """This frame after a rigid motion."""
        hand = None if self.hand is None else placed_hand(self.hand, pose)
        return Observed(hand, placed_object(self.object, pose))

    def completed(self, earlier: "Observed | None") -> "Observed":
        """This frame, with its missing hand or object poses taken from an earlier one."""
        if earlier is None:
            return self
        hand = earlier.hand if self.hand is None else self.hand
        return Observed(hand, completed(self.object, earlier.object))


def completed(motion: ObjectTrack, other: ObjectTrack) -> ObjectTrack:
    """An object's track with its missing poses taken from another track."""
    lost = motion.translation.isnan().any(-1, keepdim=True)
    rotation = torch.where(lost[..., None], other.rotation, motion.rotation)
    translation = torch.where(lost, other.translation, motion.translation)
    return replace(motion, rotation=rotation, translation=translation)


def between(before: Observed, after: Observed, fraction: float) -> Observed:
    """Interpolate between two neighbouring frames; where one lacks data, take the nearer frame."""
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
    """Interpolate the hand between two frames; if one has none, take the nearer frame's or None."""
    fraction = round(fraction, DIGITS)
    near = before if fraction < 0.5 else after
    if before is None or after is None or near is None or fraction in (0.0, 1.0):
        return near
    both = blendable(concatenated([before, after]))
    return instant(fraction).hand(both, both.valid[:1] if near is before else both.valid[1:])


def clean_between(
    before: CleanHand | None, after: CleanHand | None, fraction: float
) -> tuple[HandTrack | None, Float[Tensor, " 5"] | None]:
    """Interpolate the clean hand and its contact probabilities between two neighbouring frames."""
    hand = hand_between(before and before.track, after and after.track, fraction)
    known = [each.contact for each in (before, after) if each and each.contact is not None]
    return hand, known[0].lerp(known[-1], fraction) if known and hand is not None else None


def instant(fraction: float) -> FrameInterpolation:
    """Interpolation weights at one instant between the first and the second of two frames."""
    place = torch.tensor([fraction], dtype=torch.float64)
    return FrameInterpolation(torch.tensor([0]), torch.tensor([1]), place)
