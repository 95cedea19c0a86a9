"""`geneoh.read`: one recording of a source, with the caller's options as plain arguments."""

from pathlib import Path

import numpy as np
import pytest
import trees
import trimesh

import geneoh
from geneoh.readers.base import OF_SOME
from geneoh.readers.registry import SOURCES

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def estimated(tmp_path):
    """Keypoints and object poses as arrays of their own, and the sequence that they come from."""
    known = geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")
    np.save(tmp_path / "keypoints.npy", known.hand("left").joints.numpy())
    pose = np.tile(np.eye(4, dtype=np.float32), (known.frames, 1, 1))
    pose[:, :3, :3] = known.object.rotation[:, 0].numpy()
    pose[:, :3, 3] = known.object.translation[:, 0].numpy()
    return known, str(tmp_path / "keypoints.npy"), pose


@pytest.mark.parametrize("as_file", [False, True])
def test_arrays_of_an_estimator_become_the_sequence_they_came_from(estimated, tmp_path, as_file):
    known, path, pose = estimated
    if as_file:
        np.save(tmp_path / "pose.npy", pose)
        pose = str(tmp_path / "pose.npy")
    found = geneoh.read(
        "keypoints",
        path,
        side="left",
        fps=30.0,
        obj=str(EXAMPLES / "taco_object.obj"),
        object_pose=pose,
    )
    assert found.hand("left").joints.equal(known.hand("left").joints)
    assert found.object.rotation.allclose(known.object.rotation)
    assert found.object.translation.equal(known.object.translation)
    assert found.object.meshes[0].faces.equal(known.object.meshes[0].faces)


@pytest.mark.parametrize("poses", [1, 2])
def test_a_file_of_several_meshes_is_parts_for_as_many_poses(estimated, tmp_path, poses):
    _, path, pose = estimated
    tool = trimesh.load_mesh(EXAMPLES / "taco_object.obj", process=False)
    trimesh.Scene([tool, tool.copy()]).export(tmp_path / "two.glb")
    found = geneoh.read(
        "keypoints",
        path,
        side="left",
        fps=30.0,
        obj=tmp_path / "two.glb",
        object_pose=np.stack([pose] * poses, axis=1),
    )
    taken = "its parts in this order" if poses == 2 else "one rigid body"
    assert f"holds 2 separate meshes, taken as {taken}" in found.source
    assert len(found.object.meshes) == poses


def test_the_mesh_of_a_data_set_is_found_again_from_what_is_saved(tmp_path, mano_dir):
    """TACO's meshes are in centimetres."""
    trees.taco(tmp_path / "in", trees.scene(), False)
    clip = "_stir__spoon__bowl_/20230917_001_tool"
    found = geneoh.read("taco", tmp_path / "in", clip=clip, mano_dir=mano_dir)
    geneoh.save(found, tmp_path / "out.npz")
    again = geneoh.load(tmp_path / "out.npz").object.meshes
    assert [mesh.sha256 for mesh in again] == [mesh.sha256 for mesh in found.object.meshes]
    assert len(again) == 1


def test_poses_that_act_on_rows_are_refused_with_their_frame(estimated):
    _, path, pose = estimated
    pose[7] = pose[7].T
    with pytest.raises(geneoh.errors.InputError, match=r"0 0 0 1 as last row.*frame 7; transpose"):
        geneoh.read("keypoints", path, side="left", object_pose=pose)


def test_poses_of_another_shape_are_refused(estimated):
    _, path, pose = estimated
    with pytest.raises(geneoh.errors.InputError, match=r"'object_pose' must be .*\(T, 4, 4\)"):
        geneoh.read("keypoints", path, side="left", object_pose=pose[:, :2])


@pytest.mark.parametrize("camera", ["here", (0, 0), 0.0, (0, 0, None)])
def test_a_camera_that_is_no_place_is_refused(estimated, camera):
    _, path, _ = estimated
    with pytest.raises(geneoh.errors.InputError, match="'camera' must be"):
        geneoh.read("keypoints", path, side="left", camera=camera)


def test_an_unknown_source_is_answered_with_those_there_are(estimated):
    with pytest.raises(geneoh.errors.ConfigError, match="hoi4d"):
        geneoh.read("hoi4", estimated[1])


def test_what_the_file_leaves_open_is_asked_for(estimated):
    with pytest.raises(geneoh.errors.InputError, match="--side"):
        geneoh.read("keypoints", estimated[1])


@pytest.fixture
def masked(estimated):
    """What a file may say beside its hand: the first five frames were seen, at 60 a second."""
    joints = estimated[0].hand("left").joints.numpy()[:12].copy()
    joints[5:] = 0.0
    trust = np.full((12, 21), 0.5)
    return {"joints": joints, "valid": np.arange(12) < 5, "confidence": trust, "fps": 60.0}


