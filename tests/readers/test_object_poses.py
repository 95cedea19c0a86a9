"""The caller's poses of the object: folders of matrices, trajectories, and times of their own."""

import json
import re
from datetime import datetime, timezone

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import geneoh
from geneoh.errors import InputError
from geneoh.readers.object_poses import poses_of, read_poses
from geneoh.readers.pose_matching import PoseTrack

FRAMES = 12
TURNS = Rotation.from_rotvec(np.linspace([0.1, 0.2, 0.3], [0.5, 0.1, 0.9], FRAMES))
PLACES = np.linspace([0.0, 0.1, 0.5], [0.2, 0.1, 0.4], FRAMES)
POSES = np.tile(np.eye(4), (FRAMES, 1, 1))
POSES[:, :3, :3], POSES[:, :3, 3] = TURNS.as_matrix(), PLACES
XYZW, WXYZ = TURNS.as_quat(), TURNS.as_quat(scalar_first=True)
TIMES = 1.7e9 + np.arange(FRAMES) / 30


def table(heading, *columns, comma=","):
    rows = np.column_stack(columns).tolist()
    lines = [comma.join(f"{number:.17g}" for number in row) for row in rows]
    return "\n".join([heading, *lines] if heading else lines) + "\n"


def places_and_turns(**more):
    return [
        {**more, "position": dict(zip("xyz", place, strict=True)), "quaternion_wxyz": turn}
        for place, turn in zip(PLACES.tolist(), WXYZ.tolist(), strict=True)
    ]


def date_of(seconds):
    """A matched number of seconds since 1970 as a date."""
    return datetime.fromtimestamp(float(seconds[0]), timezone.utc).isoformat()


