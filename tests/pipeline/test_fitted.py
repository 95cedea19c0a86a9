"""Two hands that were cleaned one by one are taken out of each other."""

from dataclasses import replace

import pytest
import torch

from geneoh.hand.library import load_hand
from geneoh.pipeline import denoise as pipeline
from geneoh.pipeline import fitted
from geneoh.pipeline.results import Denoised
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

FRAMES = 20


def facing(hand: HandTrack, overlap: float) -> Sequence:
    """A left hand and its mirror image, which share a slab of so many metres, without an object."""
    assert hand.side == "left"
    verts = load_hand("left").shaped(torch.zeros(10)).posed(hand.pose, hand.wrist).verts
    shift = torch.tensor([2 * float(verts[..., 0].min()) + overlap, 0.0, 0.0])
    other = hand.mirrored()
    other = replace(other, joints=other.joints + shift, wrist=other.wrist + shift)
    return Sequence((hand, other), ObjectTrack.resting((), len(hand.valid)), 30.0)


def cleaned(sequence: Sequence, monkeypatch, *, apart: bool = True) -> Denoised:
    with monkeypatch.context() as patch:
        if not apart:
            patch.setattr(fitted, "ROUNDS", 0)
        return pipeline.denoise(sequence, preset="fast")


@pytest.fixture
def hand(clean) -> HandTrack:
    return clean.hands[0][60 : 60 + FRAMES]


def test_hands_inside_each_other_are_taken_apart_and_stay_near_their_places(hand, monkeypatch):
    sequence = facing(hand, 0.016)
    one_by_one = cleaned(sequence, monkeypatch, apart=False)
    found = cleaned(sequence, monkeypatch)
    before, deep = one_by_one.hands_in_each_other
    assert min(before, deep) > 0.004
    assert found.hands_in_each_other[0] == before
    assert found.hands_in_each_other[1] < 0.5 * deep
    for side, result in found.hands.items():
        moved = (result.track.joints - one_by_one.hands[side].track.joints).norm(dim=-1)
        assert 0.0005 < float(moved.mean()) < 0.01


def test_hands_that_go_through_each_other_do_not_jump(clean, monkeypatch):
    """They were thrown to and fro, as the way out changed from frame to frame."""
    sequence = facing(clean.hands[0][[60] * 90], -0.03)
    one, other = sequence.hands
    way = torch.linspace(-3, 3, 90).square().neg().exp()[:, None] * torch.tensor([0.12, 0.0, 0.0])
    other = replace(other, wrist=other.wrist + way, joints=other.joints + way[:, None])
    sequence = replace(sequence, hands=(one, other))
    free = cleaned(sequence, monkeypatch, apart=False)
    found = cleaned(sequence, monkeypatch)
    assert min(found.hands_in_each_other) > 0.015
    for side, result in found.hands.items():
        alone, here = (
            float(each.track.joints.diff(n=2, dim=0).norm(dim=-1).max())
            for each in (free.hands[side], result)
        )
        assert here < alone + 0.006
        assert not torch.equal(result.track.joints, free.hands[side].track.joints)


def test_hands_that_are_beside_each_other_stay_as_they_are(hand, monkeypatch):
    sequence = facing(hand, -0.016)
    one_by_one = cleaned(sequence, monkeypatch, apart=False)
    found = cleaned(sequence, monkeypatch)
    assert found.hands_in_each_other == (0.0, 0.0)
    for side, result in found.hands.items():
        assert torch.equal(result.track.joints, one_by_one.hands[side].track.joints)


def test_one_hand_is_in_no_other(hand, monkeypatch):
    sequence = replace(facing(hand, 0.016), hands=(hand,))
    assert cleaned(sequence, monkeypatch).hands_in_each_other is None
