"""Hands for bodies of any rate and world; the networks themselves are tested elsewhere."""

from dataclasses import replace
from pathlib import Path

import bodies
import jaxtyping
import numpy as np
import pytest
import torch

import geneoh
from geneoh.body.motion import BodyMotion, pose
from geneoh.errors import ConfigError, InputError
from geneoh.generators.both2hands import on_body
from geneoh.generators.both2hands.on_body import (
    BodyOptions,
    generate_on_body,
    with_hands,
)
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.readers.bodies.read import object_of_body, own_body, read_body
from geneoh.readers.npz.files import load
from geneoh.sequence.sequence import ObjectTrack


def curl_at(time):
    """How far fingers are curled at times of a clip, 0 to 1, radians: more and more, and faster."""
    return time + 0.5 * time**2


@pytest.fixture
def asked(monkeypatch) -> list:
    """What the networks are asked; they curl all fingers as `curl_at` says."""
    calls = []

    def curling(motion, skeleton, sentence, **settings):
        calls.append((motion, sentence, settings))
        curl = torch.zeros(len(motion.root), 30, 3)
        curl[..., 2] = curl_at(torch.linspace(0, 1, len(motion.root)))[:, None]
        turns = motion.rotations.clone()
        turns[:, 22:] = axis_angle_to_matrix(curl)
        return BodyMotion(motion.root, turns)

    monkeypatch.setattr(on_body, "generate_hands", curling)
    monkeypatch.setattr(
        on_body, "load_both2hands", lambda folder, text_encoder, **_: (folder, text_encoder)
    )
    return calls


