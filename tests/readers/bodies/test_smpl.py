import bodies
import numpy as np
import pytest
import torch
from trees.writers import dump_joblib

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import PARENTS, embedded_skeleton
from geneoh.choices import AXES
from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.readers.bodies.read import read_bodies, read_body

SWAYING = bodies.swaying()


def assert_same(found: BodyMotion, wanted: BodyMotion, fingers: bool = True) -> None:
    joints = 52 if fingers else 22
    torch.testing.assert_close(found.root, wanted.root, atol=1e-5, rtol=0)
    torch.testing.assert_close(
        found.rotations[:, :joints], wanted.rotations[:, :joints], atol=1e-4, rtol=0
    )


@pytest.mark.parametrize("up", AXES)
def test_smplx_names_are_read_in_any_world(tmp_path, up):
    body = read_body(bodies.smplx_names(tmp_path / "a.npz", SWAYING, up))
    assert_same(body.motion, SWAYING)
    assert (body.up, body.fps, body.has_fingers) == (up, 30.0, True)
    assert f"{up} is taken to point up" in " ".join(body.notes)
    own, _ = bodies.in_world(SWAYING, up)
    written, root = bodies.in_world(body.motion, up)
    np.testing.assert_allclose(written, own, atol=1e-4)
    torch.testing.assert_close(body.file_motion.root, torch.from_numpy(root), atol=1e-5, rtol=0)


@pytest.mark.parametrize(
    ("flat", "said", "kept"), [(True, None, True), (None, "absolute", True), (False, "left", False)]
)
def test_fingers_relative_to_a_mean_pose_are_left_out(tmp_path, flat, said, kept):
    path = bodies.smplx_names(tmp_path / "a.npz", SWAYING, "y")
    with np.load(path) as arrays:
        fields = {**arrays, "flat_hand_mean": np.array(flat)}
    np.savez(path, **{name: value for name, value in fields.items() if value.dtype != object})
    body = read_body(path)
    assert_same(body.motion, SWAYING, fingers=kept)
    assert body.has_fingers == kept
    notes = [note for note in body.notes if "fingers" in note]
    assert len(notes) == (said is not None)
    assert all(said in note for note in notes)


def test_rotations_may_be_matrices(tmp_path):
    path = bodies.smplx_names(tmp_path / "a.npz", SWAYING, "y")
    with np.load(path) as arrays:
        fields = dict(arrays)
    for name, joints in (("global_orient", 1), ("body_pose", 21)):
        turns = torch.from_numpy(fields[name]).reshape(-1, joints, 3)
        fields[name] = axis_angle_to_matrix(turns).numpy()
    np.savez(path, **fields)
    assert_same(read_body(path).motion, SWAYING)
    fields["global_orient"] *= 2
    np.savez(path, **fields)
    with pytest.raises(InputError, match="'global_orient' must be rotation matrices"):
        read_body(path)


def test_the_caller_may_say_what_is_up(tmp_path):
    path = bodies.smplx_names(tmp_path / "a.npz", SWAYING, "z")
    body = read_body(path, up="z")
    assert_same(body.motion, SWAYING)
    assert not any("up" in note for note in body.notes)


@pytest.mark.parametrize("up", ["y", "-y"])
def test_a_body_that_stands_along_another_axis_than_its_kind_of_file_is_noted(tmp_path, up):
    turns, root = bodies.in_world(SWAYING, up)
    fields = {"poses": turns.reshape(len(turns), -1), "trans": root, "mocap_framerate": 30.0}
    np.savez(tmp_path / "a.npz", **fields)
    body = read_body(tmp_path / "a.npz")
    (note,) = body.notes
    assert (body.up, f"the body stands along {up}; --up {up}" in note) == ("z", True)
    said = read_body(tmp_path / "a.npz", up=up)
    assert_same(said.motion, SWAYING)
    assert said.notes == ()


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 500.0])
def test_fingers_that_are_no_angles_are_left_out(tmp_path, wrong):
    path = bodies.smplx_names(tmp_path / "a.npz", SWAYING)
    with np.load(path) as arrays:
        fields = dict(arrays)
    fields["left_hand_pose"][3] = wrong
    np.savez(path, **fields)
    body = read_body(path)
    assert_same(body.motion, SWAYING, fingers=False)
    assert not body.has_fingers
    assert "the fingers are not in radians in all frames" in " ".join(body.notes)


@pytest.mark.parametrize("split", [False, True])
def test_amass_is_z_up_at_its_own_rate(tmp_path, split):
    body = read_body(bodies.amass(tmp_path / "a.npz", SWAYING, split=split))
    assert_same(body.motion, SWAYING)
    assert (body.up, body.fps, body.has_fingers) == ("z", 120.0, True)


def test_poses_of_smpl_without_hands_have_flat_ones(tmp_path):
    turns, root = bodies.in_world(SWAYING, "z")
    poses = turns.reshape(len(turns), -1)[:, :72]
    np.savez(tmp_path / "a.npz", poses=poses, trans=root, mocap_framerate=60.0)
    body = read_body(tmp_path / "a.npz")
    assert_same(body.motion, SWAYING, fingers=False)
    assert not body.has_fingers
    assert torch.equal(body.motion.rotations[:, 22:], torch.eye(3).expand(8, 30, 3, 3))