EUROC = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
EUROC += "q_RS_z [],v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1]"
ROS = "%time,field.header.frame_id,field.pose.position.x,field.pose.position.y,"
ROS += "field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,"
ROS += "field.pose.orientation.z,field.pose.orientation.w"
POSE = ROS.partition("frame_id,")[2].replace("field.", "")
ROS_2 = f"header.stamp.sec,header.stamp.nanosec,{POSE}"
PLOTJUGGLER = "__time,/" + POSE.replace(".", "/").replace(",", ",/")
MATRIX = ",".join(f"m{row}{column}" for row in range(3) for column in range(4))
MATRICES = POSES[:, :3].reshape(-1, 12)
TRAJECTORIES = {
    "tum": table("", TIMES, PLACES, XYZW, comma=" "),
    "tum with names": table("# timestamp tx ty tz qx qy qz qw", TIMES, PLACES, XYZW, comma=" "),
    "tum in nanoseconds": table("", TIMES * 1e9, PLACES, XYZW, comma=" "),
    "kitti": table("", POSES[:, :3].reshape(-1, 12), comma=" "),
    "16 numbers": table("", POSES.reshape(-1, 16)),
    "blocks": "\n".join(table("", pose, comma=" ") for pose in POSES),
    "log of open3d": "\n".join(f"0 0 1\n{table('', pose, comma=' ')}" for pose in POSES),
    "cut log of open3d": "\n".join(
        f"0 0 1\n{table('', pose, comma=' ')}" for pose in (*POSES, POSES[0][:2])
    ),
    "euroc": table(EUROC, TIMES * 1e9, PLACES, WXYZ, PLACES),
    "ros": table(ROS, TIMES * 1e9, TIMES * np.nan, PLACES, XYZW),
    "ros 2": table(ROS_2, TIMES // 1, TIMES % 1 * 1e9, PLACES, XYZW),
    "ros 1": table(ROS_2.replace("nanosec", "nsecs"), TIMES // 1, TIMES % 1 * 1e9, PLACES, XYZW),
    "ros with slashes": table(PLOTJUGGLER, TIMES, PLACES, XYZW),
    "json of ros": json.dumps(
        [
            {"header": {"stamp": {"sec": int(time // 1), "nanosec": int(time % 1 * 1e9)}}, **pose}
            for time, pose in zip(TIMES.tolist(), places_and_turns(), strict=True)
        ]
    ),
    "timed by dates": re.sub(r"(?m)^17[^,]*", date_of, table(f"time,{MATRIX}", TIMES, MATRICES)),
    "xyzw": table("frame;x;y;z;qx;qy;qz;qw", np.arange(FRAMES), PLACES, XYZW, comma=";"),
    "wxyz": table("qw,qx,qy,qz,tx,ty,tz", WXYZ, PLACES),
    "named matrix": table(f"time,{MATRIX}", TIMES, MATRICES),
    "decimal commas": table("x;y;z;qx;qy;qz;qw", PLACES, XYZW, comma=";").replace(".", ","),
    "json matrices": json.dumps(POSES.tolist()),
    "json by frame": json.dumps({str(frame): POSES[frame].tolist() for frame in range(FRAMES)}),
    "json fields": json.dumps({"frames": places_and_turns(score=0.5, name="mug")}),
    "json rotation": json.dumps(
        [{"R": pose[:3, :3].tolist(), "t": pose[:3, 3].tolist()} for pose in POSES]
    ),
    "json with times": json.dumps({"timestamps": TIMES.tolist(), "poses": POSES.tolist()}),
}


@pytest.mark.parametrize("name", TRAJECTORIES)
def test_a_trajectory_is_read_as_other_programs_write_it(tmp_path, name):
    """All of them were refused: poses had to be saved as npy."""
    (tmp_path / "poses").write_text(TRAJECTORIES[name])
    found = read_poses(tmp_path / "poses")
    np.testing.assert_allclose(found.matrices, POSES, atol=1e-6)
    timed = name.startswith(("tum", "euroc", "ros", "named", "timed", "json with", "json of"))
    assert (found.times is not None) == timed
    if timed:
        np.testing.assert_allclose(found.times, TIMES, atol=1e-5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (table("", PLACES, XYZW), "rows of 7 numbers without names; name the columns"),
        (table("", TIMES, PLACES, XYZW), "rows of 8 numbers without names; name the columns"),
        (table("x,y,z,rx,ry,rz", PLACES, PLACES), "quaternion (qx, qy, qz, qw), each once"),
        (table("x,y,z,qx,qy,qz,qw", PLACES, 2 * XYZW), "quaternions of length 1, got one of"),
        (table("frame,x,y,z,qx,qy,qz,qw", TIMES * 0, PLACES, XYZW), "'frame' must rise"),
        (table("time,x,y,z,qx,qy,qz,qw", -TIMES, PLACES, XYZW), "'time' must rise"),
        ("x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n1,2\n", "as long as each other"),
        ("position: [1, 2, 3]\n", "expected rows of numbers"),
        (json.dumps([{"p": [1, 2, 3], "q": [0, 0, 0, 1]}]), "call it q_xyzw or q_wxyz"),
        (json.dumps({"fps": 30}), "expected a list of poses"),
        (
            json.dumps({"mug": POSES.tolist(), "box": POSES[:3].tolist()}),
            "one object, got mug, box",
        ),
        (
            json.dumps({"poses": POSES.tolist(), "timestamps": [1, 2]}),
            "each of the 12 poses, got 2",
        ),
        (json.dumps({"frame_0": POSES[0].tolist()}), "a list of poses, or poses by frame number"),
        (json.dumps([1, 2, 3]), "each once, got no names"),
        ("x,y,z,qx,qy,qz,qw\n1,2,3,,,,\n", "expected poses in numbers, got none"),
    ],
)
def test_a_table_that_leaves_its_meaning_open_is_refused(tmp_path, text, words):
    (tmp_path / "poses.csv").write_text(text)
    with pytest.raises(InputError, match=re.escape(words)):
        read_poses(tmp_path / "poses.csv")


def test_frames_that_a_table_leaves_out_are_frames_without_a_pose(tmp_path):
    kept = [2, 3, 5]
    text = table("frame,time,x,y,z,qx,qy,qz,qw", kept, TIMES[kept], PLACES[kept], XYZW[kept])
    (tmp_path / "poses.csv").write_text(text)
    found = read_poses(tmp_path / "poses.csv")
    assert found.first == 2
    assert np.isfinite(found.matrices).all((1, 2)).tolist() == [True, True, False, True]
    np.testing.assert_allclose(found.times, TIMES[2:6], atol=1e-5)


def test_the_one_field_of_poses_of_an_npz_is_read_with_its_times(tmp_path):
    np.savez(tmp_path / "poses.npz", timestamps=TIMES, ob_in_cam=POSES[:, :3], score=TIMES)
    found = read_poses(tmp_path / "poses.npz")
    np.testing.assert_allclose(found.matrices, POSES)
    np.testing.assert_allclose(found.times, TIMES)
    np.savez(tmp_path / "poses.npz", a=POSES, b=POSES)
    with pytest.raises(InputError, match=r"one field of \(T, 4, 4\) poses, got 2 in a, b"):
        read_poses(tmp_path / "poses.npz")


def poses_at(seconds):
    """The motion of POSES at some times."""
    found = np.tile(np.eye(4), (len(seconds), 1, 1))
    place = np.stack([np.interp(seconds, TIMES, PLACES[:, axis]) for axis in range(3)], axis=1)
    turns = np.stack([np.interp(seconds, TIMES, TURNS.as_rotvec()[:, k]) for k in range(3)], axis=1)
    found[:, :3, :3], found[:, :3, 3] = Rotation.from_rotvec(turns).as_matrix(), place
    return found


@pytest.mark.parametrize("fps", [10, 60, 90])
def test_poses_of_another_rate_are_brought_to_the_times_of_the_hand(fps):
    """There had to be as many poses as frames, and they were taken one after the other."""
    times = np.arange(TIMES[0], TIMES[-1] + 1e-6, 1 / fps)
    poses, notes = PoseTrack(poses_at(times), times=times).at_times(TIMES + 0.004, "a.npz")
    known = np.isfinite(poses).all((1, 2))
    assert known.sum() >= FRAMES - 2
    np.testing.assert_allclose(poses[known], poses_at(TIMES + 0.004)[known], atol=1e-2)
    assert f"the object's {len(times)} poses were brought to the times" in notes[0]


def test_times_between_which_the_object_was_lost_have_no_pose():
    kept = [0, 1, 2, 3, 8, 9, 10, 11]
    poses, (note,) = PoseTrack(POSES[kept], times=TIMES[kept]).at_times(TIMES, "a.npz")
    known = np.isfinite(poses).all((1, 2))
    assert np.flatnonzero(known).tolist() == kept
    assert "none of them near 4 frames" in note
    np.testing.assert_allclose(poses[kept], POSES[kept], atol=1e-9)


def test_times_of_another_clock_are_refused():
    with pytest.raises(InputError, match=r"a\.npz: .* 0 to 0\.36\d* s, got 1700000000 .* clock"):
        PoseTrack(POSES, times=TIMES).at_times(np.arange(FRAMES).round() / 30, "a.npz")


def hand_of(folder, times, **fields):
    """A npz of a hand that moves with the object's place, one frame at each time."""
    from bad_inputs import good_arrays

    hand = good_arrays()["joints"][0].astype(float)
    place = np.stack([np.interp(times, TIMES, PLACES[:, axis]) for axis in range(3)], axis=1)
    np.savez(folder / "hand.npz", joints=hand + place[:, None], side="right", **fields)
    return folder / "hand.npz"


@pytest.mark.parametrize("source", [None, "keypoints"])
def test_a_hand_and_an_object_with_times_need_no_equal_frames(tmp_path, source):
    seconds = TIMES[[0, 1, 2, 5, 6, 7, 8, 9]]
    path = hand_of(tmp_path, seconds, timestamps=seconds)
    (tmp_path / "obj.tum").write_text(TRAJECTORIES["tum"])
    how = {"object_pose": tmp_path / "obj.tum"}
    found = geneoh.load(path, **how) if source is None else geneoh.read(source, path, **how)
    assert found.frames == 10
    assert found.hands[0].valid.tolist() == [True] * 3 + [False] * 2 + [True] * 5
    seen = [0, 1, 2, 5, 6, 7, 8, 9]
    np.testing.assert_allclose(found.object.translation[seen, 0], PLACES[seen], atol=1e-6)
    np.testing.assert_allclose(found.object.rotation[seen, 0], POSES[seen, :3, :3], atol=1e-6)


@pytest.mark.parametrize("heading", ["", "# timestamp tx ty tz qx qy qz qw"])
def test_times_of_tum_are_seconds_however_far_apart(tmp_path, heading):
    """Key frames of SLAM a second apart were taken to be milliseconds apart."""
    seconds = np.arange(FRAMES) / 2
    path = hand_of(tmp_path, seconds, timestamps_s=seconds, fps=2.0)
    keys = slice(None, None, 2)
    text = table(heading, seconds[keys], PLACES[keys], XYZW[keys], comma=" ")
    (tmp_path / "obj.tum").write_text(text)
    found = geneoh.load(path, object_pose=tmp_path / "obj.tum")
    np.testing.assert_allclose(found.object.translation[keys, 0], PLACES[keys], atol=1e-6)


@pytest.mark.parametrize("late", [0.0, 0.01])
def test_poses_that_were_never_set_are_not_interpolated_with_others(tmp_path, late):
    path = hand_of(tmp_path, TIMES, timestamps=TIMES)
    places, turns = PLACES + 1.0, XYZW.copy()
    places[4:6], turns[4:6] = 0.0, [0.0, 0.0, 0.0, 1.0]
    (tmp_path / "obj.tum").write_text(table("", TIMES + late, places, turns, comma=" "))
    found = geneoh.load(path, object_pose=tmp_path / "obj.tum").object
    np.testing.assert_allclose(found.translation[:, 0], PLACES + 1.0, atol=0.02)
    assert not found.observed[4:6].any()


def test_poses_with_times_beside_a_hand_without_are_one_for_each_frame(tmp_path):
    (tmp_path / "obj.tum").write_text(TRAJECTORIES["tum"])
    path = hand_of(tmp_path, TIMES, fps=30.0)
    found = geneoh.load(path, object_pose=tmp_path / "obj.tum")
    assert "the object's poses have times and the hand none: taken one for each" in found.source
    path = hand_of(tmp_path, TIMES[:7], fps=30.0)
    with pytest.raises(InputError, match="save the times of the hand's frames, too, as 'timest"):
        geneoh.load(path, object_pose=tmp_path / "obj.tum")


def test_poses_without_times_beside_a_hand_with_times_are_one_for_each_frame(tmp_path):
    """Nothing was said, so that times in columns of unknown names seemed to be read."""
    path = hand_of(tmp_path, TIMES, timestamps=TIMES)
    found = geneoh.load(path, object_pose=POSES)
    assert "the hand has times and the object's poses none: taken one for each" in found.source
    with pytest.raises(InputError, match="save the times of the poses, too, as numbers in a colu"):
        geneoh.load(path, object_pose=POSES[1:])


def test_one_pose_with_a_time_is_that_of_an_object_that_does_not_move(tmp_path):
    path = hand_of(tmp_path, TIMES, timestamps=TIMES)
    (tmp_path / "pose.tum").write_text(table("", TIMES[:1], PLACES[:1], XYZW[:1], comma=" "))
    found = geneoh.load(path, object_pose=tmp_path / "pose.tum")
    assert found.object.valid is None
    assert "one pose was taken for all frames" in found.source


def test_numbers_of_poses_that_are_not_those_of_the_hand_are_told(tmp_path):
    path = hand_of(tmp_path, TIMES, fps=30.0, frame_ids=np.arange(FRAMES) + 5)
    (tmp_path / "obj.csv").write_text(
        table("frame,x,y,z,qx,qy,qz,qw", np.arange(FRAMES) + 7, PLACES, XYZW)
    )
    found = geneoh.load(path, object_pose=tmp_path / "obj.csv")
    assert "begin with frame 7 and the hand with 5: taken one for each frame" in found.source


def test_the_one_list_of_poses_of_a_json_is_read(tmp_path):
    beside = {
        "cameras": [{"name": "left"}],
        "points": [[1, 2, 3]],
        "poses": [None, *POSES.tolist()],
    }
    (tmp_path / "obj.json").write_text(json.dumps(beside))
    found = read_poses(tmp_path / "obj.json").matrices
    assert np.isnan(found[0]).all()
    np.testing.assert_allclose(found[1:], POSES, atol=1e-9)


def test_poses_of_an_npz_that_are_not_valid_are_lost(tmp_path):
    seen = np.arange(FRAMES) > 2
    np.savez(tmp_path / "obj.npz", poses=POSES, object_valid=seen)
    np.testing.assert_array_equal(
        np.isfinite(read_poses(tmp_path / "obj.npz").matrices[:, 0, 0]), seen
    )
    both = np.stack([seen, ~seen], axis=1)
    np.savez(tmp_path / "obj.npz", poses=POSES[:, None].repeat(2, 1), object_valid=both)
    found = read_poses(tmp_path / "obj.npz").matrices
    np.testing.assert_array_equal(np.isfinite(found[..., 0, 0]), both)
    for fields, words in (
        ({"object_valid": seen[1:]}, r"'object_valid' must be numbers of shape \(12,\)"),
        ({"timestamps": TIMES[1:]}, "'timestamps' must be one number for each of the 12 poses"),
    ):
        np.savez(tmp_path / "obj.npz", poses=POSES, **fields)
        with pytest.raises(InputError, match=words):
            read_poses(tmp_path / "obj.npz")


def test_an_empty_file_of_poses_is_called_empty(tmp_path):
    (tmp_path / "obj.csv").touch()
    with pytest.raises(InputError, match=r"obj\.csv: expected data, got an empty file"):
        read_poses(tmp_path / "obj.csv")


def test_an_object_without_any_pose_is_not_told_to_be_filled_in(tmp_path):
    path = hand_of(tmp_path, TIMES, fps=30.0)
    how = {"obj": "examples/taco_object.obj", "object_pose": np.full_like(POSES, np.nan)}
    source = geneoh.load(path, **how).source
    assert "there is no pose of the object in any frame" in source
    assert "filled in" not in source


def test_poses_of_a_whole_video_are_those_of_the_hands_numbered_frames(tmp_path):
    path = hand_of(tmp_path, TIMES[[2, 3, 5]], fps=30.0, frame_ids=[2, 3, 5])
    found = geneoh.load(path, object_pose=POSES)
    np.testing.assert_allclose(found.object.translation[[0, 1, 3], 0], PLACES[[2, 3, 5]], atol=1e-6)


@pytest.mark.parametrize("name", ["pose.npy", "pose.txt", "pose.json"])
def test_an_object_that_does_not_move_has_one_pose(tmp_path, name):
    """It was refused with the advice to cut the hand to one frame."""
    text = json.dumps([POSES[0].tolist()]) if "json" in name else table("", POSES[0], comma=" ")
    (tmp_path / name).write_text(text)
    if name == "pose.npy":
        np.save(tmp_path / name, POSES[0])
    found = geneoh.load(hand_of(tmp_path, TIMES, fps=30.0), object_pose=tmp_path / name)
    np.testing.assert_allclose(found.object.rotation[:, 0], POSES[[0] * FRAMES, :3, :3], atol=1e-6)
    assert "one pose was taken for all frames, in which it does not move" in found.source


def test_poses_in_millimetres_are_scaled_once(tmp_path):
    path = hand_of(tmp_path, TIMES, timestamps=TIMES)
    (tmp_path / "obj.csv").write_text(table("time,x,y,z,qx,qy,qz,qw", TIMES, 1000 * PLACES, XYZW))
    values = dict(np.load(path))
    np.savez(path, **{**values, "joints": 1000 * values["joints"]})
    for read in (geneoh.load, lambda *given, **how: geneoh.read("keypoints", *given, **how)):
        found = read(path, object_pose=tmp_path / "obj.csv", keypoint_unit="mm")
        np.testing.assert_allclose(found.object.translation[:, 0], PLACES, atol=1e-6)


@pytest.mark.parametrize("name", ["tum", "kitti", "euroc", "in mm"])
def test_units_of_formats_and_headings_hold_beside_keypoints_in_millimetres(tmp_path, name):
    path = hand_of(tmp_path, TIMES, timestamps=TIMES)
    values = dict(np.load(path))
    np.savez(path, **{**values, "joints": 1000 * values["joints"]})
    heading = "time,x [mm],y [mm],z [mm],qx,qy,qz,qw"
    texts = {**TRAJECTORIES, "in mm": table(heading, TIMES, 1000 * PLACES, XYZW)}
    (tmp_path / "obj.txt").write_text(texts[name])
    found = geneoh.load(path, object_pose=tmp_path / "obj.txt", keypoint_unit="mm")
    np.testing.assert_allclose(found.object.translation[:, 0], PLACES, atol=1e-5)


def pose(number: int) -> np.ndarray:
    """A pose that tells the number of its frame."""
    found = np.eye(4)
    found[0, 3] = number
    return found


@pytest.mark.parametrize("numbers", [range(9), range(3, 10), (4, 7, 11)])
def test_texts_of_a_folder_may_lack_the_first_and_last_frames(tmp_path, numbers):
    """FoundationPose writes none where it has not found the object; they were refused."""
    (tmp_path / "ob_in_cam").mkdir()
    for number in numbers:
        np.savetxt(tmp_path / "ob_in_cam" / f"{number:06d}.txt", POSES[number])
    path = hand_of(tmp_path, TIMES, fps=30.0)
    found = geneoh.load(path, object_pose=tmp_path / "ob_in_cam")
    assert found.object.valid is not None
    assert np.flatnonzero(found.object.valid[:, 0]).tolist() == list(numbers)
    np.testing.assert_allclose(found.object.translation[list(numbers), 0], PLACES[list(numbers)])
    own = f"of frames {min(numbers)} to {max(numbers)}"
    assert f"the object's poses are {own}, the hand of 0 to 11" in found.source
    path = hand_of(tmp_path, TIMES[:6], fps=30.0)
    with pytest.raises(InputError, match="one for each of the 6 frames"):
        geneoh.load(path, object_pose=tmp_path / "ob_in_cam")


def test_texts_of_a_folder_are_frames_in_the_order_of_their_numbers(tmp_path):
    for number in (2, 10, 3, 5):
        np.savetxt(tmp_path / f"{number}.txt", pose(number).reshape(1 if number == 3 else 4, -1))
    given = read_poses(tmp_path)
    poses, first = given.matrices, given.first
    assert first == 2
    assert poses.shape == (9, 4, 4)
    known = np.isfinite(poses).all((1, 2))
    assert np.flatnonzero(known).tolist() == [0, 1, 3, 8]
    assert poses[known, 0, 3].tolist() == [2, 3, 5, 10]


def test_two_texts_of_one_frame_are_refused(tmp_path):
    for name in ("000003.txt", "000004.txt", "camera_4.txt"):
        np.savetxt(tmp_path / name, pose(1))
    with pytest.raises(InputError, match=r"got 000004\.txt and camera_4\.txt, which have the same"):
        read_poses(tmp_path)


def test_fewer_poses_than_frames_may_be_completed_by_nan(tmp_path):
    with pytest.raises(InputError, match="got 11; cut them to the same frames, or write NaN for"):
        geneoh.load(hand_of(tmp_path, TIMES, fps=30.0), object_pose=POSES[1:])


def test_texts_that_are_named_by_times_come_one_after_the_other(tmp_path):
    for number, time in enumerate((1581120424100262102, 1581120424148532296, 9581120424)):
        np.savetxt(tmp_path / f"{time}.txt", pose(number))
    given = read_poses(tmp_path)
    poses, first = given.matrices, given.first
    assert (poses[:, 0, 3].tolist(), first) == ([2, 0, 1], 0)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("0.npy", "", ": expected a text of a 4x4 matrix for each frame, such as 000000.txt"),
        ("notes.txt", "1 2 3", "notes.txt: expected a frame's number as the name"),
        ("0.txt", "1 2 3", "0.txt: expected rows of 4 or 16 numbers"),
        ("0.txt", "1 0 0 0\n" * 3, "0.txt: expected a 4x4 matrix, got 3 rows"),
    ],
)
def test_a_folder_of_other_files_is_refused_by_its_file(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=re.escape(words)):
        read_poses(tmp_path)


@pytest.mark.parametrize(
    "text", ["0\n0\n0.5\n0\n0\n0\n1\n", "1,0,0,0\n0,1,0,0\n0,0,1,0\n0,0,0,1\n"]
)
def test_texts_of_other_numbers_are_not_called_damaged(tmp_path, text):
    (tmp_path / "0.txt").write_text(text)
    with pytest.raises(InputError, match="write the 16 numbers of a 4x4 matrix with spaces"):
        read_poses(tmp_path)


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_poses_of_one_object_as_bop_has_them_are_in_millimetres_in_any_unit_of_the_hand(
    tmp_path, unit
):
    def image(pose, number=3):
        turn, place = pose[:3, :3].ravel().tolist(), (1000 * pose[:3, 3]).tolist()
        return {"cam_R_m2c": turn, "cam_t_m2c": place, "obj_id": number}

    images = {str(frame): [image(POSES[frame])] for frame in range(FRAMES) if frame != 4}
    path = tmp_path / "scene_gt.json"
    path.write_text(json.dumps(images))
    found = poses_of(path, "a call", unit).matrices
    assert np.isnan(found[4]).all()
    np.testing.assert_allclose(np.delete(found, 4, 0), np.delete(POSES, 4, 0), atol=1e-9)
    images["7"].append(image(POSES[7], 5))
    path.write_text(json.dumps(images))
    with pytest.raises(InputError, match="poses of one object, got 2 in an image; keep those of"):
        read_poses(path)


def test_results_of_bop_are_read_in_metres_and_the_best_of_an_image_counts(tmp_path):
    def row(frame, pose, score=0.5, number=3):
        turn, place = (" ".join(map(str, each)) for each in (pose[:3, :3].ravel(), pose[:3, 3]))
        return f"48,{frame},{number},{score},{turn},{place},-1"

    in_mm = POSES * np.array([1, 1, 1, 1000.0])
    rows = [row(frame, in_mm[frame]) for frame in range(FRAMES) if frame != 4]
    rows = [row(6, in_mm[0], score=0.1), *reversed(rows), row(7, in_mm[0], score=0.4)]
    path = tmp_path / "tracked_ycbv-test.csv"
    heading = "scene_id,im_id,obj_id,score,R,t,time"
    path.write_text("\n".join([heading, *rows]))
    found = poses_of(path, "a call").matrices
    assert np.isnan(found[4]).all()
    np.testing.assert_allclose(np.delete(found, 4, 0), np.delete(POSES, 4, 0), atol=1e-9)
    for more, words in [
        (row(9, in_mm[0], number=5), "poses of one object, got 2 by 'scene_id' and 'obj_id'"),
        (
            "48,99,3,0.5,1 0 0,0 0 0,-1",
            "9 and 3 numbers with spaces between them, got '99', 3 and",
        ),
        ("48,99,3", "got '99', 0 and 0; correct the table"),
        (row("x", in_mm[0]), "got 'x', 9 and 3"),
    ]:
        path.write_text("\n".join([heading, *rows, more]))
        with pytest.raises(InputError, match=re.escape(words)):
            read_poses(path)
