"""Frames in which a hand or an object was not observed, filled from the frames around them."""

from dataclasses import replace

import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.sequence.interpolation import FrameInterpolation
from geneoh.sequence.sequence import HandTrack, ObjectTrack


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


def fill_object(motion: ObjectTrack, observed: Bool[Tensor, "T Q"] | None = None) -> ObjectTrack:
    """An object's track with finite poses in every frame; its `valid` says which were observed.

    Poses that are NaN were not observed. They run between the observed ones on straight
    lines and shorter arcs; a part that was never observed stands still at the origin.

    Args:
        motion: the track.
        observed: frames and parts that count as observed, besides; all by default.
    """
    lost = motion.rotation.isnan().any(-1).any(-1) | motion.translation.isnan().any(-1)
    seen = ~lost if observed is None else ~lost & observed
    if bool(seen.all()):
        return motion
    rotation = torch.eye(3).to(motion.rotation).expand_as(motion.rotation).clone()
    translation = torch.zeros_like(motion.translation)
    for part in torch.nonzero(seen.any(0))[:, 0].tolist():
        between = observed_around(seen[:, part])
        rotation[:, part] = between.rotations(motion.rotation[:, part : part + 1])[:, 0]
        translation[:, part] = between.points(motion.translation[:, part])
    return replace(motion, rotation=rotation, translation=translation, valid=seen)
