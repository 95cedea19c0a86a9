"""`geneoh denoise --from SOURCE`: data sets in miniature, cleaned through the command line."""

import json

import numpy as np
import pytest
import quick_presets
import trees
from bad_inputs import good_arrays, millimetre_mesh, with_arrays, write_good
from trees import FRAMES, scene, write_mesh

from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.npz.files import load
from geneoh.readers.recordings import read


@pytest.fixture(scope="module")
def mano_dir(tmp_path_factory):
    return trees.write_mano(tmp_path_factory.mktemp("mano"))


def cleaned(geneoh, mano_dir, source, path, *options):
    result = geneoh(
        *("denoise", "--from", source, path, "--preset", "fast", "--mano", mano_dir),
        *("-o", "clean.npz", *options),
    )
    return result, load("clean.npz")


def test_two_hands_of_a_data_set_are_cleaned(geneoh, tmp_path, mano_dir):
    s = scene()
    trees.grab(tmp_path / "GRAB", s, False)
    result, clean = cleaned(geneoh, mano_dir, "grab", "GRAB/grab")
    assert f"GRAB s1/mug_drink_1: {FRAMES} frames at 120 frames a second" in result.stdout
    assert clean.fps == 120
    assert {hand.side for hand in clean.hands} == {"left", "right"}
    for hand in clean.hands:
        apart = np.linalg.norm(hand.joints.numpy() - s.joints[hand.side], axis=-1).mean()
        assert 0 < apart < 0.03
    np.testing.assert_allclose(clean.object.translation[:, 0], s.shift, atol=1e-6)


def test_an_articulated_object_keeps_its_parts(geneoh, tmp_path, mano_dir):
    trees.arctic(tmp_path / "data", scene(), False)
    result, clean = cleaned(geneoh, mano_dir, "arctic", "data/raw_seqs", "--side", "right")
    assert "object of 2 parts" in result.stdout
    assert [hand.side for hand in clean.hands] == ["right"]
    assert clean.object.rotation.shape[1] == 2


def test_left_hands_come_back_as_the_hand_their_betas_mean(geneoh, tmp_path, mano_dir):
    s = scene()
    trees.taco(tmp_path / "TACO", s, False)
    chosen = ("--clip", "_stir__spoon__bowl_/20230917_001_target", "--hand", "mano")
    _, clean = cleaned(geneoh, mano_dir, "taco", "TACO", *chosen)
    (hand,) = clean.hands
    assert (hand.side, hand.hand_model) == ("left", "mano-as-shipped")
    np.testing.assert_allclose(hand.betas, s.betas["left"], atol=1e-5)


@pytest.mark.parametrize("poses", ["poses.npy", "ob_in_cam"])
def test_an_estimators_hands_are_cleaned_against_the_callers_object(
    geneoh, tmp_path, mano_dir, poses
):
    s = scene("mirrored")
    (tmp_path / "dump").mkdir()
    trees.hamer(tmp_path / "dump", s, False)
    trees.write_mesh(tmp_path / "box.obj", s.verts, s.faces)
    np.save(tmp_path / "poses.npy", s.matrices())
    (tmp_path / "ob_in_cam").mkdir()
    for frame, pose in enumerate(s.matrices()):
        np.savetxt(tmp_path / "ob_in_cam" / f"{frame:06d}.txt", pose)
    brought = ("--obj", "box.obj", "--object-pose", poses, "--focal", 600)
    _, clean = cleaned(geneoh, mano_dir, "hamer", "dump/video.pt", *brought)
    assert len(clean.hands) == 2
    np.testing.assert_allclose(clean.object.translation[:, 0], s.shift, atol=1e-6)


def test_hands_of_mediapipe_get_their_places_before_the_camera(geneoh, tmp_path, mano_dir):
    s = scene("right")
    joints = s.joints["right"] - s.joints["right"].mean((0, 1)) + [0.1, 0.0, 0.6]
    image = np.concatenate([600 * joints[..., :2] / joints[..., 2:] / (640, 480) + 0.5], axis=-1)
    depth = (joints[..., 2:] - joints[:, :1, 2:]) / 0.6
    world = joints - joints.mean(1, keepdims=True)
    listed = zip(np.concatenate([image, depth], axis=-1), world, strict=True)
    results = [
        {
            name: [[dict(zip("xyz", map(float, point), strict=True)) for point in hand]]
            for name, hand in zip(("hand_landmarks", "hand_world_landmarks"), pair, strict=True)
        }
        for pair in listed
    ]
    (tmp_path / "hands.json").write_text(json.dumps(results))
    asked = ("--focal", 600, "--image-size", "640x480", "--side", "right", "--fps", 30)
    told, clean = cleaned(geneoh, mano_dir, "landmarks", "hands.json", *asked)
    assert "placed before the camera as of mean size" in told.stdout
    (hand,) = clean.hands
    assert 1e3 * np.linalg.norm(hand.joints.numpy() - joints, axis=-1).mean() < 80


