"""Detect frames in which the track of one hand follows the other hand, and make them missing.

A tracker of two hands that loses one of them often finds the other hand twice. The track of the
lost hand then leaps to the other hand, moves with it, and leaps back.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import numbered
from geneoh.readers.checks.hands import palm_length
from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.keypoints import PALM, palm_axes
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.sequence.windows import runs

NEAR, SAME = 0.7, 0.2
"""Limits of the mean distance of like palm keypoints of two hands, in palm lengths: `NEAR` in each
frame of a run, which allows for noise, and `SAME` for the differences averaged over the run, which
have less. Pressed palms are about 0.3 apart: wrist and knuckles lie in the middle of a hand."""
LEAP, RATIO, COMPARED = 1.0, 3.0, 5
"""Least length of a leap in palm lengths, its least ratio to the steps before or after it and to
the step of the other hand, and how many steps are compared. Hands that clap or meet do not leap:
they approach each other over several frames."""


def without_following(sequence: Sequence) -> tuple[Sequence, tuple[str, ...]]:
    """The sequence with such frames marked as missing, and sentences for the user."""
    if len(sequence.hands) != 2 or not all(bool(h.observed.any()) for h in sequence.hands):
        return sequence, ()
    one, other = sequence.hands
    found = (one, following(one, other)), (other, following(other, one))
    notes = tuple(
        f"the {hand.side} hand follows the other hand in {numbered(int(wrong.sum()), 'frame')}, "
        "as where a tracker finds one hand twice: taken as missing"
        for hand, wrong in found
        if bool(wrong.any())
    )
    hands = tuple(replace(hand, valid=hand.valid & ~wrong) for hand, wrong in found)
    return (replace(sequence, hands=hands) if notes else sequence), notes


def following(hand: HandTrack, other: HandTrack) -> Bool[Tensor, " T"]:
    """Frames in which a hand is in the place of the other one, beside leaps of this hand; none if
    these are most of its frames, since one hand under two names does not tell which it is."""
    pair = _Pair.of(hand, other)
    found = torch.zeros_like(hand.valid)
    for run in runs(pair.near.cpu().numpy()):
        edges = list(pair.edges(run))
        if edges and all(pair.leaps(*edge) for edge in edges) and pair.is_same(run):
            found[run] = True
    return found & (2 * found.sum() <= pair.seen.sum())


@dataclass(frozen=True)
class _Pair:
    """Palms of a hand and of the other hand over T frames."""

    apart: Float[Tensor, "T 5 3"]
    """Differences of like palm keypoints in palm lengths, along the axes of the other palm."""
    steps: Float[Tensor, "2 N"]  # of the middle of each palm to the next frame, palm lengths
    seen: Bool[Tensor, " T"]  # whether both hands are observed

    @classmethod
    def of(cls, hand: HandTrack, other: HandTrack) -> "_Pair":
        """The pair of two tracks that are observed in at least one frame each."""
        joints = torch.stack([filled_keypoints(hand), filled_keypoints(other)])
        seen = hand.observed & other.observed
        palms = joints[:, :, list(PALM)] / palm_length(joints.flatten(0, 1))
        axes = palm_axes(joints[1][:, None])
        steps = palms.mean(2).diff(dim=1).norm(dim=-1)
        return cls((palms[0] - palms[1]) @ axes, steps, seen)

    @property
    def near(self) -> Bool[Tensor, " T"]:
        """Frames in which the two palms nearly coincide."""
        return self.seen & (self.apart.norm(dim=-1).mean(-1) < NEAR)

    def is_same(self, run: slice) -> bool:
        """Whether the palms coincide in the mean over a run of frames."""
        return bool(self.apart[run].mean(0).norm(dim=-1).mean() < SAME)

    def edges(self, run: slice) -> Iterator[tuple[int, slice]]:
        """The steps into and out of a run, each with the steps on the outer side of it; none where
        a hand is not observed beside the run."""
        before, after = run.start - 1, run.stop - 1
        if before >= 0 and bool(self.seen[before]):
            yield before, slice(max(before - COMPARED, 0), before)
        if after < len(self.seen) - 1 and bool(self.seen[after + 1]):
            yield after, slice(after + 1, after + 1 + COMPARED)

    def leaps(self, step: int, around: slice) -> bool:
        """Whether a step of the hand is far longer than those around it, and the other hand's."""
        apart = self.seen & ~self.near
        usual = self.steps[0] * (apart[1:] & apart[:-1])  # not the leaps of another run
        largest = torch.cat([usual[around], self.steps[1, step : step + 1]]).max()
        return bool(self.steps[0, step] > max(LEAP, RATIO * float(largest)))