def test_bare_keypoints_are_read_with_what_their_file_says_beside_them(masked, tmp_path):
    """A file means the same whether its source is named or not."""
    np.savez(tmp_path / "hand.npz", side="left", **masked)
    found = geneoh.read("keypoints", tmp_path / "hand.npz")
    (hand,), (known,) = found.hands, geneoh.load(tmp_path / "hand.npz").hands
    assert (found.fps, hand.side) == (60.0, "left")
    assert hand.valid.tolist() == known.valid.tolist() == [True] * 5 + [False] * 7
    assert hand.confidence.equal(known.confidence)
    assert hand.joints[:5].equal(known.joints[:5])


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_the_object_of_a_file_of_bare_arrays_is_read_with_its_mesh(estimated, tmp_path, unit):
    known, _, pose = estimated
    scale, hand = {"m": 1, "mm": 1000}[unit], known.hand("left")
    mesh = EXAMPLES / "taco_object.obj"
    own = {"side": "left", "fps": 30.0, "obj_pose": pose.copy()}
    own["obj_pose"][:, :3, 3] *= scale
    np.savez(tmp_path / "points.npz", joints=scale * hand.joints.numpy(), **own)
    found = geneoh.read("keypoints", tmp_path / "points.npz", obj=mesh, keypoint_unit=unit)
    assert found.object.translation.allclose(known.object.translation)
    assert len(found.object.meshes) == 1
    own = {"side": "left", "fps": 30.0, "obj_pose": pose}
    fields = {"pose": hand.pose.reshape(-1, 48).numpy(), "trans": hand.wrist.numpy()}
    np.savez(tmp_path / "mano.npz", **fields, **own)
    found = geneoh.read("parameters", tmp_path / "mano.npz", translation="wrist", obj=mesh)
    assert found.object.rotation.allclose(known.object.rotation)


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_an_object_that_starts_from_rest_at_the_origin_is_seen_there(estimated, tmp_path, unit):
    """In millimetres its first step seemed to be a leap away from poses that were never set."""
    joints = estimated[0].hand("left").joints.numpy()[:20]
    pose = np.tile(np.eye(4), (20, 1, 1))
    pose[10:, 2, 3] = 0.001 * np.arange(1, 11)
    scale = {"m": 1, "mm": 1000}[unit]
    pose[:, :3, 3] *= scale
    own = {"side": "left", "fps": 30.0, "obj_pose": pose}
    np.savez(tmp_path / "points.npz", joints=scale * joints, **own)
    found = geneoh.read("keypoints", tmp_path / "points.npz", keypoint_unit=unit)
    assert found.object.observed.all()


def test_poses_of_the_caller_go_before_those_of_a_file_of_bare_keypoints(estimated, tmp_path):
    known, _, pose = estimated
    points = known.hand("left").joints.numpy()
    np.savez(tmp_path / "a.npz", side="left", fps=30, joints=points, obj_pose=0 * pose + np.eye(4))
    found = geneoh.read("keypoints", tmp_path / "a.npz", object_pose=pose)
    assert found.object.translation.allclose(known.object.translation)
    assert "'obj_pose' of the file: not read beside --object-pose" in found.source


def test_the_camera_in_a_file_of_bare_keypoints_is_told_to_be_unread(masked, tmp_path):
    np.savez(tmp_path / "hand.npz", side="left", **masked, camera_ray=[0, 0, 1.0])
    found = geneoh.read("keypoints", tmp_path / "hand.npz")
    assert "'camera_ray' of the file: not read beside --from; --camera and" in found.source


def test_bare_parameters_are_read_with_what_their_file_says_beside_them(
    estimated, masked, tmp_path
):
    hand = estimated[0].hand("left")
    fields = {"pose": hand.pose[:12].reshape(12, 48).numpy(), "trans": hand.wrist[:12].numpy()}
    del masked["joints"]
    np.savez(tmp_path / "hand.npz", side="left", **fields, **masked)
    found = geneoh.read("parameters", tmp_path / "hand.npz", translation="wrist")
    assert found.fps == 60
    assert found.hands[0].valid.sum() == 5
    assert found.hands[0].confidence.unique().tolist() == [0.5]