@pytest.mark.parametrize("source", [(), ("--from", "keypoints")])
def test_hands_in_the_frame_of_a_camera_are_cleaned_in_the_world(geneoh, tmp_path, source):
    s = scene("right")
    np.save(tmp_path / "hand.npy", s.joints["right"])
    np.save(tmp_path / "poses.npy", s.matrices())
    camera = np.tile(np.eye(4), (FRAMES, 1, 1))
    camera[:, :3, 3] = np.linspace(0, 0.3, FRAMES)[:, None]
    np.save(tmp_path / "camera.npy", camera)
    trees.write_mesh(tmp_path / "box.obj", s.verts, s.faces)
    brought = ("--obj", "box.obj", "--object-pose", "poses.npy", "--side", "right")
    brought += ("--camera-pose", "camera.npy", "--preset", "fast", *source)
    told = geneoh("denoise", "hand.npy", *brought).stdout
    assert "note: the camera's motion was removed by its poses" in told
    clean = load(tmp_path / "hand_clean.npz")
    np.testing.assert_allclose(clean.camera_to_world, camera, atol=1e-6)
    np.testing.assert_allclose(clean.object.translation[:, 0], s.shift, atol=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "choose one with --clip NAME"),
        (("--clip", "nothing"), "got none of the name nothing but _stir__spoon__bowl_/2023"),
        (("--clip", "_stir__spoon__bowl_/20230917_001_tool", "--side", "left"), "drop --side"),
        (("--clip", "_stir__spoon__bowl_/20230917_001_tool", "--obj", "box.obj"), "got --obj as"),
    ],
)
def test_what_cannot_be_one_recording_is_told(geneoh, tmp_path, mano_dir, options, words):
    trees.taco(tmp_path / "TACO", scene(), False)
    trees.write_mesh(tmp_path / "box.obj", scene().verts, scene().faces)
    result = geneoh("denoise", "--from", "taco", "TACO", "--mano", mano_dir, *options, code=2)
    assert words in result.stderr
    assert not list(tmp_path.rglob("*_clean.npz"))


def test_a_folder_given_as_a_dot_has_its_result_beside_it(geneoh, tmp_path, mano_dir, monkeypatch):
    trees.landmarks(tmp_path, scene(), False)
    trees.write_mesh(tmp_path / "box.obj", scene().verts, scene().faces)
    np.save(tmp_path / "poses.npy", scene().matrices())
    (tmp_path / "in").mkdir()
    (tmp_path / "hands.json").rename(tmp_path / "in/hands.json")
    monkeypatch.chdir(tmp_path / "in")
    brought = ("--obj", "../box.obj", "--object-pose", "../poses.npy", "--side", "right")
    geneoh("denoise", "--from", "landmarks", ".", "--preset", "fast", *brought)
    assert load(tmp_path / "in_clean.npz").frames == FRAMES


@pytest.mark.parametrize(
    "given",
    [
        ("--translation", "wrist"),
        ("--focal", "600"),
        ("--image-size", "640x480"),
        ("--no-mean-pose",),
        ("--objects", "."),
        ("--body", "body.npz"),
        ("--swap-parts",),
        ("--object-pose-frame", "camera"),
        ("--clip", "one"),
    ],
    ids=lambda given: given[0],
)
def test_an_option_that_only_a_source_can_use_is_refused_without_one(geneoh, tmp_path, given):
    write_good(tmp_path)
    result = geneoh("denoise", "hand.npz", "--obj", "object.obj", *given, code=2)
    assert f"{given[0].replace('no-', '')}" in result.stderr
    assert "--from" in result.stderr
    assert not list(tmp_path.glob("*_clean.npz"))


def test_bare_joints_are_read_in_the_order_that_the_command_names(geneoh, tmp_path):
    write_good(tmp_path)
    joints = good_arrays()["joints"]
    shuffled = with_arrays(joints=joints[:, np.argsort(ORDERS["mano"].entries)])
    run = ("denoise", "hand.npz", "--obj", "object.obj", "--preset", "fast")
    geneoh(*run, "-o", "straight.npz")
    shuffled(tmp_path)
    geneoh(*run, "--joint-order", "mano", "-o", "shuffled.npz")
    with np.load("straight.npz") as straight, np.load("shuffled.npz") as same:
        np.testing.assert_array_equal(straight["right_joints"], same["right_joints"])


