"""What an npz of any layout says of the camera that saw its hands."""

import numpy as np
import pytest
import torch
from bad_inputs import FRAMES, good_arrays

import geneoh
from geneoh.errors import InputError
from geneoh.readers.npz.files import load, save_sequence
from geneoh.sequence.camera import seen_from


@pytest.fixture
def write(tmp_path):
    """Writes the good file with further fields, and gives its path."""

    def written(**more):
        np.savez(tmp_path / "hand.npz", **{**good_arrays(), **more})
        return tmp_path / "hand.npz"

    return written


def test_a_file_without_a_camera_has_none(write):
    assert load(write()).hands[0].camera_ray is None


@pytest.mark.parametrize("shape", [(3,), (1, 3), (FRAMES, 3)])
def test_a_ray_is_read_for_all_frames_or_each(write, shape):
    ray = load(write(camera_ray=np.broadcast_to([0.0, 3.0, 4.0], shape))).hands[0]
    torch.testing.assert_close(ray.camera_ray, torch.tensor([[0, 0.6, 0.8]]).expand(FRAMES, 3))


@pytest.mark.parametrize("place", ["file", "call"])
def test_a_position_gives_the_rays_to_the_wrist(write, place):
    camera = (0.1, -0.2, -1.0)
    if place == "file":
        sequence = load(write(camera_position=np.array(camera)))
    else:
        sequence = load(write(), camera=camera)
    hand = sequence.hands[0]
    away = hand.joints[hand.valid, 0] - torch.tensor(camera)
    wanted = away / away.norm(dim=-1, keepdim=True)
    torch.testing.assert_close(hand.camera_ray[hand.valid], wanted)


def test_a_camera_that_is_far_from_the_world_is_told(write, caplog):
    load(write(), camera=(0.0, -90.0, 0.0))
    assert not caplog.text
    load(write(camera_position=[0.0, -500.0, 0.0]))
    assert "'camera_position' is 500 m from the origin of the world" in caplog.text


def test_a_position_is_in_the_unit_of_the_keypoints_of_its_file(write):
    arrays = good_arrays()
    in_mm = {name: 1000 * arrays[name] for name in ("joints", "object_translation")}
    metres = load(write(camera_position=[0.1, 0.2, -1.0]))
    other = load(write(**in_mm, camera_position=[100.0, 200.0, -1000.0]), keypoint_unit="mm")
    torch.testing.assert_close(other.hands[0].camera_ray, metres.hands[0].camera_ray)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"camera_ray": [0.0, 0, 0]}, "'camera_ray' must give a direction in every frame"),
        ({"camera_ray": [0.0, 0, np.inf]}, "'camera_ray' must be finite in every frame"),
        ({"camera_ray": np.ones((FRAMES + 1, 3))}, f"for each of the {FRAMES} frames"),
        ({"camera_ray": [1.0, 0]}, r"'camera_ray' must be numbers of shape \(3,\) or \(T, 3\)"),
        ({"camera_position": [np.nan, 0, 0]}, "'camera_position' must be finite in every frame"),
        ({"camera_ray": [1.0, 0, 0], "camera_position": [0.0, 0, 0]}, "remove one of them"),
    ],
)
def test_a_camera_that_is_none_is_refused_by_field(write, fields, message):
    with pytest.raises(InputError, match=message):
        load(write(**fields))


def test_a_camera_is_given_once(write):
    with pytest.raises(InputError, match="got --camera and 'camera_ray'; drop the option"):
        load(write(camera_ray=[0.0, 0, 1]), camera=(0, 0, 0))


def test_saved_rays_come_back_for_one_hand_and_for_two(write, tmp_path):
    one = load(write(), camera=(0.0, 0.1, -1.0))
    save_sequence(one, tmp_path / "one.npz")
    with np.load(tmp_path / "one.npz") as file:
        assert file["camera_ray"].shape == (FRAMES, 3)
    back = load(tmp_path / "one.npz").hands[0]
    torch.testing.assert_close(back.camera_ray, one.hands[0].camera_ray, atol=1e-6, rtol=0)
    joints = one.hands[0].joints.nan_to_num()
    both = geneoh.from_arrays(
        right_joints=joints,
        left_joints=joints + 0.05,
        right_valid=one.hands[0].valid,
        left_valid=one.hands[0].valid,
        object_rotation=one.object.rotation,
        object_translation=one.object.translation,
        fps=30,
    )
    both = seen_from(both, torch.tensor([[0.0, 0.1, -1.0]]), "here")
    save_sequence(both, tmp_path / "two.npz")
    for hand, read in zip(both.hands, load(tmp_path / "two.npz").hands, strict=True):
        torch.testing.assert_close(read.camera_ray, hand.camera_ray, atol=1e-6, rtol=0)


def test_a_misspelt_camera_is_told_of(write, caplog):
    load(write(camera_rays=[0.0, 0, 1]))
    assert "'camera_rays' is not read; is it 'camera_ray'?" in caplog.text
