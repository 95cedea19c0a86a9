"""Hands in JSON whose points have names, or stand in a list."""

import json

import numpy as np
import pytest
from bad_inputs import good_arrays

import geneoh
from geneoh.errors import InputError
from geneoh.readers.joint_orders import ORDERS

NAMES = ["wrist", "thumb_cmc", "thumb_mcp", "thumb_ip", "thumb_tip"]
NAMES += [
    f"{finger}_finger_{joint}"
    for finger in ("index", "middle", "ring", "pinky")
    for joint in ("mcp", "pip", "dip", "tip")
]
"""Of TensorFlow.js, in OpenPose's order."""
SEGMENTS = ("Knuckle", "IntermediateBase", "IntermediateTip", "Tip")
ARKIT = ["forearmWrist", "wrist", *(f"thumb{name}" for name in SEGMENTS)]
ARKIT += [f"{finger}Finger{name}" for finger in ("index", "middle", "ring") for name in SEGMENTS]
ARKIT += [f"littleFinger{name}" for name in SEGMENTS]
FRAMES = 4
POINTS = good_arrays()["joints"][0].astype(float) + np.linspace(0, 0.1, FRAMES)[:, None, None]


def xyz(point) -> dict[str, float]:
    return dict(zip("xyz", map(float, point), strict=True))


def tfjs(points, side="Right", **more):
    """A hand of hand-pose-detection."""
    named = [{**xyz(point), "name": name} for point, name in zip(points, NAMES, strict=True)]
    flat = [{"x": 100.0, "y": 50.0, "name": name} for name in NAMES]
    return {"keypoints": flat, "keypoints3D": named, "handedness": side, "score": 0.9, **more}


def by_name(points, names=NAMES):
    return dict(zip(names, np.asarray(points).tolist(), strict=True))


def matrix(point) -> list[list[float]]:
    """A 4x4 matrix as Swift writes it: a list of its columns."""
    return [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [*point, 1.0]]


def openpose(points):
    """A file of OpenPose with --3d, of which a point of score 0 was not found."""
    numbers = np.c_[points, np.ones(21)].ravel().tolist()
    return {"people": [{"hand_left_keypoints_3d": [], "hand_right_keypoints_3d": numbers}]}


FORMS = {
    "tfjs": [[tfjs(points)] for points in POINTS],
    "tfjs with times": [
        {"timestamp": 1000 + 40 * k, "hands": [tfjs(points)]} for k, points in enumerate(POINTS)
    ],
    "tfjs by frames": {str(k): [tfjs(points)] for k, points in enumerate(POINTS)},
    "one hand": [tfjs(points) for points in POINTS],
    "by names": {"side": "right", "frames": [{"joints": by_name(points)} for points in POINTS]},
    "by sides": [{"leftHand": None, "rightHand": by_name(points)} for points in POINTS],
    "points in a list": [{"hands": [{"hand": "right", "points": p}]} for p in POINTS.tolist()],
    "columns": {"side": "right", "joints": POINTS.tolist()},
    "columns by sides": {"right": POINTS.tolist(), "left": [None] * FRAMES},
    "columns by names": {"side": "right", **by_name(POINTS.swapaxes(0, 1))},
    "arkit": [
        {
            "chirality": "right",
            "joints": {
                name: {"position": xyz(point)} for name, point in zip(ARKIT, points, strict=True)
            },
        }
        for points in np.concatenate([POINTS[:, :1], POINTS], axis=1)
    ],
    "matrices": [
        {"right": dict(zip(NAMES, map(matrix, points), strict=True))} for points in POINTS
    ],
    "quest": [
        {
            "Time": k / 72,
            "RightHand": {
                "Bones": [
                    {"Id": name, "Position": xyz(point)}
                    for name, point in zip(NAMES, points, strict=True)
                ]
            },
        }
        for k, points in enumerate(POINTS)
    ],
    "landmarks of one hand": [
        {"frame": k, "hand": "right", "landmarks": [xyz(point) for point in points]}
        for k, points in enumerate(POINTS)
    ],
    "world landmarks of one hand": [
        {"handedness": "Right", "landmarks": [[0.5, 0.5, 0.1]] * 21, "world_landmarks": points}
        for points in POINTS.tolist()
    ],
    "numbers": [{"side": "right", "joints": points.ravel().tolist()} for points in POINTS],
    "by images": {
        f"img_{k:05d}.jpg": {"right": points} for k, points in enumerate(POINTS.tolist())
    },
    "frames by numbers": {
        "side": "right",
        "frames": {f"{k:06d}": points for k, points in enumerate(POINTS.tolist())},
    },
    "openpose": [openpose(points) for points in POINTS],
    "mmpose": {
        "instance_info": [
            {"frame_id": k + 1, "instances": [{"keypoints": p, "keypoint_scores": [0.5] * 21}]}
            for k, p in enumerate(POINTS.tolist())
        ]
    },
}


