"""Undo a low-pass filter that was applied to only one of the hand's and the object's track.

The smoother of the two tracks was filtered (`geneoh.objects.relative_filter`). A pure delay does
not show which of them is late: then the object's poses get a lower reliability instead.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle, nearest_rotations
from geneoh.objects.evidence import placed_vertices
from geneoh.objects.examination import ObjectExamination
from geneoh.objects.palms import RigidMotion, palm_of
from geneoh.objects.relative_filter import Comparison, LowPass, compared
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.resample import hand_earlier
from geneoh.sequence.sequence import HandTrack, ObjectTrack

FILTER_ROUNDS = 3
"""Iterations: the remaining filter is estimated again in the sharpened track."""
LONG_DELAY = 0.1
"""Delay in seconds above which `geneoh.objects.relative_filter` may mistake it for a filter."""
REMAINING_SHARE, AVERAGE_SECONDS = 0.4, 0.1
"""Remaining error of the sharpened track as a share of the correction, 0.3 to 0.5 for Gaussian
filters of three and six frames at 30 a second and less for causal filters; and standard deviation
in seconds of the Gaussian over which it is averaged."""


@dataclass(frozen=True)
class Sharpened:
    """Hands and object after filters were undone."""

    hands: tuple[HandTrack, ...]
    object: ObjectTrack
    error: Float[Tensor, "T Q"]
    """Expected remaining error of each pose of the object, metres."""
    notes: tuple[str, ...]
    """Sentences for the user."""


def sharpened(
    hands: tuple[HandTrack, ...],
    palms: tuple[RigidMotion, ...],
    delays: tuple[int, ...],
    motion: ObjectTrack,
    examined: ObjectExamination,
    fps: float,
) -> Sharpened:
    """Undo filters that were applied to only one of hand and object.

    Parts with a noisy track are neither changed nor used, because cleaning has smoothed them.
    `motion` is the track after cleaning (`geneoh.objects.cleaning`), and `palms` are the palms of
    `hands`. `delays` are the estimated delays of the hands relative to the object, frames; if a
    long delay explains the whole difference, no filter is undone for that hand.
    """
    parts = [part for part in motion.seen_parts if not bool(examined.is_noisy[part])]
    notes, sharp, moved = list[str](), list[HandTrack](), list[RigidMotion]()
    late = list[tuple[RigidMotion, LowPass]]()
    for hand, palm, delay in zip(hands, palms, delays, strict=True):
        if abs(delay) > LONG_DELAY * fps and only_late(hand, delay, motion, parts, fps):
            sharp.append(hand)
            late.append((palm, LowPass(-delay / fps, 0.0)))
            continue
        other, palm, found = sharpened_hand(hand, palm, motion, parts, fps)
        sharp.append(other)
        moved.append(palm)
        notes += [] if found is None else [hand_note(hand, found)]
    error = torch.zeros_like(examined.confidence)
    for part in parts:
        known = (delay for palm, delay in late if compared(motion, part, palm, fps))
        motion, left, words = sharpened_part(motion, part, moved, fps, next(known, None))
        error[:, part] = left.to(error)
        notes += words
    return Sharpened(tuple(sharp), motion, error, tuple(notes))


def only_late(
    hand: HandTrack, delay: int, motion: ObjectTrack, parts: list[int], fps: float
) -> bool:
    """Whether no filter is found between hand and object after removal of the hand's `delay`."""
    palm = palm_of(hand_earlier(hand, delay))
    every = [found for part in parts if (found := compared(motion, part, palm, fps))]
    return all(found.filter_of_palm is None is found.filter_of_part for found in every)


def sharpened_hand(
    hand: HandTrack, palm: RigidMotion, motion: ObjectTrack, parts: list[int], fps: float
) -> tuple[HandTrack, RigidMotion, LowPass | None]:
    """A hand and its palm with their filter undone, and this filter; None if there is none."""
    whole = None
    for _ in range(FILTER_ROUNDS):
        every = filter(None, (compared(motion, part, palm, fps) for part in parts))
        best = max(every, key=lambda c: c.of_palm.explained, default=None)
        if best is None or (found := best.filter_of_palm) is None:
            break
        hand = without_filter_of_hand(hand, found, fps)
        palm, whole = palm_of(hand), found if whole is None else whole + found
    return hand, palm, whole