@pytest.mark.parametrize("source", ["keypoints", "parameters"])
def test_a_sequence_of_ours_is_told_to_need_no_source(geneoh, tmp_path, source):
    write_good(tmp_path)
    geneoh("denoise", "hand.npz", "-o", "clean.npz")
    done = geneoh("denoise", "--from", source, "clean.npz", "--obj", "object.obj", code=2)
    assert "got a geneoh-sequence, which needs no source" in done.stderr
    assert "without --from" in done.stderr


def test_units_of_mesh_and_keypoints_change_nothing_but_the_scale(geneoh, tmp_path):
    write_good(tmp_path)
    run = ("denoise", "hand.npz", "--obj", "object.obj", "--preset", "fast")
    geneoh(*run, "-o", "metres.npz")
    with_arrays(joints=lambda joints: 100 * joints, object_translation=lambda shift: 100 * shift)(
        tmp_path
    )
    millimetre_mesh(tmp_path)
    refused = geneoh(*run, "--unit", "mm", code=2)
    assert "centimetres" in refused.stderr
    assert "--keypoint-unit cm" in refused.stderr
    geneoh(*run, "--unit", "mm", "--keypoint-unit", "cm", "-o", "scaled.npz")
    with np.load("metres.npz") as metres, np.load("scaled.npz") as scaled:
        np.testing.assert_allclose(scaled["right_joints"], metres["right_joints"], atol=1e-4)
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, :3, 3] = 1
    np.save("joints.npy", 100 * good_arrays()["joints"])
    sequence = read(
        *("keypoints", "joints.npy"),
        obj="object.obj",
        object_pose=poses,
        unit="mm",
        keypoint_unit="cm",
        side="right",
    )
    np.testing.assert_allclose(sequence.hands[0].joints, good_arrays()["joints"], atol=1e-6)
    assert float(sequence.object.translation.max()) == pytest.approx(0.01)


def test_keypoints_in_another_order_are_refused_with_the_option_that_cures_it(geneoh, tmp_path):
    write_mesh(tmp_path / "box.obj", scene().verts, scene().faces)
    joints = scene().joints["right"]
    np.save(tmp_path / "poses.npy", scene().matrices())
    run = ("denoise", "--from", "keypoints", "hand.npy", "--obj", "box.obj", "--side", "right")
    run = (*run, "--object-pose", "poses.npy")
    for order in ("mano", "fphab"):
        np.save(tmp_path / "hand.npy", joints[:, np.argsort(ORDERS[order].entries)])
        result = geneoh(*run, code=2)
        assert f"pass --joint-order {order}" in result.stderr
    assert not (tmp_path / "hand_clean.npz").exists()


def test_the_wrong_side_and_a_still_object_out_of_reach_are_told(
    geneoh, tmp_path, monkeypatch, caplog
):
    quick_presets.use(monkeypatch)
    write_mesh(tmp_path / "box.obj", scene().verts, scene().faces)
    joints = scene().joints["right"]
    joints = joints - joints[:, :1].mean(0) + np.array([0, 0, 0.4])
    np.save(tmp_path / "hand.npy", joints)
    np.save(tmp_path / "still.npy", np.tile(np.eye(4), (FRAMES, 1, 1)))
    run = ("denoise", "--from", "keypoints", "hand.npy", "--obj", "box.obj", "--preset", "fast")
    run = (*run, "--object-pose", "still.npy")
    result = geneoh(*run, "--side", "left")
    assert "pass --side right" in caplog.text
    assert "too far to touch it" in caplog.text
    np.save(tmp_path / "hand.npy", joints + np.array([0, 0, 1]))
    result = geneoh(*run, "--side", "right", code=2)
    assert "--object-pose" in result.stderr


def test_a_mesh_without_poses_is_refused_and_a_hand_alone_is_not(geneoh, tmp_path, monkeypatch):
    quick_presets.use(monkeypatch)
    write_mesh(tmp_path / "box.obj", scene().verts, scene().faces)
    np.save(tmp_path / "hand.npy", scene().joints["right"])
    run = ("denoise", "hand.npy", "--side", "right", "--preset", "fast")
    result = geneoh(*run, "--obj", "box.obj", code=2)
    assert "pass --object-pose POSES.npy" in result.stderr
    assert "or leave --obj out" in result.stderr
    geneoh(*run)