@pytest.fixture
def read(tmp_path):
    """Writes a value as JSON, and reads it."""

    def through_file(value, **options):
        (tmp_path / "hand.json").write_text(json.dumps(value))
        return geneoh.load(tmp_path / "hand.json", **options)

    return through_file


@pytest.mark.parametrize("form", FORMS)
def test_a_hand_is_read_in_every_form(form, read):
    (hand,) = read(FORMS[form], side="right" if form == "mmpose" else None).hands
    assert (hand.side, hand.valid.tolist()) == ("right", [True] * FRAMES)
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


@pytest.mark.parametrize("name", ["frame", "frameIndex", "image", "fileName"])
def test_entries_of_one_frame_are_its_hands(name, read):
    numbers = [0, 1, 4, 5]
    entries = [
        {
            name: n if name.startswith("frame") else f"{n:05d}.png",
            "hand": side,
            "landmarks": hand.tolist(),
        }
        for n, points in zip(numbers, POINTS, strict=True)
        for side, hand in (("left", points * [-1, 1, 1]), ("right", points))
    ]
    del entries[2]
    sequence = read(entries)
    seen = {hand.side: np.flatnonzero(hand.valid).tolist() for hand in sequence.hands}
    assert seen == {"left": [0, 4, 5], "right": numbers}
    found = sequence.hand("right").joints[numbers]
    np.testing.assert_allclose(found, POINTS, atol=1e-6)


def test_entries_of_one_film_are_its_frames(read):
    (hand,) = read([{"file": "film_01.mp4", "right": points} for points in POINTS.tolist()]).hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


@pytest.mark.parametrize("frames", [21, 30])
@pytest.mark.parametrize("name", ["{}", "img_{:05d}.jpg"])
def test_numbers_are_those_of_frames_and_not_of_points(frames, name, read):
    points = POINTS[0] + np.linspace(0, 0.1, frames)[:, None, None]
    (hand,) = read({name.format(k): p for k, p in enumerate(points.tolist())}, side="right").hands
    np.testing.assert_allclose(hand.joints, points, atol=1e-6)


@pytest.mark.parametrize(
    "form", [lambda name, p: {name: p}, lambda name, p: [{"image": name, **p}] * 2]
)
def test_names_of_thousands_of_digits_are_no_error_of_ours(form, read):
    assert read(form("7" * 5000, {"right": POINTS[0].tolist()})).hands[0].side == "right"


def test_a_hand_of_zeros_in_every_frame_is_left_out(read):
    zeros = np.zeros((21, 3)).tolist()
    sequence = read([{"right": p, "left": zeros} for p in POINTS.tolist()])
    assert [hand.side for hand in sequence.hands] == ["right"]
    assert "the left hand is in no frame and was left out" in sequence.source


def test_points_of_tensorflow_are_about_the_centre_of_the_hand_and_others_are_not(read):
    told = "about the centre of each hand"
    assert told in read(FORMS["tfjs"]).source
    assert told not in read(FORMS["by sides"]).source
    for name in ("keypoints_3d", "joints_3d"):
        own = [{"hand": "right", name: points} for points in POINTS.tolist()]
        assert told not in read(own).source


def test_times_scores_and_frames_without_a_hand_are_kept(read):
    frames = [{"timestamp": 1000 + 40 * k, "hands": [tfjs(p)]} for k, p in enumerate(POINTS)]
    frames[1]["hands"] = []
    frames[2] = {"timestamp": 1080}
    sequence = read(frames)
    assert sequence.fps == pytest.approx(25)
    assert sequence.hands[0].valid.tolist() == [True, False, False, True]
    np.testing.assert_allclose(sequence.hands[0].confidence[0], 0.9)


@pytest.mark.parametrize("name", ["keypoint_scores", "confidence", None])
def test_scores_of_single_points_are_told_to_be_unread(name, read):
    each = [{**xyz(point), "score": 0.2} if name is None else xyz(point) for point in POINTS[0]]
    beside = {} if name is None else {name: [0.5] * 21}
    words = "the confidences of single points are not read"
    assert words in read([{"right": {"points": each, **beside}}]).source
    assert words not in read([{"right": {"points": POINTS[0].tolist(), "score": 0.5}}]).source


