"""Hands that are lost while they carry an object, and objects that are lost meanwhile."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

import geneoh
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import palm_of
from geneoh.pipeline.preparation import OF_FILLED_POSES
from geneoh.seeds import seeded_generator
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import ObjectTrack, Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"
SEEN = 30


@pytest.fixture(scope="module")
def carried() -> Sequence:
    """The end of the recording, in which the hand carries its object on by 20 cm."""
    clean = geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")
    return clean[70:125]


def off(joints: torch.Tensor, truth: Sequence) -> float:
    """Mean error of the keypoints in the frames without a hand, metres."""
    return float((joints - truth.hands[0].joints)[SEEN:].norm(dim=-1).mean())


def test_a_hand_that_is_lost_while_it_carries_goes_on_with_its_object(carried):
    hand = carried.hands[0]
    valid = torch.arange(carried.frames) < SEEN
    lost = replace(carried, hands=(replace(hand, valid=valid),))
    found = geneoh.denoise(lost, preset="fast")
    assert off(hand.joints[[SEEN - 1]].expand_as(hand.joints), carried) > 0.06
    assert off(found.sequence.hands[0].joints, carried) < 0.02
    assert found.hands["left"].filled.equal(~valid)


def test_so_does_one_at_the_second_part_of_an_object_whose_poses_are_exact(carried):
    hand, part = carried.hands[0], carried.object
    apart = part.translation + torch.tensor([1.0, 0.0, 0.0])
    both = replace(
        part,
        meshes=part.meshes * 2,
        rotation=part.rotation.repeat(1, 2, 1, 1),
        translation=torch.cat([apart, part.translation], 1),
    )
    valid = torch.arange(carried.frames) < SEEN
    lost = replace(carried, hands=(replace(hand, valid=valid),), object=both)
    found = geneoh.denoise(lost, preset="fast", trust_object=True)
    assert off(found.sequence.hands[0].joints, carried) < 0.02


def test_so_does_that_of_a_stream(carried):
    stream = geneoh.Stream(EXAMPLES / "taco_object.obj", 30, 0.1, side="left", samples=1)
    hand, motion = carried.hands[0], carried.object
    for frame in range(carried.frames):
        pose = motion.rotation[frame], motion.translation[frame]
        stream.push(hand[frame : frame + 1] if frame < SEEN else None, pose)
    last = stream.flush()
    away = torch.cat([clean.hand.joints for clean in last]) - hand.joints[-len(last) :]
    assert float(away.norm(dim=-1).mean()) < 0.03


@pytest.mark.parametrize("trusted", [True, False])
def test_an_object_that_is_lost_moves_with_the_clean_hand(trusted):
    truth = draw_clip("mug", 2, 90)[:60]
    seen = torch.ones(60, 1, dtype=torch.bool)
    seen[6:30] = False
    given = fill_object(truth.object, seen)

    def placed(motion: ObjectTrack) -> torch.Tensor:
        turns, places = motion.rotation[~seen[:, 0], 0], motion.translation[~seen[:, 0]]
        return truth.object.meshes[0].verts @ turns.mT + places

    errors = []
    for seed in range(3):
        noisy = corrupt_sequence(truth, "gauss", generator=seeded_generator("lost", seed))
        found = geneoh.denoise(replace(noisy, object=given), preset="fast", trust_object=trusted)
        by_noisy = held_in_gaps(given, [palm_of(noisy.hands[0])])
        every = map(placed, (found.sequence.object, by_noisy, given))
        errors.append([float((each - placed(truth.object)).norm(dim=-1).mean()) for each in every])
        assert found.sequence.object.translation[seen].equal(given.translation[seen])
        assert OF_FILLED_POSES in found.notes
    clean, noisy, line = torch.tensor(errors).mean(0)
    assert clean < 0.9 * noisy < 0.25 * line
