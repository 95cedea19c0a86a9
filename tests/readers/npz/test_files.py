import json
import logging
import os
from dataclasses import replace

import numpy as np
import pytest
import torch
from bad_inputs import FRAMES, REFUSED, good_arrays, with_arrays, write_good

from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.npz.files import load, save_sequence
from geneoh.readers.npz.layouts import OBJECT_FIELDS
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence


def hand_of(side: str, frames: int = FRAMES) -> HandTrack:
    joints = torch.from_numpy(good_arrays()["joints"])[:1].repeat(frames, 1, 1)
    return HandTrack(
        side=side,
        valid=torch.arange(frames) != 2,
        joints=joints,
        pose=0.1 * torch.arange(frames * 48.0).reshape(frames, 16, 3) / (frames * 48),
        wrist=joints[:, 0],
        betas=torch.linspace(-1, 1, 10),
        hand_model="embedded",
        confidence=torch.linspace(0, 1, frames * 21).reshape(frames, 21),
        joint_spread=torch.full((frames, 21), 0.001),
    )


def two_hands(frames: int = FRAMES) -> Sequence:
    turn = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    motion = ObjectTrack(
        (),
        torch.stack([torch.eye(3), turn]).repeat(frames, 1, 1, 1),
        torch.linspace(0, 0.1, frames * 6).reshape(frames, 2, 3),
    )
    return Sequence((hand_of("right", frames), hand_of("left", frames)), motion, 120.0, "made up")


def assert_equal_hands(a: HandTrack, b: HandTrack) -> None:
    assert (a.side, a.hand_model) == (b.side, b.hand_model)
    for name in ("valid", "joints", "pose", "wrist", "betas", "confidence", "joint_spread"):
        assert torch.equal(getattr(a, name), getattr(b, name)), name


@pytest.mark.parametrize("frames", [1, FRAMES])
def test_a_saved_sequence_comes_back(tmp_path, frames):
    sequence = two_hands(frames)
    save_sequence(sequence, tmp_path / "a.npz")
    read = load(tmp_path / "a.npz")
    for before, after in zip(sequence.hands, read.hands, strict=True):
        assert_equal_hands(before, after)
    assert torch.equal(read.object.rotation, sequence.object.rotation)
    assert torch.equal(read.object.translation, sequence.object.translation)
    assert read.fps == 120.0
    assert read.source == "a.npz (geneoh-sequence version 1) made from made up"