def test_poses_of_smplx_have_their_hands_behind_jaw_and_eyes(tmp_path):
    turns, root = bodies.in_world(SWAYING, "z")
    flat = turns.reshape(len(turns), -1)
    poses = np.concatenate([flat[:, :66], np.ones((len(flat), 9)), flat[:, 66:]], axis=1)
    np.savez(tmp_path / "a.npz", poses=poses, trans=root, mocap_frame_rate=30.0)
    assert_same(read_body(tmp_path / "a.npz").motion, SWAYING)


def test_clips_of_both57m_are_read_with_what_their_hands_do(tmp_path):
    path = bodies.both57m(tmp_path / "a.p", SWAYING, bodies.swaying(5, seed=1))
    first, second = read_bodies(path)
    assert_same(first.motion, SWAYING)
    assert (first.fps, first.up, second.frames) == (30.0, "y", 5)
    assert first.sentences[0] == "the right hand waves"
    assert read_body(path, clip=1).frames == 5
    assert "first of several clips" in " ".join(read_body(path).notes)
    with pytest.raises(InputError, match="lower --clip"):
        read_body(path, clip=2)


def test_fields_whose_names_are_no_text_are_refused_in_a_sentence(tmp_path):
    dump_joblib(tmp_path / "a.p", [{None: 1, 7: "seven"}])
    with pytest.raises(InputError, match="got 'None', '7'; rename the fields"):
        read_body(tmp_path / "a.p")


def test_motion_x_is_read_from_its_322_numbers(tmp_path):
    body = read_body(bodies.motion_x(tmp_path / "a.npy", SWAYING))
    assert_same(body.motion, SWAYING)
    assert (body.fps, body.up) == (30.0, "y")


def test_the_users_model_gives_bones_and_the_pelvis(tmp_path):
    rest = torch.zeros(52, 3)
    offsets = 1.1 * embedded_skeleton().offsets
    for joint, parent in enumerate(PARENTS):
        rest[joint] = offsets[joint] + (rest[parent] if joint else torch.tensor([0.0, -0.2, 0.03]))
    taller = np.zeros((52, 3, 10))
    taller[15, 1, 0] = 0.1
    fields = {"v_template": rest.numpy(), "J_regressor": np.eye(52), "shapedirs": taller}
    tree = np.array([[2**32 - 1, *PARENTS[1:]], range(52)], dtype=np.int64)
    np.savez(tmp_path / "SMPLH.npz", kintree_table=tree, **fields)
    betas = np.eye(16)[0]
    path = bodies.smplx_names(tmp_path / "a.npz", SWAYING, betas=betas)
    body = read_body(path, model=tmp_path / "SMPLH.npz")
    torch.testing.assert_close(body.rest_root, torch.tensor([0.0, -0.2, 0.03]))
    torch.testing.assert_close(body.motion.root, SWAYING.root + body.rest_root)
    wanted = offsets.clone()
    wanted[15, 1] += 0.1
    torch.testing.assert_close(body.skeleton.offsets, wanted)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"body_pose": None}, "expected a body as 'global_orient'"),
        ({"body_pose": np.zeros((8, 45))}, r"'body_pose' must be numbers of shape \(T, 63\)"),
        ({"body_pose": np.zeros((7, 63))}, "must have the same number of frames"),
        ({"body_pose": np.full((8, 63), 90.0)}, "'body_pose' must be axis-angle in radians"),
        ({"global_orient": np.full((8, 3), 90.0)}, "'global_orient' must be axis-angle in radians"),
        ({"body_pose": np.full((8, 63), np.inf)}, "got NaN or infinity in 8"),
        ({"betas": np.full(10, np.nan)}, "'betas' must be finite numbers"),
        ({"transl": np.full((8, 3), np.nan)}, "got NaN or infinity in 8"),
        ({"transl": np.full((8, 3), 1e6)}, "within 10000 m of the origin"),
        ({"fps": 0.0}, "the frame rate must be 1 to 1000"),
        ({"fps": np.nan}, "the frame rate must be 1 to 1000"),
    ],
)
def test_what_is_no_body_is_refused_in_a_sentence(tmp_path, change, said):
    path = bodies.smplx_names(tmp_path / "a.npz", SWAYING)
    with np.load(path) as data:
        fields = {**data, **change}
    np.savez(path, **{name: value for name, value in fields.items() if value is not None})
    with pytest.raises(InputError, match=said):
        read_body(path)


def test_a_rate_that_the_file_and_the_caller_say_differently_is_refused(tmp_path):
    path = bodies.smplx_names(tmp_path / "a.npz", SWAYING)
    with pytest.raises(InputError, match="the file says 30 frames a second, got --fps 60"):
        read_body(path, fps=60.0)


def test_a_rate_that_nobody_says_is_assumed_and_noted(tmp_path):
    turns, root = bodies.in_world(SWAYING, "y")
    flat = turns.reshape(len(turns), -1)
    fields = {"global_orient": flat[:, :3], "body_pose": flat[:, 3:66], "transl": root}
    np.savez(tmp_path / "a.npz", **fields)
    body = read_body(tmp_path / "a.npz")
    assert (body.fps, body.has_fingers) == (30.0, False)
    assert "30 frames a second assumed" in " ".join(body.notes)
    assert read_body(tmp_path / "a.npz", fps=60.0).fps == 60.0


def test_other_arrays_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((4, 100)))
    with pytest.raises(InputError, match=r"expected a \(T, 322\) array of Motion-X"):
        read_body(tmp_path / "a.npy")
