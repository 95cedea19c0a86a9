"""Notes on hands that contradict their object lastingly."""

from dataclasses import replace
from typing import get_args

import pytest
import torch

from geneoh.choices import Noise
from geneoh.geometry.mesh import Mesh
from geneoh.pipeline.contradictions import HandAtObject, contradictions
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.misfit import DepthLeft
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import ObjectTrack, Sequence

FRAMES = 60
SEEN, SURE = torch.ones(FRAMES, dtype=torch.bool), torch.ones(FRAMES)
MESH, SHIFT = "the mesh may be larger than the object", "the hand was moved by"
LARGER = "its mesh seems to be larger than the object"


def hand(depth: float, jitter: float = 0.002, moved: float = 0.0) -> HandAtObject:
    """A resting hand whose fingers are in the object, both in metres."""
    noise = torch.randn(FRAMES, 21, 3, generator=torch.Generator().manual_seed(0))
    joints = jitter * noise[:, :1].expand(-1, 21, -1) + torch.tensor([moved, 0.0, 0.0])
    fingers = jitter * noise[:, :5, 0] - depth
    return HandAtObject(joints, fingers)


def said(before: HandAtObject, after: HandAtObject, evidence: torch.Tensor = SURE) -> list[str]:
    return list(contradictions(before, after, SEEN, evidence))


def test_fingers_that_stay_in_the_object_tell_of_the_mesh():
    (words,) = said(hand(0.02), hand(0.004, 0.0))
    assert words.startswith("fingers are 2")
    assert "and 4 mm after cleaning, though the hand jitters by 2 mm only" in words
    assert MESH in words
    assert said(hand(0.006), hand(0.004, 0.0)) == []  # soft skin
    assert said(hand(0.02), hand(0.001, 0.0)) == []  # the hand was off, and is moved out
    assert said(hand(0.02, 0.02), hand(0.004, 0.0)) == []  # noise
    assert said(hand(-0.03), hand(-0.03, 0.0)) == []  # beside the object


def test_a_hand_that_is_moved_farther_than_it_jitters_is_told():
    (words,) = said(hand(0.0), hand(0.0, 0.0, moved=0.03))
    assert words.startswith(f"{SHIFT} 30 mm for a second or longer to fit the object, which its")
    assert said(hand(0.0), hand(0.0, 0.0, moved=0.01)) == []
    assert said(hand(0.0, 0.02), hand(0.0, 0.0, moved=0.03)) == []


def test_frames_that_were_cleaned_without_the_object_do_not_count():
    moved = hand(0.004, 0.0, moved=0.03)
    assert len(said(hand(0.02), moved)) == 2
    assert said(hand(0.02), moved, 0.4 * SURE) == []
    few = torch.arange(FRAMES) < 15
    assert list(contradictions(hand(0.02), moved, few, SURE)) == []


@pytest.fixture(scope="module")
def held(clean) -> Sequence:
    """Ninety frames of the recording in which the hand is at its object."""
    return clean[20:110]


def notes_of(sequence: Sequence) -> tuple[str, ...]:
    return denoise(sequence, preset="fast").hands["left"].notes


@pytest.mark.parametrize("noise", [None, *get_args(Noise)])
def test_noise_is_no_fault_of_the_mesh(held, noise):
    given = held[:60]
    if noise is not None:
        given = corrupt_sequence(given, noise, generator=torch.Generator().manual_seed(1))
    notes = notes_of(given)
    assert not any(MESH in words or LARGER in words for words in notes)
    # a camera's hands are decimetres off along its ray, and moved back
    assert any(SHIFT in words for words in notes) == (noise == "camera")


@pytest.fixture(scope="module")
def boxed(held) -> Sequence:
    """The recording with a box around the object for its mesh."""
    (mesh,) = held.object.meshes
    low, high = mesh.verts.amin(0), mesh.verts.amax(0)
    corners = torch.cartesian_prod(*torch.tensor([[0.0, 1.0]] * 3))
    faces = torch.tensor(
        [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5]]
        + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    )
    box = Mesh(low + corners * (high - low), faces)
    return replace(held, object=replace(held.object, meshes=(box,)))


def test_a_box_around_the_object_is_told_and_does_not_move_the_hand(boxed):
    found = denoise(boxed, preset="fast").hands["left"]
    assert any(LARGER in words for words in found.notes)
    assert found.moved < 0.003
    assert not found.evidence.any()
    relied_on = denoise(boxed, preset="fast", trust_object=True).hands["left"]
    assert any(MESH in words for words in relied_on.notes)
    assert relied_on.moved > 0.01


def test_a_mesh_is_relied_on_less_the_deeper_fingers_stay_in_it():
    found = [DepthLeft(depth).evidence for depth in (0.003, 0.00365, 0.0045)]
    assert found == pytest.approx([1.0, 0.5, 0.0])
    assert list(DepthLeft(0.002).note()) == []
    (partly,), (words,) = (DepthLeft(depth).note() for depth in (0.0035, 0.006))
    assert f"fingers stay 6 mm deep in it: {LARGER}" in words
    assert "is cleaned by the prior" in words
    assert "is cleaned mostly by the prior" in partly


def test_a_lasting_error_is_told_and_without_a_mesh_the_hand_keeps_its_place(held):
    (left,) = held.hands
    aside = torch.tensor([0.06, 0.0, 0.0])
    moved = replace(left, joints=left.joints + aside, wrist=left.wrist + aside)
    given = replace(held, hands=(moved,))
    assert any(SHIFT in words for words in notes_of(given))
    alone = replace(given, object=ObjectTrack.resting((), held.frames))
    result = denoise(alone, preset="fast")
    assert result.hands["left"].moved < 0.01
    assert not any(SHIFT in words for words in result.hands["left"].notes)