@pytest.mark.parametrize("name", ["timestampMs", "Time", "frameIndex"])
def test_times_may_have_names_in_any_way_of_writing(name, read):
    step = {"timestampMs": 20, "Time": 0.02, "frameIndex": 1}[name]
    frames = [{name: 5 + step * k, "right": by_name(p)} for k, p in enumerate(POINTS)]
    del frames[1]
    sequence = read(frames)
    assert sequence.hands[0].valid.tolist() == [True, False, True, True]
    assert name == "frameIndex" or sequence.fps == pytest.approx(50)


@pytest.mark.parametrize("empty", [None, [], {}, {"right": None}, {"hands": None}])
def test_a_frame_without_a_hand_may_be_empty(empty, read):
    frames = [{"right": by_name(points)} for points in POINTS]
    assert read([*frames[:3], empty]).hands[0].valid.tolist() == [True, True, True, False]


def test_points_that_were_not_found_count_for_nothing(read):
    frames = [{"right": by_name(points)} for points in POINTS]
    frames[1]["right"]["thumb_tip"] = None
    frames[2]["right"]["index_finger_tip"] = [None, None, None]
    hand = read(frames).hands[0]
    assert bool(hand.valid.all())
    arkit = json.loads(json.dumps(FORMS["arkit"]))
    arkit[3]["joints"]["wrist"] = None  # beside a point that OpenPose's hand does not have
    assert (read(arkit).hands[0].confidence == 0).nonzero().tolist() == [[3, 0]]
    lost = [(k, p) for k in range(FRAMES) for p in range(21) if hand.confidence[k, p] == 0]
    assert lost == [(1, 4), (2, 8)]
    person = FORMS["openpose"][1]["people"][0]
    numbers = [*person["hand_right_keypoints_3d"][:16], 0, 0, 0, 0]
    numbers += person["hand_right_keypoints_3d"][20:]
    hand = read([*FORMS["openpose"][:1], {"people": [{"hand_right_keypoints_3d": numbers}]}]).hands[
        0
    ]
    assert (hand.confidence[1] == 0).nonzero().flatten().tolist() == [4]


def test_a_list_of_points_may_be_in_another_order(read):
    points = np.zeros((FRAMES, 26, 3))
    points[:, ORDERS["openxr"].entries] = POINTS
    frames = [{"right": each} for each in points.tolist()]
    with pytest.raises(InputError, match=r"21 points of the order openpose, got a list of 26"):
        read(frames)
    np.testing.assert_allclose(
        read(frames, joint_order="openxr").hands[0].joints, POINTS, atol=1e-6
    )
    with pytest.raises(InputError, match="points with names, which say their order"):
        read(FORMS["by names"], joint_order="openxr")


def test_a_folder_of_openpose_is_one_recording_with_the_frames_that_it_lacks(tmp_path):
    for number, person in zip((0, 1, 3, 4), FORMS["openpose"], strict=True):
        (tmp_path / f"video2_{number:012d}_keypoints.json").write_text(json.dumps(person))
    (hand,) = geneoh.read("landmarks", tmp_path).hands
    assert hand.valid.tolist() == [True, True, False, True, True]
    np.testing.assert_allclose(hand.joints[hand.valid], POINTS, atol=1e-6)


def test_hands_of_two_people_are_refused(read):
    people = [openpose(points)["people"][0] for points in POINTS[:2]]
    with pytest.raises(
        InputError, match=r"frame 0: expected one hand of a side, got 2 right hands"
    ):
        read([{"people": people}])
    with pytest.raises(InputError, match="got 2 hands without a side"):
        read([{"hands": [by_name(POINTS[0]), by_name(POINTS[1])]}])


def test_two_hands_of_tensorflow_that_have_one_side_are_told_apart(read):
    mirrored = POINTS * [-1, 1, 1]
    frames = [[tfjs(a), tfjs(b, "Left")] for a, b in zip(POINTS, mirrored, strict=True)]
    frames[2][1]["handedness"] = "Right"
    sequence = read(frames)
    assert {hand.side for hand in sequence.hands} == {"left", "right"}
    assert all(bool(hand.valid.all()) for hand in sequence.hands)
    assert "in 1 frame both hands have one side" in sequence.source


@pytest.mark.parametrize("said", ["R", "right", "RightHand", "hand_r", "RIGHT"])
def test_a_side_may_be_written_in_any_way(said, read):
    frames = [{"side": said, "points": points} for points in POINTS.tolist()]
    assert read(frames).hands[0].side == "right"