@pytest.mark.parametrize("wrong", [{"steps": 0}, {"seed": -1}, {"refine": "paper"}])
def test_values_that_no_setting_has_are_refused(wrong, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for users
    (name,) = wrong
    with pytest.raises(ConfigError, match=f"BodyOptions: '{name}' must be "):
        BodyOptions(**wrong)


def test_networks_see_thirty_frames_and_y_up_and_files_their_own(asked, tmp_path):
    motion = bodies.swaying(41)
    path = bodies.amass(tmp_path / "a.npz", motion, 120.0)
    made = generate_on_body("the  right hand waves", path, BodyOptions(seed=3, steps=7))
    ((seen, sentence, settings),) = asked
    assert (len(seen.root), sentence, settings["steps"]) == (11, "the right hand waves", 7)
    assert settings["generator"].initial_seed() == 3
    torch.testing.assert_close(seen.rotations[0], motion.rotations[0], atol=1e-4, rtol=0)
    assert (made.sequence.frames, made.sequence.fps) == (41, 120.0)
    body = made.body.motion
    torch.testing.assert_close(body.rotations[:, :22], motion.rotations[:, :22], atol=1e-4, rtol=0)
    curl = matrix_to_axis_angle(body.rotations[:, 22:])[..., 2]
    torch.testing.assert_close(curl[:, 5], curl_at(torch.linspace(0, 1, 41)), atol=2e-3, rtol=0)
    wrist = pose(made.body.skeleton, made.body.file_motion).positions[:, 21]
    torch.testing.assert_close(made.sequence.hand("right").wrist, wrist)
    assert made.refined is None


def test_fingers_have_no_corner_at_the_frames_of_the_networks(asked, tmp_path):
    made = generate_on_body("wave", bodies.amass(tmp_path / "a.npz", bodies.swaying(41), 120.0))
    curl = matrix_to_axis_angle(made.body.motion.rotations[4:-4, 22:])[:, 5, 2].double()
    bends = curl.diff(n=2)
    # straight lines between the 11 frames of the networks bend by 0.0025 there alone
    torch.testing.assert_close(bends, torch.full_like(bends, 1 / 40**2), atol=3e-4, rtol=0)


def test_networks_see_a_body_on_the_ground_and_the_file_keeps_its_own_height(asked):
    body = bodies.recording()
    low = replace(body, motion=BodyMotion(body.motion.root - 0.95, body.motion.rotations))
    made = generate_on_body("the right hand waves", low)
    ((seen, *_),) = asked
    lowest = pose(body.skeleton, seen).positions[..., 1].amin()
    assert float(lowest) == pytest.approx(0.02, abs=1e-4)
    assert torch.equal(made.body.motion.root, low.motion.root)


def test_a_file_holds_hands_and_body_and_can_be_given_again(asked, tmp_path):
    body = bodies.recording(up="z")
    made = generate_on_body("both hands close", body)
    geneoh.save(made, tmp_path / "hands.npz")
    sequence, again = load(tmp_path / "hands.npz"), own_body(tmp_path / "hands.npz")
    assert [hand.side for hand in sequence.hands] == ["right", "left"]
    assert not sequence.object.meshes
    np.testing.assert_allclose(
        sequence.hand("left").joints, made.sequence.hand("left").joints, atol=1e-6
    )
    assert again is not None
    assert again.up == "z"
    torch.testing.assert_close(
        again.motion.rotations, made.body.motion.rotations, atol=1e-4, rtol=0
    )
    with np.load(tmp_path / "hands.npz") as data:
        assert str(data["prompt"]) == "both hands close"
        assert tuple(data["notes"]) == made.body.notes
    shown = [
        read_body(geneoh.view(result, tmp_path / f"{name}.bvh")).motion.rotations
        for name, result in {"made": made, "saved": tmp_path / "hands.npz"}.items()
    ]
    torch.testing.assert_close(*shown, atol=1e-4, rtol=0)
    other = generate_on_body("both hands open", tmp_path / "hands.npz")
    torch.testing.assert_close(other.body.motion.root, body.motion.root, atol=1e-5, rtol=0)


def test_cleaned_hands_come_back_to_the_body(asked):
    made = generate_on_body("both hands close", bodies.recording(up="z"))
    hands = []
    for hand in made.sequence.hands:
        turned = hand.pose.clone()
        turned[:, 3] += 0.1
        hands.append(replace(hand, pose=turned))
    body = with_hands(made.body, replace(made.sequence, hands=tuple(hands)))
    moved = replace(hands[0], wrist=hands[0].wrist + torch.tensor([0.0, 0.02, 0.0]))
    aside = replace(made, sequence=replace(made.sequence, hands=(moved, hands[1])))
    assert made.wrists_apart() == pytest.approx(0.0, abs=1e-5)
    assert aside.wrists_apart() == pytest.approx(0.02, abs=1e-5)
    (note,) = [words for words in str(aside).splitlines() if "arms" in words]
    assert "a wrist is up to 20 mm off that of its hand" in note
    joints = body.motion.rotations[:, [24, 39]]
    wanted = axis_angle_to_matrix(torch.stack([hand.pose[:, 3] for hand in hands], dim=1))
    torch.testing.assert_close(joints, wanted, atol=1e-4, rtol=0)
    same = [joint for joint in range(52) if joint not in (24, 39)]
    kept, before = body.motion.rotations[:, same], made.body.motion.rotations[:, same]
    torch.testing.assert_close(kept, before, atol=1e-4, rtol=0)


@pytest.fixture
def held(tmp_path) -> ObjectTrack:
    """A cylinder in the right hand of `bodies.recording`."""
    bodies.held_cylinder(tmp_path, bodies.swaying(6))
    path = bodies.smplx_names(tmp_path / "lift.npz", bodies.swaying(6))
    how = {"obj": (tmp_path / "mug.obj",), "object_pose": tmp_path / "poses.npy"}
    return object_of_body(path, 6, **how)


@pytest.mark.slow
def test_a_hand_in_the_object_comes_out_of_it_and_the_free_hand_stays(asked, held):
    body, options = bodies.recording(), BodyOptions(refine="none")
    raw = generate_on_body("the right hand grips the mug", body, options, held=held)
    made = generate_on_body("the right hand grips the mug", body, held=held)
    assert list(made.refined.hands) == ["right"]
    result = made.refined.hands["right"]
    assert result.after.penetration_mean_mm < 0.5 * result.before.penetration_mean_mm
    assert made.sequence.object.meshes == held.meshes
    assert torch.equal(made.sequence.hand("left").pose, raw.sequence.hand("left").pose)
    turns = [each.body.motion.rotations for each in (raw, made)]
    torch.testing.assert_close(turns[1][:, :20], turns[0][:, :20])
    own = axis_angle_to_matrix(made.sequence.hand("right").pose[:, 1:])
    torch.testing.assert_close(turns[1][:, 37:], own, atol=1e-4, rtol=0)


@pytest.mark.parametrize("sentence", ["", "  ", " .,! ", "wave " * 61])
def test_a_sentence_without_words_or_with_too_many_is_refused(asked, sentence):
    with pytest.raises(InputError, match=r"found no words|at most 60 words, found"):
        generate_on_body(sentence, bodies.recording())
    assert not asked


def test_what_a_sentence_rules_out_is_told(asked):
    def notes(sentence: str) -> tuple[str, ...]:
        return generate_on_body(sentence, bodies.recording()).body.notes

    usual = notes("the right hand waves, not the left hand")
    told = "'don't make' may not be followed; say what the hands do instead"
    assert notes("Don't make a fist.") == (*usual, told)
    assert "not be followed" not in " ".join(usual)
    told = "'not a fist' may not be followed; say what the hands do instead"
    assert notes("the left hand is not a fist") == (*usual, told)


def test_words_that_are_not_known_are_told(asked):
    def notes(sentence: str, options: BodyOptions | None = None) -> str:
        return " ".join(generate_on_body(sentence, bodies.recording(), options).body.notes)

    told = "'rihgt', 'shwos' are not known and may be ignored"
    assert told in notes("rihgt hand shwos two fingers")
    assert "'feet', 'kick' are not known" in notes("the feet kick a ball")
    assert "'third' is not known and may be ignored" in notes("the third hand waves")
    own = BodyOptions(weights=Path("own"))  # their training data may have other words
    assert "not known" not in notes("the feet kick a ball", own)
    assert "not known" not in notes("The left hand doesn't wave, the man's right hand claps")


def test_an_object_without_a_mesh_is_told(asked, held):
    body = bodies.recording()
    for given, told in (
        (replace(held, meshes=()), True),
        (ObjectTrack.resting((), body.frames), False),
    ):
        notes = generate_on_body("rest", body, held=given).body.notes
        assert any("poses and no mesh" in note for note in notes) == told


@pytest.mark.parametrize("refine", ["geneoh", "none"])
def test_an_object_of_other_frames_than_the_body_is_refused(asked, held, refine):
    with pytest.raises(InputError, match="as many frames as the body, 6, got 5"):
        generate_on_body("rest", bodies.recording(), BodyOptions(refine=refine), held=held[:5])


def test_a_single_frame_gets_hands_too(asked, tmp_path):
    path = bodies.smplx_names(tmp_path / "a.npz", bodies.swaying(1))
    assert generate_on_body("rest", read_body(path)).sequence.frames == 1
