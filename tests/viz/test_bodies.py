"""Bodies with hands, without an object, as `geneoh view` shows them."""

from dataclasses import replace

import bodies
import numpy as np
import pytest
import torch
import trimesh
from pages import page_scene
from PIL import Image

from geneoh.body.motion import pose, turned_body
from geneoh.body.skeleton import JOINT_NAMES
from geneoh.errors import InputError
from geneoh.files.outputs import is_ours
from geneoh.readers.bodies.read import read_body
from geneoh.viz.camera import cameras
from geneoh.viz.look import BODY_COLOUR
from geneoh.viz.mannequin import mannequin
from geneoh.viz.outputs import write
from geneoh.viz.scene import with_body
from geneoh.viz.view import open_scene, view


@pytest.fixture(scope="module")
def body():
    return bodies.recording(up="z")


@pytest.fixture
def file(body, tmp_path):
    return bodies.hands_file(tmp_path / "hands.npz", body)


def test_bones_reach_from_joint_to_joint_in_the_world_of_the_file(body):
    names, limbs = mannequin(body)
    joints = pose(body.skeleton, body.file_motion).positions
    forearm = JOINT_NAMES.index("left_elbow"), JOINT_NAMES.index("left_wrist")
    part = names.index("left_elbow_to_left_wrist")
    verts = limbs.meshes[part].verts @ limbs.rotation[2, part].T + limbs.translation[2, part]
    for joint in forearm:
        assert (verts - joints[2, joint]).norm(dim=-1).min() < 0.05
    middle = joints[2, list(forearm)].mean(0)
    torch.testing.assert_close((verts.amax(0) + verts.amin(0)) / 2, middle, atol=5e-3, rtol=0)


def test_the_camera_sees_head_and_hands_upright_from_the_front(body, file):
    scene = open_scene(file)
    assert (scene.up, scene.has_object) == ("z", False)
    assert scene.part_colour(0) == BODY_COLOUR
    joints = pose(body.skeleton, body.file_motion).positions.numpy()
    for frame, camera in enumerate(cameras(scene, np.array([0.0, 0.0, 1.0]))):
        seen = camera.project(joints[frame, [15, 20, 21]], (100, 100))
        assert ((seen[:, :2] > 0) & (seen[:, :2] < 100)).all()
        assert seen[0, 1] < seen[1:, 1].max()
        feet = camera.project(joints[frame, [10, 11]], (100, 100))[:, :2]
        assert ((feet > 0) & (feet < 100)).all()
        front = pose(body.skeleton, body.file_motion).rotations[frame, 9, :, 2].numpy()
        assert camera.axes[2] @ front > 0.5


def test_pages_pictures_and_scenes_show_body_and_hands(file, tmp_path):
    page = page_scene(view(file, tmp_path / "a.html"))
    assert page["camera"]["up"] == [0, 0, 1]
    assert len(page["parts"]) == 22
    assert [hand["side"] for hand in page["versions"][0]["hands"]] == ["right", "left"]
    with Image.open(view(file, tmp_path / "a.png", cell=64, frames=[0, 3])) as picture:
        assert picture.width == 2 * 64 + 10
        assert len(picture.getcolors(maxcolors=100000)) > 50
    names = trimesh.load_scene(view(file, tmp_path / "a.glb")).geometry.keys()
    assert len(names) == 2 + 22
    assert names > {"left hand", "right hand", "body_left_elbow_to_left_wrist", "body_head"}


def test_other_programs_get_the_body_with_its_fingers(body, file, tmp_path):
    upright = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up, as in a GLB
    wanted = {"a.npz": body.file_motion, "a.bvh": turned_body(body.file_motion, upright)}
    for name, motion in wanted.items():
        found = read_body(view(file, tmp_path / name)).file_motion
        torch.testing.assert_close(found.rotations, motion.rotations, atol=1e-4, rtol=0)
        torch.testing.assert_close(found.root, motion.root, atol=1e-5, rtol=0)


def test_parameters_of_a_body_are_ours_and_replaced_without_asking(file, tmp_path):
    for _ in range(2):
        assert is_ours(view(file, tmp_path / "a.npz"))


def test_bvh_and_glb_face_the_same_way(body, file, tmp_path):
    joints = read_body(view(file, tmp_path / "a.bvh"))
    wrist = pose(joints.skeleton, joints.file_motion).positions[0, JOINT_NAMES.index("left_wrist")]
    scene = trimesh.load_scene(view(file, tmp_path / "a.glb"))
    moved, _ = scene.graph["left_wrist"]
    np.testing.assert_allclose(moved[:3, 3], wrist.numpy(), atol=0.03)


def test_hands_alone_make_no_bvh(file, tmp_path):
    scene = replace(open_scene(file), body=None)
    with pytest.raises(InputError, match="a BVH holds a body, got hands alone"):
        write(scene, tmp_path / "a.bvh")


def test_a_body_of_another_length_is_refused(body, file):
    with pytest.raises(InputError, match="must have the same frames"):
        with_body(open_scene(file), body[:3])
