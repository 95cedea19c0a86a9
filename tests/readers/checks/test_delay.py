"""Hands that come later or earlier than the object that they hold."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.preparation import OF_SHIFTED_HANDS
from geneoh.readers.checks.convention import doubts
from geneoh.readers.checks.delay import hand_delay
from geneoh.readers.npz.files import load
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.resample import at_rate, with_hands_earlier
from geneoh.sequence.sequence import ObjectTrack, Sequence

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def recording() -> Sequence:
    return load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")


def delay_of(sequence: Sequence) -> int:
    return hand_delay(sequence.hands[0], sequence.object, sequence.fps)


@pytest.mark.parametrize("delay", [2, 6, -3])
def test_a_delay_is_found(recording, delay):
    assert delay_of(with_hands_earlier(recording, -delay)) == delay


@pytest.mark.parametrize("delay", [6, -6])
def test_a_delay_is_found_in_noise_and_at_other_rates(recording, delay):
    noisy = corrupt_sequence(recording, "gauss", generator=torch.Generator().manual_seed(0))
    assert delay_of(with_hands_earlier(noisy, -delay)) == delay
    assert delay_of(with_hands_earlier(at_rate(recording, 60.0), -delay)) == delay


def test_a_delay_is_found_by_parameters_alone(recording):
    hand = replace(recording.hands[0], joints=None)
    assert delay_of(with_hands_earlier(replace(recording, hands=(hand,)), -3)) == 3


@pytest.mark.parametrize("noise", ["gauss_strong", "bias", "drift", "burst", "drop", "camera"])
def test_noise_is_no_delay(recording, noise):
    for seed in range(3):
        generator = torch.Generator().manual_seed(seed)
        assert delay_of(corrupt_sequence(recording, noise, generator=generator)) == 0


def test_an_object_that_rests_tells_no_delay(recording):
    still = ObjectTrack.resting(recording.object.meshes, recording.frames)
    assert delay_of(replace(recording, object=still)) == 0
    assert delay_of(replace(recording, object=replace(recording.object, meshes=()))) == 0
    assert delay_of(recording[:15]) == 0


def test_a_delay_is_told_and_its_option_mends_it(recording):
    late = with_hands_earlier(recording, -3)
    words = "seems to move 3 frames later than the object that it holds; "
    words += "give it the object's poses of its own time (--hand-delay 3, unless"
    assert any(words in said for said in doubts(late, "late"))
    truth = recording.hands[0].joints
    result = denoise(late, preset="fast", hand_delay=3)
    assert OF_SHIFTED_HANDS in result.notes
    mended = result.sequence
    given, cleaned = (s.hands[0].joints - truth for s in (late, mended))
    assert given.norm(dim=-1).mean() > 0.018
    assert cleaned.norm(dim=-1).mean() < 0.005
