import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.readers.npz.objects import read_object
from geneoh.readers.records import Record

T, Q = 4, 2
ROTATION = axis_angle_to_matrix(torch.randn(T, Q, 3, generator=torch.Generator().manual_seed(0)))
TRANSLATION = torch.arange(T * Q * 3.0).reshape(T, Q, 3)


def read(meshes=(), **arrays):
    record = Record("a.npz", {name: np.asarray(v) for name, v in arrays.items()})
    return read_object(record, meshes, T)


def test_without_motion_and_mesh_there_is_no_object():
    found = read()
    assert not found.meshes
    assert torch.equal(found.rotation, torch.eye(3).expand(T, 1, 3, 3))


def matrices():
    pose = torch.eye(4).repeat(T, Q, 1, 1)
    pose[..., :3, :3], pose[..., :3, 3] = ROTATION, TRANSLATION
    return pose


def test_matrices_and_pairs_are_the_same_motion():
    pair = read(object_rotation=ROTATION, object_translation=TRANSLATION)
    matrix = read(obj_pose=matrices())
    assert torch.equal(pair.rotation, matrix.rotation)
    assert torch.equal(pair.translation, matrix.translation)


def test_one_part_may_come_without_its_axis():
    pair = read(object_rotation=ROTATION[:, 0], object_translation=TRANSLATION[:, 0])
    matrix = read(obj_pose=matrices()[:, 0])
    for motion in (pair, matrix):
        assert torch.equal(motion.rotation, ROTATION[:, :1])
        assert torch.equal(motion.translation, TRANSLATION[:, :1])


def test_parts_must_agree():
    with pytest.raises(InputError, match="2 in 'object_rotation' and 1 in 'object_translation'"):
        read(object_rotation=ROTATION, object_translation=TRANSLATION[:, 0])
    with pytest.raises(InputError, match="'object_translation' with 3"):
        read(object_rotation=ROTATION, object_translation=TRANSLATION[:3])
    with pytest.raises(InputError, match=r"numbers of shape \(4, 2\) or \(4,\), got \(4, 3\)"):
        read(obj_pose=matrices(), object_valid=np.ones((T, 3)))


def test_poses_that_are_lost_are_marked_and_filled():
    lost = matrices().numpy().copy()
    lost[1, 0] = np.nan
    found = read(obj_pose=lost)
    assert found.valid.tolist() == [[True, True], [False, True], [True, True], [True, True]]
    middle = (TRANSLATION[0, 0] + TRANSLATION[2, 0]) / 2
    torch.testing.assert_close(found.translation[1, 0], middle)
    assert found.rotation.isfinite().all()
    told = read(obj_pose=matrices(), object_valid=np.array([1, 0, 1, 1]))
    assert told.valid.tolist() == [[True] * 2, [False] * 2, [True] * 2, [True] * 2]
    assert read(obj_pose=matrices()).valid is None


def test_positions_and_quaternions_are_told_that_matrices_are_needed():
    words = (
        r"got \(4, 7\) of float64; give a 4x4 matrix for each frame, made of its position and its"
    )
    with pytest.raises(InputError, match=words):
        read(obj_pose=np.ones((T, 7)))


def test_matrices_of_zeros_are_refused_with_their_frame_and_what_to_write():
    lost = matrices().numpy().copy()
    lost[2, 1] = 0
    with pytest.raises(InputError, match=r"got \[0.0, 0.0, 0.0, 0.0\] in frame 2; write NaN"):
        read(obj_pose=lost)