def test_equal_sequences_give_equal_files(tmp_path):
    save_sequence(two_hands(), tmp_path / "a.npz")
    save_sequence(two_hands(), tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_file_holds_plain_arrays_under_the_names_of_the_format(tmp_path):
    save_sequence(two_hands(), tmp_path / "a.npz", extra={"note": np.array("hello")})
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        assert str(file["format"]) == "geneoh-sequence"
        assert int(file["version"]) == 1
        assert str(file["note"]) == "hello"
        shapes = {name: file[name].shape for name in file}
    assert shapes["right_pose"] == (FRAMES, 48)
    assert shapes["left_joints"] == (FRAMES, 21, 3)
    assert shapes["object_rotation"] == (FRAMES, 2, 3, 3)
    assert load(tmp_path / "a.npz").frames == FRAMES


def test_poses_without_a_mesh_are_kept_also_where_they_are_those_of_the_origin(tmp_path):
    resting = ObjectTrack((), torch.eye(3).expand(FRAMES, 1, 3, 3), torch.zeros(FRAMES, 1, 3))
    save_sequence(replace(two_hands(), object=resting), tmp_path / "a.npz")
    read = load(tmp_path / "a.npz").object
    assert read.is_known
    assert torch.equal(read.rotation, resting.rotation)


def test_an_extra_array_must_not_take_the_name_of_a_field(tmp_path):
    with pytest.raises(ValueError, match="right_pose"):
        save_sequence(two_hands(), tmp_path / "a.npz", extra={"right_pose": np.zeros(3)})
    assert os.listdir(tmp_path) == []


def test_hands_that_no_file_holds_are_refused_before_one_is_written(tmp_path):
    whole = two_hands()
    right, left = whole.hands
    for hands, words in {
        (): "one of each side, got none",
        (right, right): "got right and right",
        (right, left[:-1]): f"got {FRAMES - 1} for the left hand and {FRAMES} for the object",
        (right, replace(left, hand_model="mano")): "one hand model, got 'embedded', 'mano'",
    }.items():
        with pytest.raises(InputError, match=words):
            save_sequence(replace(whole, hands=hands), tmp_path / "a.npz")
    assert not (tmp_path / "a.npz").exists()


def test_the_side_chooses_one_of_two_hands(tmp_path):
    save_sequence(two_hands(), tmp_path / "a.npz")
    (hand,) = load(tmp_path / "a.npz", side="left").hands
    assert hand.side == "left"


def test_a_missing_frame_rate_is_assumed_aloud_or_given(tmp_path, caplog):
    arrays = good_arrays()
    del arrays["fps"]
    np.savez(tmp_path / "a.npz", **arrays)
    with caplog.at_level(logging.WARNING):
        read = load(tmp_path / "a.npz")
    assert read.fps == 30
    assert "30 frames a second assumed" in read.source
    assert "30 frames a second assumed" in caplog.text
    assert load(tmp_path / "a.npz", fps=60.0).fps == 60
    write_good(tmp_path)
    with pytest.raises(InputError, match="the file says 30 frames a second, got --fps 60"):
        load(tmp_path / "hand.npz", fps=60.0)


def test_what_is_assumed_of_keypoints_in_other_files_is_logged_as_of_an_npz(tmp_path, caplog):
    joints = good_arrays()["joints"]
    np.save(tmp_path / "hand.npy", joints)
    (tmp_path / "hand.json").write_text(json.dumps([{"right": each.tolist()} for each in joints]))
    for name in ("hand.npy", "hand.json"):
        caplog.clear()
        source = load(tmp_path / name, side="right").source
        assert "30 frames a second assumed" in source
        assert f"{name}: 30 frames a second assumed" in caplog.text


def test_another_name_for_the_poses_of_object_and_camera_is_told(tmp_path, caplog):
    arrays = good_arrays()
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    hand = {name: arrays[name] for name in ("joints", "side", "fps")}
    np.savez(tmp_path / "a.npz", **hand, object_pose=poses, cam_poses=poses)
    load(tmp_path / "a.npz")
    assert "'object_pose' is not read; is it 'obj_pose'?" in caplog.text
    assert "'cam_poses' is not read; is it 'camera_to_world'?" in caplog.text
    caplog.clear()
    pair = {name: arrays[name] for name in OBJECT_FIELDS[:2]}
    for known in ({"obj_pose": poses}, pair):
        np.savez(tmp_path / "a.npz", **hand, **known, object_pose=poses)
        load(tmp_path / "a.npz")
        assert caplog.text == ""


def test_only_parts_that_are_seen_at_all_are_told_to_be_filled_in(tmp_path):
    motion = {name: np.repeat(good_arrays()[name], 2, 1) for name in OBJECT_FIELDS[:2]}
    seen = np.ones((FRAMES, 2), bool)
    seen[:, 1] = False
    joints = {name: good_arrays()[name] for name in ("joints", "side", "fps")}
    for lost, words in ((0, ""), (3, "3 frames without a pose of the object, filled in")):
        seen[:lost, 0] = False
        np.savez(tmp_path / "a.npz", **joints, **motion, object_valid=seen)
        source = load(tmp_path / "a.npz", obj=["examples/taco_object.obj"] * 2).source
        assert words in source
        assert ("filled in" in source) == bool(lost)


def test_a_slip_in_a_field_name_is_told(tmp_path, caplog):
    np.savez(tmp_path / "a.npz", **good_arrays(), confidense=np.ones(FRAMES))
    with caplog.at_level(logging.WARNING):
        load(tmp_path / "a.npz")
    assert "'confidense' is not read; is it 'confidence'?" in caplog.text


def test_a_slip_in_the_name_of_the_only_hand_is_told_though_the_file_is_refused(tmp_path, caplog):
    marks = {"format": "geneoh-sequence", "version": 1}
    np.savez(tmp_path / "a.npz", **marks, left_joint=np.ones((FRAMES, 21, 3)))
    with pytest.raises(InputError, match="expected at least one hand"):
        load(tmp_path / "a.npz")
    assert "'left_joint' is not read; is it 'left_joints'?" in caplog.text


def test_one_mesh_belongs_to_each_part(tmp_path):
    save_sequence(two_hands(), tmp_path / "a.npz")
    mesh = Mesh(0.1 * torch.eye(3), torch.tensor([[0, 1, 2]]))
    assert len(load(tmp_path / "a.npz", obj=(mesh, mesh)).object.meshes) == 2
    with pytest.raises(InputError, match=r"2 rigid parts, got 1 mesh;"):
        load(tmp_path / "a.npz", obj=(mesh,))


@pytest.mark.parametrize(
    "case", [case for case in REFUSED if case.in_reading], ids=lambda case: case.name
)
def test_reading_refuses_in_one_sentence_that_helps(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_good(tmp_path)
    case.spoil(tmp_path)
    side = case.options[1] if case.options else None
    with pytest.raises(InputError) as refusal:
        load("hand.npz", side=side)
    message = str(refusal.value)
    assert message.startswith("hand.npz: ")
    assert "\n" not in message
    for word in case.words:
        assert word in message
    assert set(os.listdir(tmp_path)) <= {"hand.npz", "object.obj"}


def test_a_sequence_is_loaded_with_its_mesh(tmp_path):
    write_good(tmp_path)
    sequence = load(tmp_path / "hand.npz", obj=tmp_path / "object.obj")
    assert len(sequence.object.meshes) == 1
    with pytest.raises(InputError, match="1 rigid part, got 2 meshes;"):
        load(tmp_path / "hand.npz", obj=[tmp_path / "object.obj"] * 2)


def test_the_callers_poses_move_an_object_that_the_file_leaves_out(tmp_path):
    write_good(tmp_path)
    with_arrays(object_rotation=None, object_translation=None)(tmp_path)
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, 3] = [0.01, 0.02, 0.03]
    np.save(tmp_path / "poses.npy", poses)
    sequence = load(
        tmp_path / "hand.npz", obj=tmp_path / "object.obj", object_pose=tmp_path / "poses.npy"
    )
    np.testing.assert_allclose(sequence.object.translation[:, 0], poses[:, :3, 3])
    write_good(tmp_path)
    with pytest.raises(InputError, match="given once, got --object-pose and 'object_rotation'"):
        load(tmp_path / "hand.npz", object_pose=poses)


def test_an_order_of_keypoints_is_for_bare_joints_and_moves_their_confidence(tmp_path):
    confidence = np.linspace(0, 1, 21)[None].repeat(FRAMES, 0)
    with_arrays(joints=in_order_mano(good_arrays()["joints"]), confidence=confidence)(tmp_path)
    hand = load(tmp_path / "hand.npz", joint_order="mano").hands[0]
    np.testing.assert_allclose(hand.confidence[0, :3], confidence[0, [0, 13, 14]], rtol=1e-6)
    save_sequence(two_hands(), tmp_path / "own.npz")
    with pytest.raises(InputError, match="always in OpenPose order; drop the option"):
        load(tmp_path / "own.npz", joint_order="mano")


def test_keypoints_in_another_order_than_the_named_one_are_refused(tmp_path):
    write_good(tmp_path)
    with pytest.raises(InputError, match=r"in the order mano, .*; pass --joint-order openpose"):
        load(tmp_path / "hand.npz", joint_order="mano")
    np.save(tmp_path / "hand.npy", in_order_mano(good_arrays()["joints"]))
    with pytest.raises(InputError, match=r"in the order fphab, .*; pass --joint-order mano"):
        load(tmp_path / "hand.npy", side="right", joint_order="fphab")


@pytest.mark.parametrize(("count", "order"), [(16, "mano16"), (25, "webxr"), (26, "openxr")])
def test_keypoints_of_another_number_are_refused_with_the_order_that_has_it(count, order, tmp_path):
    joints, entries = np.zeros((FRAMES, count, 3)), np.array(ORDERS[order].entries)
    known, good = entries >= 0, good_arrays()["joints"]
    joints[:, entries[known]] = good[:, known]
    with_arrays(joints=joints)(tmp_path)
    with pytest.raises(InputError, match=f"; name their order with --joint-order {order}$"):
        load(tmp_path / "hand.npz")
    hand = load(tmp_path / "hand.npz", joint_order=order).hands[0]
    np.testing.assert_allclose(hand.joints[:, known], good[:, known], rtol=1e-6)
    if not known.all():  # fingertips
        assert not hand.confidence[:, ~known].any()
        assert hand.confidence[:, known].all()


def in_order_mano(joints):
    """Keypoints in OpenPose's order, brought into MANO's."""
    return joints[:, np.argsort(ORDERS["mano"].entries)]


def test_messages_and_sources_shorten_what_a_file_holds(tmp_path):
    good = good_arrays()
    long = {f"{name}{'x' * 10000}": value for name, value in good.items()}
    np.savez(tmp_path / "a.npz", **long, **{f"field{n}": 0 for n in range(1000)})
    with pytest.raises(InputError, match="and 980 more") as told:
        load(tmp_path / "a.npz")
    assert len(str(told.value)) < 1000
    joints = good.pop("joints")
    own = {"format": "geneoh-sequence", "version": 1, "right_joints": joints, **good}
    np.savez(tmp_path / "b.npz", **own, source="x" * 10000)
    assert len(load(tmp_path / "b.npz").source) < 500
