"""HaWoR's world results without the camera that it tracks beside them."""

import pickle

import numpy as np
import pytest
from trees import FRAMES, case_of, scene

import geneoh
from geneoh.errors import InputError
from geneoh.files.values import read_values

CASE = case_of("hawor")
TRACK = f"video/SLAM/hawor_slam_w_scale_0_{FRAMES}.npz"


def test_a_clip_without_a_hand_is_told_as_such_beside_poses_of_an_object(tmp_path):
    """The poses were said to be too many for one frame."""
    CASE.write(tmp_path)
    (path,) = tmp_path.rglob("world_space_res.pth")
    *others, valid = read_values(path)
    path.write_bytes(pickle.dumps([*others, 0 * valid]))
    with pytest.raises(InputError, match="expected a hand in some frame, got none"):
        geneoh.read("hawor", tmp_path, object_pose=scene().matrices())


def test_without_its_track_the_camera_is_not_known(tmp_path):
    CASE.write(tmp_path)
    (tmp_path / TRACK).unlink()
    (recording,) = CASE.read(tmp_path, None)
    assert [hand.camera_ray for hand in recording.sequence.hands] == [None, None]


@pytest.mark.parametrize("fault", ["fewer frames", "NaN"])
def test_a_track_that_does_not_fit_is_left_out_and_told(tmp_path, fault):
    CASE.write(tmp_path)
    with np.load(tmp_path / TRACK) as file:
        arrays = dict(file)
    traj = arrays["traj"].copy()
    traj[3] = np.nan
    arrays["traj"] = arrays["traj"][1:] if fault == "fewer frames" else traj
    np.savez(tmp_path / TRACK, **arrays)
    (recording,) = CASE.read(tmp_path, None)
    assert recording.sequence.hands[0].camera_ray is None
    assert "is left out: it is not known in all" in recording.sequence.source