def test_names_that_are_no_points_are_told(read):
    names = [name.replace("index_finger_tip", "pointer_end") for name in NAMES]
    with pytest.raises(InputError, match=r"names of 21 points.*, got pointer_end; rename"):
        read([{"right": by_name(points, names)} for points in POINTS])


def test_points_of_the_picture_are_refused(read):
    hands = [[tfjs(points)] for points in POINTS]
    for (hand,) in hands:
        del hand["keypoints3D"]
    with pytest.raises(InputError, match=r"have no size; save .*keypoints3D of TensorFlow.js"):
        read(hands)


def test_rows_of_a_table_as_pandas_writes_them_are_read(read):
    columns = [f"left_{name}_{axis}" for name in NAMES for axis in "xyz"]
    numbers = zip(range(FRAMES), POINTS.reshape(FRAMES, 63).tolist(), strict=True)
    rows = [{"frame": k + 3, **dict(zip(columns, row, strict=True))} for k, row in numbers]
    rows[1][columns[12]] = None
    (hand,) = read(rows).hands
    assert hand.side == "left"
    assert (hand.confidence == 0).nonzero().tolist() == [[1, 4]]
    known = hand.confidence > 0
    np.testing.assert_allclose(hand.joints[known], POINTS[known.numpy()], atol=1e-6)


@pytest.mark.parametrize("name", ["object_pose", "objectPose", "obj"])
def test_what_is_said_of_an_object_is_told_to_be_unread(name, read):
    pose = np.eye(4).tolist()
    frames = [{"right": points.tolist(), name: pose} for points in POINTS]
    beside = {"frames": [frame["right"] for frame in frames], name: [pose] * FRAMES}
    for value in (frames, {"fps": 30, "frames": frames}, beside):
        source = read(value, side="right").source
        assert f"not read of this file: '{name}'; a file of the object's poses alone" in source


def test_what_holds_no_hand_is_refused(read):
    nested = []
    for _ in range(400):
        nested = [nested]
    for value in (
        [None, []],
        [],
        {"frames": 3},
        [[1, 2], [3]],
        nested,
        {"right": "x"},
        7,
        [[10**400] * 63],
    ):
        with pytest.raises(InputError, match=r"expected hands, .* without any; see the page"):
            read(value, side="right")


def leap(points, number=0, side="right"):
    """A frame of the Leap Motion service, of which a hand in front of a sensor has millimetres."""
    places = (1000 * points).tolist()
    joints = ["mcpPosition", "pipPosition", "dipPosition", "btipPosition"]
    fingers = [
        {"handId": 7, "type": f, **dict(zip(joints, places[1 + 4 * f : 5 + 4 * f], strict=True))}
        for f in range(5)
    ]
    hand = {"id": 7, "type": side, "wrist": places[0], "palmPosition": [0.0, 200.0, 0.0]}
    hand |= {"confidence": 0.75, "timeVisible": 1.5}
    stamp = 10**9 + 8700 * number
    others = [{"handId": 9, "type": 0, "mcpPosition": [0.0, 0.0, 0.0]}]
    return {"timestamp": stamp, "hands": [hand], "pointables": [*reversed(fingers), *others]}


def test_frames_of_leap_motion_are_read_in_metres_and_microseconds(read):
    frames = [leap(points, k) for k, points in enumerate(POINTS)]
    hand = read(frames).hands[0]
    assert hand.side == "right"
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)
    assert float(hand.confidence.max()) == 0.75
    assert read(frames).fps == pytest.approx(1e6 / 8700, rel=0.02)
    said = read({"frames": frames}, keypoint_unit="mm").hands[0].joints
    np.testing.assert_allclose(said, POINTS, atol=1e-6)


def test_frames_of_leap_motion_may_lack_the_wrist_a_finger_or_a_hand(read):
    frames = [leap(points, k, "left") for k, points in enumerate(POINTS)]
    del frames[0]["hands"][0]["wrist"]
    del frames[1]["pointables"][1]
    frames[1]["pointables"] += [{"handId": 7, "type": 1.5}, {"handId": 7, "type": None}, None]
    frames[2] |= {"hands": [], "pointables": []}
    hand = read(frames).hands[0]
    assert hand.side == "left"
    assert hand.observed.tolist() == [True, True, False, True]
    trust = hand.trust
    assert (trust[0] > 0).tolist() == [False] + [True] * 20
    assert (trust[1] > 0).tolist() == [True] * 13 + [False] * 4 + [True] * 4