def test_the_order_of_the_columns_of_bare_parameters_is_told(estimated, tmp_path):
    hand = estimated[0].hand("left")
    columns = np.c_[hand.pose[:12].reshape(12, 48).numpy(), hand.wrist[:12].numpy()]
    np.save(tmp_path / "hand.npy", columns)
    found = geneoh.read("parameters", tmp_path / "hand.npy", side="left", translation="wrist")
    assert "taken for pose (48), trans (3) and betas (10), in this order" in found.source
    assert found.hands[0].wrist.equal(hand.wrist[:12])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"side": "right"}, "'side' says left, where the right hand is asked for"),
        ({"fps": 30.0}, "says 60 frames a second, got --fps 30"),
    ],
)
def test_what_contradicts_a_file_of_bare_keypoints_is_refused(masked, tmp_path, given, said):
    np.savez(tmp_path / "hand.npz", side="left", **masked)
    with pytest.raises(geneoh.errors.InputError, match=said):
        geneoh.read("keypoints", tmp_path / "hand.npz", **given)


def test_a_mask_of_other_frames_is_refused(masked, tmp_path):
    np.savez(tmp_path / "hand.npz", side="left", **masked | {"valid": np.ones(11, bool)})
    with pytest.raises(geneoh.errors.InputError, match="'joints' with 12, 'valid' with 11"):
        geneoh.read("keypoints", tmp_path / "hand.npz")


UNUSED = {
    "body": Path("body.npz"),
    "objects": Path("nowhere"),
    "focal": 500.0,
    "image_size": (640, 480),
    "translation": "origin",
    "joint_order": "aria",
    "keypoint_unit": "mm",
    "mean_pose": False,
    "swap_parts": True,
    "object_pose": np.tile(np.eye(4), (9, 1, 1)),
    "object_pose_frame": "camera",
    "camera_pose": np.tile(np.eye(4), (9, 1, 1)),
}


@pytest.mark.parametrize("name", UNUSED)
def test_an_option_that_a_source_makes_no_use_of_is_refused(tmp_path, name):
    trees.taco_pickle(tmp_path, trees.scene(), False)
    with pytest.raises(geneoh.errors.ConfigError, match=f"--{name.replace('_', '-')}: TACO, simp"):
        geneoh.read("taco_pickle", tmp_path, **{name: UNUSED[name]})


def test_every_option_of_some_sources_is_taken_by_one_and_named_rightly():
    taken = {name for source in SOURCES.values() for name in source.reader().takes}
    assert taken == set(OF_SOME) == set(UNUSED)


def test_the_names_of_a_sources_files_are_told_where_there_are_none(tmp_path):
    (tmp_path / "joints.pkl").write_bytes(b"")
    with pytest.raises(geneoh.errors.InputError, match=r"such as \*\.npy, \*\.npz, got none"):
        geneoh.read("keypoints", tmp_path / "joints.pkl", side="left")


def test_files_of_the_callers_own_get_a_remedy_that_fits_them(tmp_path):
    np.save(tmp_path / "hand.npy", np.zeros((4, 22, 3)))
    np.save(tmp_path / "joints.npy", np.zeros((4, 21, 3)))
    np.save(tmp_path / "poses.npy", np.zeros((4, 3, 3)))
    path, joints, poses = (tmp_path / f"{name}.npy" for name in ("hand", "joints", "poses"))
    with pytest.raises(geneoh.errors.InputError, match="or name their order with --joint-order"):
        geneoh.load(path, side="right")
    with pytest.raises(geneoh.errors.InputError, match="save 'pose', 'trans' and 'betas'"):
        geneoh.read("parameters", path, side="right", translation="wrist")
    with pytest.raises(
        geneoh.errors.InputError,
        match="give a 4x4 matrix for each frame, made of its position and its quaternion",
    ):
        geneoh.load(joints, side="right", object_pose=poses)


def test_the_folder_of_mano_may_be_in_the_environment_alone(mano_dir, tmp_path, monkeypatch):
    known, pose = EXAMPLES / "taco_clean.npz", np.zeros((12, 48), dtype=np.float32)
    track = geneoh.load(known, obj=EXAMPLES / "taco_object.obj").hand("left")
    betas, place = np.ones(10, dtype=np.float32), track.wrist[:12].numpy()
    named = {"global_orient": pose[:, :3], "hand_pose": pose[:, 3:], "transl": place}
    about = {"flat_hand_mean": False, "side": "left", "betas": betas, "fps": 30.0}
    np.savez(tmp_path / "smplx.npz", **named, **about)
    np.savez(tmp_path / "bare.npz", pose=pose, trans=place, **about)
    bare = {"path": tmp_path / "bare.npz", "translation": "origin", "mean_pose": True}

    def read(**given):
        return (
            geneoh.load(tmp_path / "smplx.npz", **given).hands[0],
            geneoh.read("parameters", **bare, **given).hands[0],
        )

    told = read(mano_dir=mano_dir)
    monkeypatch.setenv("GENEOH_MANO_DIR", str(mano_dir))
    for hand, expected in zip(read(), told, strict=True):
        assert hand.joints.equal(expected.joints)
        assert hand.pose.equal(expected.pose)
