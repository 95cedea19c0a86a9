"""What the self-test says, and what it must not say."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
import trees
from scipy.spatial.transform import Rotation
from trees import FRAMES, scene

from geneoh.choices import NOISES
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.geometry.mesh_files import load_mesh
from geneoh.readers.base import ReaderOptions, Recording
from geneoh.readers.checks.convention import contradictions, doubts
from geneoh.readers.checks.hands import (
    MIDDLE_JOINTS,
    check_depth,
    check_keypoint_order,
    trusted_joints,
)
from geneoh.readers.npz.files import load
from geneoh.readers.recordings import read_one
from geneoh.seeds import seeded_generator
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.mark.parametrize("name", ["taco_clean", "taco_noisy"])
def test_a_real_recording_and_its_noisy_twin_keep_their_convention(name):
    mesh = load_mesh(EXAMPLES / "taco_object.obj")
    sequence = load(EXAMPLES / f"{name}.npz", obj=(mesh,))
    assert contradictions(Recording(name, sequence)) == []


@pytest.mark.parametrize("name", ["taco_clean", "taco_noisy"])
def test_poses_from_the_world_to_the_object_are_told(name):
    sequence = load(EXAMPLES / f"{name}.npz", obj=EXAMPLES / "taco_object.obj")[:60]
    back = sequence.object.rotation.mT.contiguous()
    shift = -(back @ sequence.object.translation[..., None])[..., 0]
    motion = replace(sequence.object, rotation=back, translation=shift)
    said = list(doubts(replace(sequence, object=motion), name))
    assert any("with the object's poses inverted" in words for words in said)


def test_keypoints_in_the_axes_of_unity_are_told_of():
    sequence = load(EXAMPLES / "taco_clean.npz")[:60]
    hand = sequence.hands[0]
    joints = hand.joints * torch.tensor([1.0, 1.0, -1.0])
    keys = HandTrack(side=hand.side, valid=hand.valid, joints=joints)
    alone = ObjectTrack.resting((), 60)
    (said,) = doubts(replace(sequence, hands=(keys,), object=alone), "taco")
    assert "left-handed axes, as Unity" in said
    assert "negate one coordinate" in said


@pytest.mark.parametrize("noise", ["clean", *NOISES])
@pytest.mark.parametrize("family", ["recording", "scissors", "capsule", "carton"])
def test_a_mirrored_hand_is_told_under_every_noise_and_no_other_one(family, noise):
    """By the fingers alone, hands that stretch them were taken for mirrored ones, and mirrored ones
    were not told where noise bends them."""
    clean = load(EXAMPLES / "taco_clean.npz") if family == "recording" else made(family)
    generator = seeded_generator("mirrored", family, noise)
    noisy = clean if noise == "clean" else corrupt_sequence(clean, noise, generator=generator)
    hand = noisy.hands[0]
    joints = trusted_joints(hand)
    assert list(check_keypoint_order(joints, hand.side)) == []
    (said,) = check_keypoint_order(joints * torch.tensor([1.0, 1.0, -1.0]), hand.side)
    assert "left-handed axes, as Unity" in said


@cache
def made(family):
    return draw_clip(family, 9000, 60)


def test_keypoints_without_confidence_raise_no_doubt():
    sequence = load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")[:60]
    hand = sequence.hands[0]
    joints, confidence = hand.joints.clone(), hand.joints.new_ones(60, 21)
    joints[:, [4, 8, 12, 16, 20]] = 0.0
    confidence[:, [4, 8, 12, 16, 20]] = 0.0
    keys = replace(hand, joints=joints, confidence=confidence, pose=None, wrist=None)
    assert list(doubts(replace(sequence, hands=(keys,)), "taco")) == []


@pytest.mark.parametrize(
    ("depth", "words"),
    [
        (lambda z: z, None),
        (lambda z: z - z[:, :1], "landmarks of the picture"),
        (lambda z: 1e-3 * z, "its keypoints lie in a plane"),
    ],
)
def test_points_of_a_picture_are_told(depth, words):
    hand = load(EXAMPLES / "taco_clean.npz").hands[0]
    joints = hand.joints + 1
    joints[..., 2] = depth(joints[..., 2])
    said = list(check_depth(trusted_joints(replace(hand, joints=joints))))
    assert any(words in each for each in said) if words else said == []


@pytest.mark.parametrize(("shift", "told"), [(0.0, False), (50.0, False), (500.0, True)])
def test_a_scene_that_is_far_from_the_origin_of_the_world_is_told(shift, told):
    sequence = load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")[:60]
    there = hand_at(sequence, shift)
    motion = replace(sequence.object, translation=sequence.object.translation + shift)
    there = replace(there, object=motion)
    said = list(doubts(there, "taco"))
    assert len(said) == told
    assert all("m from the origin of the world" in words for words in said)
    assert contradictions(Recording("taco", there)) == said


@pytest.mark.parametrize(("shift", "told"), [(0.0, False), (2.0, False), (4.0, True)])
def test_a_hand_far_from_the_poses_of_an_object_without_a_mesh_is_told(shift, told):
    sequence = hand_at(load(EXAMPLES / "taco_clean.npz")[:60], shift)
    posed = replace(sequence, object=replace(sequence.object, meshes=()))
    said = list(doubts(posed, "taco"))
    assert len(said) == told
    assert all("too far to touch it" in words for words in said)
    none = replace(sequence, object=ObjectTrack.resting((), 60))
    assert list(doubts(none, "taco")) == []


def hand_at(sequence: Sequence, shift: float) -> Sequence:
    """The sequence with its hand moved along each axis of the world."""
    hand = sequence.hands[0]
    moved = replace(hand, joints=hand.joints + shift, wrist=hand.wrist + shift)
    return replace(sequence, hands=(moved,))


def test_a_flat_hand_is_not_taken_for_certain_as_the_other_one():
    sequence = load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")[:60]
    hand = sequence.hands[0]
    pose = hand.pose.clone()
    pose[:, 1:] = 0.0
    pose[:, MIDDLE_JOINTS, 2] = 0.06
    flat = replace(hand, pose=pose, joints=None)
    (said,) = doubts(replace(sequence, hands=(flat,)), "taco")
    assert "backward by 0.06 rad on average; unless the hand is flat" in said


def test_a_whole_turn_about_an_axis_is_no_turn_of_a_finger():
    sequence = load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")[:60]
    hand = sequence.hands[0]
    angle = hand.pose.norm(dim=-1, keepdim=True)
    other_way = hand.pose * (1 - 2 * torch.pi / angle)  # the same rotations
    turned = replace(
        hand, pose=torch.where(torch.arange(60)[:, None, None] < 40, other_way, hand.pose)
    )
    assert list(doubts(replace(sequence, hands=(turned,)), "taco")) == []


@pytest.mark.parametrize("first", [True, False])
def test_a_hand_is_compared_with_the_part_that_it_holds(first):
    sequence = draw_clip("mug", 0, 60)
    held = sequence.object
    parts = [held.translation + torch.tensor([3.0, 0.0, 0.0]), held.translation]
    motion = ObjectTrack(
        held.meshes * 2,
        held.rotation.repeat(1, 2, 1, 1),
        torch.cat(parts if first else parts[::-1], 1),
    )
    assert list(doubts(replace(sequence, object=motion), "mug")) == []


@pytest.mark.parametrize("marked", [True, False])
def test_poses_that_were_filled_on_a_line_are_no_contradiction(marked):
    sequence = draw_clip("mug", 0, 60)
    seen = torch.ones(60, 1, dtype=torch.bool)
    seen[7:37] = False
    motion = fill_object(sequence.object, seen)
    given = replace(sequence, object=motion if marked else replace(motion, valid=None))
    assert list(doubts(given, "mug")) == []


@pytest.mark.parametrize("turning", [True, False])
def test_a_hand_that_rests_beside_a_moving_object_is_no_contradiction(turning, tmp_path, mano_dir):
    s = scene()
    still = {**s.wrist, "left": np.tile(s.wrist["left"][:1], (FRAMES, 1))}
    pose = {**s.pose, "left": np.tile(s.pose["left"][:1], (FRAMES, 1, 1))}
    s = replace(s, wrist=still, pose=pose)
    if not turning:
        s = replace(s, rotation=np.tile(s.rotation[:1], (FRAMES, 1, 1)))
    trees.grab(tmp_path, s, False)
    recording = read_one("grab", tmp_path / "grab", ReaderOptions(mano_dir=mano_dir, side="left"))
    assert contradictions(recording) == []


def test_cameras_that_are_world_to_camera_are_told(tmp_path, mano_dir):
    s = scene()
    still = replace(
        s,
        rotation=np.tile(s.rotation[:1], (FRAMES, 1, 1)),
        shift=np.tile(s.shift[:1], (FRAMES, 1)),
    )
    trees.hoi4d(tmp_path, still, False)
    known = ReaderOptions(mano_dir=mano_dir)
    assert contradictions(read_one("hoi4d", tmp_path, known)) == []
    log = next(tmp_path.rglob("output.log"))
    blocks = np.linalg.inv(trees.cameras())
    lines = [f"{t} {t} {t + 1}\n" + "\n".join(map(row, block)) for t, block in enumerate(blocks)]
    log.write_text("\n".join(lines))
    said = contradictions(read_one("hoi4d", tmp_path, known))
    assert any("output.log holds world to camera" in words for words in said)


def row(values: np.ndarray) -> str:
    return " ".join(f"{x:.9f}" for x in values)


def test_swapped_parts_are_told_and_the_option_mends_them(tmp_path, mano_dir):
    trees.hoi4d_articulated(tmp_path, scene(), True)
    known = ReaderOptions(mano_dir=mano_dir)
    said = contradictions(read_one("hoi4d", tmp_path, known))
    assert any("pass --swap-parts" in words for words in said)
    assert contradictions(read_one("hoi4d", tmp_path, replace(known, swap_parts=True))) == []


@pytest.mark.parametrize(("by", "order"), [(1, "w x y z"), (-1, "x y z w")])
def test_quaternions_in_the_other_order_are_told(by, order):
    sequence = load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")[:60]
    xyzw = Rotation.from_matrix(sequence.object.rotation[:, 0].numpy()).as_quat()
    turn = Rotation.from_quat(np.roll(xyzw, by, axis=1)).as_matrix()
    motion = replace(sequence.object, rotation=torch.from_numpy(turn).float()[:, None])
    (said,) = doubts(replace(sequence, object=motion), "taco")
    assert f"with the object's quaternions taken as {order}" in said


@pytest.mark.parametrize("rooted", [True, False])
def test_a_hand_that_is_relative_to_its_wrist_is_told(rooted):
    sequence = load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")[30:90]
    joints = sequence.hands[0].joints
    moved = joints - joints[:, :1] + joints[:1, :1] if rooted else joints
    hand = HandTrack("left", sequence.hands[0].valid, joints=moved)
    said = list(doubts(replace(sequence, hands=(hand,)), "taco"))
    assert any("relative to its wrist" in words for words in said) == rooted
