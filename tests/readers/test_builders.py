"""Sequences out of a source's numbers: the frames of a stretch."""

from dataclasses import fields

import numpy as np
import torch

from geneoh.readers.base import CrossChecks, Recording
from geneoh.readers.builders import stretch_of
from geneoh.readers.dataset_reader import split
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

FRAMES = 12


def whole() -> Sequence:
    """Two hands with every field there is; the left one is observed in the first frame alone."""
    every = torch.arange(float(FRAMES))
    right = HandTrack(
        "right",
        torch.ones(FRAMES, dtype=torch.bool),
        joints=every[:, None, None].expand(-1, 21, 3),
        pose=every[:, None, None].expand(-1, 16, 3),
        wrist=every[:, None].expand(-1, 3),
        betas=torch.zeros(10),
        hand_model="embedded",
        confidence=every[:, None].expand(-1, 21),
        joint_spread=every[:, None].expand(-1, 21),
        camera_ray=every[:, None].expand(-1, 3),
    )
    left = HandTrack("left", every == 0, joints=torch.zeros(FRAMES, 21, 3))
    motion = ObjectTrack((), torch.eye(3).repeat(FRAMES, 1, 1, 1), torch.zeros(FRAMES, 1, 3))
    return Sequence((right, left), motion, 30.0, "whole")


def test_every_field_of_a_part_has_the_frames_of_the_part():
    part = stretch_of(whole(), slice(3, 8))
    (hand,) = part.hands
    assert part.frames == hand.frames == 5
    assert part.source == "whole, frames 3 to 7"
    still = {"side", "betas", "hand_model"}
    for field in (field.name for field in fields(hand) if field.name not in still):
        assert len(getattr(hand, field)) == 5, field
    for field in ("joints", "pose", "wrist", "confidence", "joint_spread"):
        assert getattr(hand, field).flatten(1)[:, 0].tolist() == [3, 4, 5, 6, 7], field


def test_cross_checks_are_cut_with_the_sequence():
    stored = np.arange(FRAMES * 63.0).reshape(FRAMES, 21, 3)
    points = stored[:, :4]
    checks = CrossChecks(
        joints={"right": stored},
        rim={"right": stored[:, 0]},
        tolerance=0.01,
        object_points=(points, points + 1),
    )
    known = np.ones(FRAMES, dtype=bool)
    known[5] = False
    first, second = split(Recording("clip", whole(), (), checks), known, None)
    assert (first.name, second.name) == ("clip_00000", "clip_00006")
    for part, span in ((first, slice(0, 5)), (second, slice(6, 12))):
        found = part.cross_checks
        assert np.array_equal(found.joints["right"], stored[span])
        assert np.array_equal(found.rim["right"], stored[span, 0])
        assert np.array_equal(found.object_points[1], points[span] + 1)
        assert found.tolerance == 0.01
