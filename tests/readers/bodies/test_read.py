import bodies
import numpy as np
import torch

from geneoh.files.npz import write_archive
from geneoh.readers.bodies.read import own_body, read_body
from geneoh.readers.bodies.smpl import body_fields


def test_a_body_that_was_written_is_read_back_in_its_world(tmp_path):
    motion = bodies.swaying()
    body = read_body(bodies.amass(tmp_path / "a.npz", motion))
    write_archive(tmp_path / "b.npz", body_fields(body))
    again = own_body(tmp_path / "b.npz")
    assert again is not None
    torch.testing.assert_close(again.motion.rotations, motion.rotations, atol=1e-5, rtol=0)
    torch.testing.assert_close(again.motion.root, motion.root, atol=1e-6, rtol=0)
    torch.testing.assert_close(again.skeleton.offsets, body.skeleton.offsets)
    assert (again.up, again.fps, again.gender, again.has_fingers) == ("z", 120.0, "female", True)


def test_the_fields_are_those_of_smplx_and_of_the_blender_add_on(tmp_path):
    body = read_body(bodies.amass(tmp_path / "a.npz", bodies.swaying()))
    fields, given = body_fields(body), np.load(tmp_path / "a.npz")
    np.testing.assert_allclose(fields["transl"], given["trans"], atol=1e-6)
    np.testing.assert_allclose(fields["global_orient"], given["poses"][:, :3], atol=1e-5)
    np.testing.assert_allclose(fields["right_hand_pose"], given["poses"][:, 111:], atol=1e-5)
    assert fields["poses"].shape == (8, 165)
    np.testing.assert_allclose(fields["poses"][:, 75:120], fields["left_hand_pose"])
    assert set(fields) >= {"trans", "gender", "betas", "mocap_frame_rate"}


def test_files_without_a_body_have_none(tmp_path):
    np.savez(tmp_path / "a.npz", joints=np.zeros((2, 21, 3)))
    assert own_body(tmp_path / "a.npz") is None
    assert own_body(tmp_path / "a.json") is None
