"""Frames in which a hand was not observed, filled from the frames around them."""

import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.sequence.interpolation import FrameInterpolation
from geneoh.sequence.sequence import HandTrack


def fill_gaps(hand: HandTrack) -> HandTrack:
    """The same track with finite numbers in every frame; `valid` still says which were observed.

    Points run on a straight line across a gap and rotations on the shorter arc; before the first
    observed frame and after the last one the hand is held still. Observed frames are not touched.
    The hand must be observed in at least one frame.
    """
    if bool(hand.valid.all()):
        return hand
    return observed_around(hand.valid).hand(hand, hand.valid)


def observed_around(valid: Bool[Tensor, " T"]) -> FrameInterpolation:
    """For each frame the nearest observed frames before and after it, and its place between."""
    frames = torch.arange(len(valid), device=valid.device)
    observed = frames[valid]
    assert len(observed), "a hand that was never observed cannot be filled"
    after = torch.searchsorted(observed, frames).clamp(max=len(observed) - 1)
    before = (torch.searchsorted(observed, frames, right=True) - 1).clamp(min=0)
    start, end = observed[before], observed[after]
    # Before the first and after the last observation both neighbours are the same frame.
    fraction = torch.where(end > start, (frames - start) / (end - start), 0.0)
    return FrameInterpolation(start, end, fraction)
