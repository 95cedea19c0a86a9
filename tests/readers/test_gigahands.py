"""GigaHands: frames of the video, poses of objects in some of them, its demo, and missing files."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trees import FRAMES, case_of, scene

from geneoh.errors import InputError

CASE = case_of("gigahands")
SESSION = "hand_poses/p003-instrument"
RECORDING = "object_poses/17_instruments/box_scan/p003-instrument_0033"
FIRST = 40


@pytest.fixture
def tree(tmp_path):
    CASE.write(tmp_path)
    return tmp_path


def change(path, change):
    value = json.loads(path.read_text())
    path.write_text(json.dumps(change(value)))


def test_without_mano_the_stored_keypoints_are_read(tree):
    (recording,) = CASE.read(tree, None)
    for hand in recording.sequence.hands:
        assert hand.pose is None
        np.testing.assert_allclose(hand.joints, scene().joints[hand.side], atol=1e-6)
    assert "relative to MANO's mean pose and was left out" in recording.sequence.source


def test_without_mano_and_keypoints_the_hands_cannot_be_read(tree):
    (tree / SESSION / "keypoints_3d_mano_align/033.json").unlink()
    with pytest.raises(InputError, match="relative to MANO's mean pose, got no MANO files; pass"):
        CASE.read(tree, None)


def test_a_turn_in_the_pose_itself_is_about_the_wrist(tree, mano_dir):
    extra = Rotation.from_rotvec([0.2, -0.1, 0.3])

    def turned(hands):
        for hand in hands.values():
            hand["poses"] = [[*extra.as_rotvec(), *pose[3:]] for pose in hand["poses"]]
        return hands

    (before,) = CASE.read(tree, mano_dir)
    change(tree / SESSION / "params/033.json", turned)
    (after,) = CASE.read(tree, mano_dir)
    for old, new in zip(before.sequence.hands, after.sequence.hands, strict=True):
        np.testing.assert_allclose(new.wrist, old.wrist, atol=1e-6)
        wanted = Rotation.from_rotvec(old.pose[:, 0]) * extra
        found = Rotation.from_rotvec(new.pose[:, 0])
        assert (wanted.inv() * found).magnitude().max() < 1e-5


def test_poses_between_those_of_an_object_are_interpolated(tree):
    kept = {FIRST, FIRST + 4, FIRST + 8}
    poses = tree / RECORDING / "pose/optimized_pose.json"
    change(poses, lambda all: {n: pose for n, pose in all.items() if int(n) in kept})
    (recording,) = CASE.read(tree, None)
    assert recording.sequence.frames == FRAMES
    np.testing.assert_allclose(
        recording.sequence.object.translation[:, 0], scene().shift, atol=1e-6
    )
    assert recording.sequence.object.valid[:, 0].nonzero().ravel().tolist() == [0, 4, 8]


def test_a_recording_is_split_where_an_object_is_lost_for_long(tree):
    poses = tree / RECORDING / "pose/optimized_pose.json"

    def moved(all):
        names = sorted(all)
        return {f"{int(n) + 40 * (i > 3):06d}": all[n] for i, n in enumerate(names)}

    def chosen(frames):
        return [*frames, *range(frames[-1] + 1, frames[0] + 60)]

    change(poses, moved)
    for side in ("left", "right"):
        change(tree / SESSION / f"keypoints_3d/033/chosen_frames_{side}.json", chosen)
    for name in ("params", "keypoints_3d_mano_align"):
        change(tree / SESSION / f"{name}/033.json", lambda value: lengthened(value))
    lengths = [recording.sequence.frames for recording in CASE.read(tree, None)]
    assert lengths == [4, 5]


def lengthened(value):
    """Rows for 60 frames, of hands or of keypoints."""
    if isinstance(value, list):
        return [value[t % len(value)] for t in range(60)]
    return {
        side: {k: v if k == "shapes" else lengthened(v) for k, v in hand.items()}
        for side, hand in value.items()
    }


def test_rows_are_the_frames_in_which_a_hand_was_tracked(tree):
    chosen = tree / SESSION / "keypoints_3d/033/chosen_frames_left.json"
    change(chosen, lambda frames: frames[2:])
    (recording,) = CASE.read(tree, None)
    left, right = (recording.sequence.hand(side) for side in ("left", "right"))
    assert left.valid.tolist() == [False] * 2 + [True] * (FRAMES - 2)
    assert right.valid.all()
    np.testing.assert_allclose(left.joints[2:], scene().joints["left"][2:], atol=1e-6)


def test_the_demo_is_read_too(tree, mano_dir):
    (tree / "object_poses").rename(tree / "object_pose")
    old, new = tree / "object_pose/17_instruments/box_scan", tree / "object_pose"
    (old / "p003-instrument_0033").rename(new / "p003-instrument-0033")
    (tree / "object_meta/17_instruments/box_scan").rename(new / "p003-instrument-0033/mesh")
    (tree / "hand_poses").rename(tree / "hand_pose")
    (tree / "hand_pose/p003-instrument").rename(tree / "hand_pose/p003-instrument-0033")
    (recording,) = CASE.read(tree, mano_dir)
    np.testing.assert_allclose(
        recording.sequence.hand("right").wrist, scene().wrist["right"], atol=1e-6
    )
    assert recording.mesh_names == ("gigahands_box",)


def test_a_mesh_may_be_where_the_caller_says_and_have_a_dash(tree):
    (tree / "object_meta").rename(tree / "elsewhere")
    folder = tree / "elsewhere/17_instruments/box_scan"
    folder.rename(folder.with_name("box-scan"))
    with pytest.raises(InputError, match="expected the mesh of box_scan, got no such file"):
        CASE.read(tree, None)
    (tree / "elsewhere").rename(tree / "scans_publish")
    (recording,) = CASE.read(tree, None)
    assert recording.mesh_names == ("gigahands_box",)


def test_missing_hands_are_told_where_they_belong(tree):
    (tree / SESSION / "params/033.json").unlink()
    with pytest.raises(InputError, match=r"hand_poses/p003-instrument/params/033\.json beside"):
        CASE.read(tree, None)


def test_a_folder_of_another_name_is_refused(tree):
    (tree / RECORDING).rename((tree / RECORDING).with_name("mine"))
    with pytest.raises(InputError, match="expected a folder named by session and number"):
        CASE.read(tree, None)


@pytest.mark.parametrize(
    ("file", "value", "words"),
    [
        (f"{RECORDING}/pose/optimized_pose.json", {}, "expected poses by the number of the fr"),
        (f"{RECORDING}/pose/optimized_pose.json", {"a": {}}, "expected poses by the number"),
        (
            f"{SESSION}/keypoints_3d/033/chosen_frames_left.json",
            list(range(99)),
            "rows or more, as the chosen",
        ),
    ],
)
def test_a_wrong_file_is_named(tree, file, value, words):
    (tree / file).write_text(json.dumps(value))
    with pytest.raises(InputError, match=words):
        CASE.read(tree, None)
