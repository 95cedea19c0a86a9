"""Two hands for the tests of this folder."""

from dataclasses import replace

import pytest
import torch

from geneoh.sequence.sequence import HandTrack, Sequence


@pytest.fixture(scope="session")
def pair(clean) -> Sequence:
    """The recording's left hand, and its mirror image 25 cm beside it, backward in time; both as
    keypoints alone."""
    left = clean.hands[0]
    right = left.mirrored()
    beside = left.joints.mean((0, 1)) - right.joints.mean((0, 1)) + torch.tensor([0.25, 0, 0])
    hands = (
        HandTrack("left", left.valid, joints=left.joints),
        HandTrack("right", right.valid, joints=right.joints.flip(0) + beside),
    )
    return replace(clean, hands=hands)
