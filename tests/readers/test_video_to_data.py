"""Results of video_to_data: lost hands, cameras and objects, scales, and wrong fields."""

import numpy as np
import pytest
from trees import FRAMES, case_of, scene

from geneoh.errors import InputError

CASE = case_of("video_to_data")
RESULT = "outputs/result/result.npz"


@pytest.fixture
def tree(tmp_path):
    CASE.write(tmp_path)
    return tmp_path


def change(tree, **fields):
    with np.load(tree / RESULT) as file:
        arrays = {**file, **fields}
    np.savez(tree / RESULT, **{name: array for name, array in arrays.items() if array is not None})


def lost_in(*frames):
    return ~np.isin(np.arange(FRAMES), frames)


def test_a_hand_is_not_observed_where_it_or_the_camera_is_lost(tree):
    with np.load(tree / RESULT) as file:
        camera = file["camera_to_world_transform"].copy()
    camera[0] = np.nan
    change(tree, hand_left_is_valid=lost_in(2), camera_is_valid=lost_in(0, FRAMES - 1))
    change(tree, camera_to_world_transform=camera)
    (recording,) = CASE.read(tree, None)
    left, right = (recording.sequence.hand(side) for side in ("left", "right"))
    assert recording.sequence.frames == FRAMES - 2
    assert left.valid.tolist() == [True, False] + [True] * (FRAMES - 4)
    assert right.valid.all()


def test_a_recording_is_split_where_the_object_is_lost(tree):
    change(tree, object_is_valid=lost_in(4))
    assert [r.sequence.frames for r in CASE.read(tree, None)] == [4, FRAMES - 5]


def test_a_scale_in_the_poses_belongs_to_the_mesh(tree):
    with np.load(tree / RESULT) as file:
        poses = file["object_to_camera_transform"].copy()
    poses[:, :3, :3] *= 2
    change(tree, object_to_camera_transform=poses, object_scale=np.array(0.25))
    (recording,) = CASE.read(tree, None)
    motion = recording.sequence.object
    np.testing.assert_allclose(motion.rotation[:, 0], scene("mirrored").rotation, atol=1e-6)
    np.testing.assert_allclose(motion.meshes[0].verts, scene().verts, atol=1e-6)
    assert "the object is 0.5 times mesh.obj; geneoh convert" in recording.sequence.source


def test_a_mesh_of_its_own_size_is_the_file(tree):
    change(tree, object_scale=np.array(1.0))
    (recording,) = CASE.read(tree, None)
    assert recording.sequence.object.meshes[0].source == tree / "outputs/result/mesh.obj"


@pytest.mark.parametrize(("size", "told"), [(1.005, False), (1.2, True)])
def test_the_size_of_a_hand_is_left_out_and_told(tree, size, told):
    change(tree, hand_left_scale=np.full(FRAMES, size))
    (recording,) = CASE.read(tree, None)
    words = "the left hand is 1.20 times as large as its betas say, which is left out"
    assert (words in recording.sequence.source) == told


def test_a_hand_that_is_never_seen_is_left_out(tree):
    change(tree, hand_left_is_valid=np.zeros(FRAMES, bool))
    (recording,) = CASE.read(tree, None)
    assert [hand.side for hand in recording.sequence.hands] == ["right"]


def test_each_result_of_a_run_is_a_clip(tree):
    (tree / "outputs/result_slam").mkdir()
    (tree / RESULT).rename(tree / "outputs/result_slam/result.npz")
    (clip,) = CASE.clips(tree)
    assert clip.name == "outputs/result_slam"


def test_a_missing_mesh_is_named(tree):
    (tree / "outputs/result/mesh.obj").unlink()
    with pytest.raises(InputError, match="expected the mesh of the object, got no such file"):
        CASE.read(tree, None)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"camera_is_valid": None}, "'camera_is_valid' must be an array of numbers, got none"),
        ({"hand_left_scale": np.ones(3)}, "'hand_left_scale' with 3"),
        ({"object_scale": np.array(0.0)}, "'object_scale' must be a factor above 0"),
        ({"camera_to_world_transform": np.ones((FRAMES, 4, 4))}, "must be rotation matrices"),
        ({"object_to_camera_transform": np.ones((FRAMES, 4, 4))}, "neither mirror nor flatten"),
    ],
)
def test_a_wrong_field_is_named(tree, fields, words):
    change(tree, **fields)
    with pytest.raises(InputError, match=words):
        CASE.read(tree, None)
