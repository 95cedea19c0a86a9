"""Fingers of low confidence, or none, on a palm that is seen."""

from dataclasses import replace

import pytest
import torch

import geneoh
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.sequence.keypoints import PALM
from geneoh.sequence.sequence import HandTrack

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


@pytest.mark.parametrize("lost", [range(1, 9), range(9, 21)], ids=["thumb, index", "the others"])
def test_fingers_that_are_lost_for_a_while_keep_their_pose(clean, lost):
    (hand,) = clean.hands
    confidence = torch.ones(clean.frames, 21)
    confidence[50:75, list(lost)] = 0.0
    bare = HandTrack(hand.side, hand.valid, joints=hand.joints, confidence=confidence)
    found = geneoh.denoise(replace(clean, hands=(bare,)), preset="fast").sequence.hands[0].joints
    assert found is not None
    assert hand.joints is not None
    apart = (found - hand.joints)[50:75, list(lost)].norm(dim=-1)
    assert float(apart.mean()) < 0.012
