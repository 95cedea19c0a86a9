"""Poses of an object in the frame of a moving camera, for the sources that know the camera."""

import numpy as np
import pytest
import torch
import trees
from trees import cameras, case_of, scene

import geneoh
from geneoh.errors import ConfigError, InputError


@pytest.fixture(params=["hawor", "dynhamr"])
def source(request):
    return request.param


@pytest.fixture
def read(source, tmp_path):
    """Read the clip of the source with poses of its object, by the frame that these lead to."""
    case_of(source).write(tmp_path)
    trees.write_mesh(tmp_path / "box.obj", scene().verts, scene().faces)

    def read(poses, frame):
        known = {"obj": tmp_path / "box.obj", "object_pose": poses, "object_pose_frame": frame}
        return geneoh.read(source, tmp_path, **known)

    return read


def test_poses_in_the_cameras_frame_are_brought_to_the_world(read):
    there = scene().matrices()
    world = read(there, "world").object
    seen = read(np.linalg.inv(cameras()) @ there, "camera").object
    torch.testing.assert_close(seen.rotation, world.rotation, atol=1e-6, rtol=0)
    torch.testing.assert_close(seen.translation, world.translation, atol=1e-6, rtol=0)


def test_every_part_of_an_object_is_brought_to_the_world(source, tmp_path):
    case_of(source).write(tmp_path)
    mesh = tmp_path / "box.obj"
    trees.write_mesh(mesh, scene().verts, scene().faces)
    there = np.stack([scene().matrices(), trees.opened(scene())], axis=1)
    poses = np.linalg.inv(cameras())[:, None] @ there
    known = {"object_pose": poses, "object_pose_frame": "camera"}
    found = geneoh.read(source, tmp_path, obj=[mesh, mesh], **known).object
    np.testing.assert_allclose(found.rotation, there[..., :3, :3], atol=1e-6)
    np.testing.assert_allclose(found.translation, there[..., :3, 3], atol=1e-6)


def test_a_lost_camera_is_missed(tmp_path):
    case_of("hawor").write(tmp_path)
    trees.write_mesh(tmp_path / "box.obj", scene().verts, scene().faces)
    for file in (tmp_path / "video/SLAM").iterdir():
        file.unlink()
    known = {"obj": tmp_path / "box.obj", "object_pose": scene().matrices()}
    with pytest.raises(InputError, match="--object-pose-frame camera needs the poses of the cam"):
        geneoh.read("hawor", tmp_path, object_pose_frame="camera", **known)


def test_a_frame_without_poses_is_refused(source, tmp_path):
    case_of(source).write(tmp_path)
    with pytest.raises(ConfigError, match="--object-pose-frame: needs --object-pose, got none"):
        geneoh.read(source, tmp_path, object_pose_frame="camera")


def test_poses_in_the_world_are_said_to_be_so(read):
    words = "the object's poses are taken to lead to the world"
    assert words in read(scene().matrices(), "world").source
    assert words not in read(scene().matrices(), "camera").source


def test_another_frame_is_refused(read):
    with pytest.raises(ConfigError, match="object_pose_frame"):
        read(scene().matrices(), "hand")


def test_poses_that_were_never_set_are_missing_in_the_cameras_frame_too(read):
    """Identities of the camera's frame became poses at the place of the camera."""
    there = scene().matrices()
    poses = np.linalg.inv(cameras()) @ there
    poses[2] = np.eye(4)
    found = read(poses, "camera").object
    assert found.observed[:, 0].tolist() == [frame != 2 for frame in range(len(poses))]
    np.testing.assert_allclose(found.translation[3:, 0], there[3:, :3, 3], atol=1e-6)
