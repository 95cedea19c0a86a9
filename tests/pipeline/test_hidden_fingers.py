"""Fingers of low confidence on a palm that is seen."""

from dataclasses import replace

import pytest
import torch

import geneoh
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.sequence.keypoints import PALM

HIDDEN = slice(11, 31)


@pytest.mark.parametrize("value", [0.0, 0.3])
def test_hidden_fingers_do_not_displace_a_palm_that_is_seen(value):
    clean = draw_clip("mug", 0, 60)
    (hand,) = clean.hands
    confidence = torch.ones(clean.frames, 21)
    fingers = [point for point in range(21) if point not in PALM]
    confidence[HIDDEN][:, fingers] = value
    hidden = replace(clean, hands=(replace(hand, confidence=confidence),))
    found = geneoh.denoise(hidden, preset="fast", without=("mesh",)).sequence.hands[0].joints
    assert found is not None
    assert hand.joints is not None
    apart = (found - hand.joints).norm(dim=-1)
    assert float(apart[:, list(PALM)].max()) < 0.01