def sharpened_part(
    motion: ObjectTrack,
    part: int,
    palms: Iterable[RigidMotion],
    fps: float,
    late: LowPass | None,
) -> tuple[ObjectTrack, Float[Tensor, " T"], list[str]]:
    """The track with the filter of one part undone, the expected remaining error of its poses,
    metres, and sentences for the user. `late` is the part's delay relative to a hand, if known. In
    case of such a delay the track is unchanged, and the error is the displacement by the delay."""

    def best(motion: ObjectTrack) -> Comparison | None:
        every = filter(None, (compared(motion, part, palm, fps) for palm in palms))
        return max(every, key=lambda c: c.of_part.explained, default=None)

    before, name = motion, motion.name_of(part)
    whole, seen = LowPass(0.0, 0.0), best(motion)
    late = late or (seen and seen.delay)
    if late is not None:
        other = without_filter_of_part(motion, part, late, fps)
        return motion, moved_by(motion, other, part, fps), [delay_note(name, late, fps)]
    for _ in range(FILTER_ROUNDS):
        if seen is None or (found := seen.filter_of_part) is None:
            break
        motion, whole = without_filter_of_part(motion, part, found, fps), whole + found
        seen = best(motion)
    left = REMAINING_SHARE * moved_by(before, motion, part, fps)
    return motion, left, [] if motion is before else [part_note(name, whole)]


def without_filter_of_part(
    motion: ObjectTrack, part: int, found: LowPass, fps: float
) -> ObjectTrack:
    """The track with a filter of one part undone."""
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    rotation[:, part] = nearest_rotations(found.undone(rotation[:, part], fps))
    translation[:, part] = found.undone(translation[:, part], fps)
    return replace(motion, rotation=rotation, translation=translation)


def without_filter_of_hand(hand: HandTrack, found: LowPass, fps: float) -> HandTrack:
    """The hand with a filter undone, after its gaps were filled."""
    undone = partial(found.undone, fps=fps)

    def turned(pose: Tensor) -> Tensor:
        return matrix_to_axis_angle(nearest_rotations(undone(axis_angle_to_matrix(pose))))

    sharp = fill_gaps(hand).changed(joints=undone, pose=turned, wrist=undone)
    return replace(hand, joints=sharp.joints, pose=sharp.pose, wrist=sharp.wrist)


def moved_by(one: ObjectTrack, other: ObjectTrack, part: int, fps: float) -> Float[Tensor, " T"]:
    """Root mean square distance of a part's vertices between two tracks, smoothed over time,
    metres."""
    apart = placed_vertices(other, part) - placed_vertices(one, part)
    squares = apart.square().sum(-1).mean(1).cpu().numpy()
    around = gaussian_filter1d(squares, AVERAGE_SECONDS * fps, mode="nearest")
    return torch.from_numpy(np.sqrt(around)).to(one.rotation)


def part_note(name: str, found: LowPass) -> str:
    """Sentence for the user about a part whose filter was undone."""
    return (
        f"the poses of {name} are smoother than the hand that moves it, {found}: the hand was "
        "cleaned against a sharpened track of it, which --refine-object writes; --trust-object "
        "keeps the given poses"
    )


def hand_note(hand: HandTrack, found: LowPass) -> str:
    """Sentence for the user about a hand whose filter was undone."""
    return (
        f"the {hand.side} hand is smoother than the object that it moves, {found}, which was "
        "undone before the cleaning; --trust-object keeps to the given hand"
    )


def delay_note(name: str, found: LowPass, fps: float) -> str:
    """Sentence for the user about a delay between hand and part, which either may have."""
    late = "late" if found.delay > 0 else "early"
    return (
        f"{name} comes {1000 * abs(found.delay):.0f} ms {late} beside the hand that moves it, and "
        "nothing tells which of them is right: where that is centimetres the hand was cleaned by "
        f"the prior of hand motion alone; if the object is, --hand-delay {-found.delay * fps:.0f} "
        "brings the hand to it"
    )
