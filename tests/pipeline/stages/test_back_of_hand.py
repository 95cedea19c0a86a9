"""A hand that carries an object on its back is cleaned by itself: the networks know palms alone."""

from dataclasses import replace

import pytest
import torch
import trimesh.creation

import geneoh
from geneoh.geometry.mesh import Mesh
from geneoh.objects.evidence import evidence_of_nearness
from geneoh.objects.facing import at_palm
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import ObjectTrack, Sequence

BASES = [0, 5, 9, 13, 17]


def with_tray(clean: Sequence, side: float) -> Sequence:
    """The right hand of a clip in its middle frame, at rest with a tray at its palm (`side` 1) or
    its back (-1)."""
    frames, hand = clean.frames, clean.hands[0].mirrored()
    still = hand[[frames // 2] * frames]
    joints = still.joints[0]
    palm = torch.linalg.cross(joints[5] - joints[0], joints[17] - joints[0])
    up = side * palm / palm.norm()
    along = joints[9] - joints[0]
    along = along - (along @ up) * up
    along = along / along.norm()
    turn = torch.stack([along, torch.linalg.cross(up, along), up], dim=-1)
    top = (joints if side > 0 else joints[BASES]) @ up
    middle = joints[BASES].mean(0)
    place = middle + up * (top.max() - middle @ up + 0.02)  # half of the tray, and the skin
    box = trimesh.creation.box((0.25, 0.2, 0.02))
    mesh = Mesh(torch.from_numpy(box.vertices).float(), torch.from_numpy(box.faces))
    tray = ObjectTrack((mesh,), turn.expand(frames, 1, 3, 3), place.expand(frames, 1, 3))
    return replace(clean, hands=(still,), object=tray)


def test_an_object_at_the_back_of_the_hand_is_not_at_its_palm(clean):
    for side, expected in ((1.0, 1.0), (-1.0, 0.0)):
        made = with_tray(clean, side)
        found = at_palm(made.hands[0].joints, made.object.surface(), 3.0, 30.0)
        assert (found == expected).all()


def test_a_hand_that_holds_has_its_object_at_the_palm(clean):
    right = clean.hands[0].mirrored()
    found = at_palm(right.joints, clean.object.mirrored().surface(), 3.0, 30.0)
    assert (found == 1).all()


def test_points_without_a_palm_are_on_no_side(clean):
    joints = clean.object.translation[:, :1].expand(-1, 21, -1)
    assert (at_palm(joints, clean.object.surface(), 3.0, 30.0) == 1).all()


def test_an_object_at_the_back_has_no_evidence(clean):
    made = with_tray(clean, -1.0)
    assert not evidence_of_nearness(made.hands[0].joints, made.object.surface(), clean.fps).any()


@pytest.mark.parametrize("noise", ["gauss", "camera"])
def test_a_tray_on_the_back_pulls_no_hand_through_it(clean, noise):
    made = with_tray(clean, -1.0)
    noisy = corrupt_sequence(made, noise, generator=torch.Generator().manual_seed(1))
    cleaned = geneoh.denoise(noisy, preset="fast")
    before, after = (
        float((each.hands[0].joints - made.hands[0].joints).norm(dim=-1).nanmean())
        for each in (noisy, cleaned.sequence)
    )
    assert after < 1.05 * before
    assert any("back of the hand" in note for note in cleaned.hands["right"].notes)
