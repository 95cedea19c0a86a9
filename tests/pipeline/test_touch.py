"""The probability that fingers touch: closed-form cases, and hands whose contact is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from short_clips import example, short_clip

import geneoh
from geneoh.fitting.subject import subject_of
from geneoh.hand.library import load_hand
from geneoh.metrics.contact import TOUCH
from geneoh.pipeline.stages.alone import measure_hand
from geneoh.pipeline.touch import NEARER, finger_contact, verts_of_fingers
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.normalisation import normalised_hands
from geneoh.sequence.sequence import Sequence


def probability(distance: float, spread: float | None = 0.005, evidence: float = 1.0) -> float:
    given = None if spread is None else torch.full((1, 21), spread)
    return float(
        finger_contact(torch.full((1, 5), distance), given, torch.tensor([evidence]))[0, 2]
    )


def test_a_finger_inside_touches_and_one_far_away_does_not():
    assert probability(-0.003) > 0.99
    assert probability(0.02) < 0.01
    assert probability(TOUCH + NEARER) == pytest.approx(0.5)


def test_the_less_is_known_of_a_fingertip_the_nearer_to_a_half():
    near, far = (0.004, 0.012)
    assert 0.5 < probability(near, 0.05) < probability(near, 0.005)
    assert probability(far, 0.005) < probability(far, 0.05) < 0.5
    assert probability(far, 0.005) < probability(far, None) < probability(far, 0.05)


def test_poses_of_the_object_that_say_nothing_say_nothing_of_contact():
    assert probability(-0.003, evidence=0.0) == 0.5
    assert probability(-0.003, evidence=0.5) == pytest.approx(0.25 + 0.5 * probability(-0.003))


def test_only_the_own_tip_of_a_finger_counts():
    spread = torch.full((1, 21), 0.001)
    spread[0, 8] = 0.1  # the tip of the index
    found = finger_contact(torch.full((1, 5), 0.014), spread, torch.ones(1))[0]
    assert found.argmax() == 1
    assert float(found[[0, 2, 3, 4]].max()) < 0.5 * float(found[1])


def test_each_finger_has_the_skin_around_its_own_keypoints():
    hand = load_hand("right").shaped(torch.zeros(10))
    posed = hand.posed(torch.zeros(1, 16, 3), torch.zeros(1, 3))
    groups = verts_of_fingers(hand.model)
    assert len(torch.cat(groups).unique()) == sum(map(len, groups)) < len(posed.verts[0])
    for finger, group in enumerate(groups):
        nearest = torch.cdist(posed.verts[0, group], posed.joints[0, 1:]).argmin(-1) // 4
        assert float((nearest == finger).float().mean()) > 0.95


def true_contact(sequence: Sequence) -> torch.Tensor:
    """Which fingers of a left hand touch, by its own mesh."""
    (hand,) = normalised_hands(sequence)
    subject = subject_of(hand.track, load_hand("right"))
    state, surface = subject.parameters(), hand.object.surface()
    given = state, subject.shaped, subject.joints, surface, 30.0, hand.track.observed
    return measure_hand(*given)[1] <= TOUCH


def test_a_noisy_hand_touches_where_the_true_one_does():
    clean = example()[20:90]  # it reaches for the tool, takes it and uses it
    noise = torch.Generator().manual_seed(0)
    (hand,) = geneoh.denoise(corrupt_sequence(clean, "gauss", generator=noise)).hands.values()
    truth = true_contact(clean)
    assert 0.3 < float(truth.float().mean()) < 0.9
    assert hand.contact.shape == truth.shape
    assert float(((hand.contact > 0.5) == truth).float().mean()) > 0.85
    sure = (hand.contact - 0.5).abs() > 0.4
    assert float(((hand.contact > 0.5) == truth)[sure].float().mean()) > 0.9


def test_a_result_keeps_the_contact_of_its_fingers_where_it_has_an_object(tmp_path):
    clean = short_clip()
    result = geneoh.denoise(clean, preset="fast", samples=2)
    (hand,) = result.hands.values()
    geneoh.save(result, tmp_path / "clean.npz")
    stored = np.load(tmp_path / "clean.npz")[f"{hand.track.side}_finger_contact"]
    np.testing.assert_array_equal(stored, hand.contact.numpy())
    away = replace(clean.object, translation=clean.object.translation + 0.3)
    (far,) = geneoh.denoise(replace(clean, object=away), preset="fast").hands.values()
    assert bool((far.contact == 0.5).all()), "a hand that is never near says nothing of contact"
    alone = replace(clean, object=replace(clean.object, meshes=()))
    (without,) = geneoh.denoise(alone, preset="fast").hands.values()
    assert without.contact is None
