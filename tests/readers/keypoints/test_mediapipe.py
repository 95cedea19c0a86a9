"""MediaPipe's own results and tables of landmarks."""

import csv
import json
import re

import numpy as np
import pytest
from bad_inputs import good_arrays

import geneoh
from geneoh.errors import InputError
from geneoh.readers.joint_orders import ORDERS

NAMES = (
    *("WRIST", "THUMB_CMC", "THUMB_MCP", "THUMB_IP", "THUMB_TIP"),
    *(
        f"{finger}_{joint}"
        for finger in ("INDEX_FINGER", "MIDDLE_FINGER", "RING_FINGER", "PINKY")
        for joint in ("MCP", "PIP", "DIP", "TIP")
    ),
)
"""MediaPipe's names of the landmarks, which are in OpenPose's order."""
FRAMES, SEEN = 5, 4
HAND = good_arrays()["joints"][0].astype(float)
POINTS = HAND + np.linspace(0, 0.1, FRAMES)[:, None, None]
POSES = np.tile(np.eye(4), (FRAMES, 1, 1))


def as_dicts(points) -> list[dict[str, float]]:
    return [dict(zip("xyz", map(float, point), strict=True)) for point in points]


def python_task(points):
    """`dataclasses.asdict` of a HandLandmarkerResult."""
    category = {"index": 0, "score": 0.9, "display_name": None, "category_name": "Right"}
    image = as_dicts(points + 0.5)
    return {
        "handedness": [[category]],
        "hand_landmarks": [image],
        "hand_world_landmarks": [as_dicts(points)],
    }


def javascript_task(points):
    """A HandLandmarkerResult in the browser."""
    named = {"score": 0.9, "index": 0, "categoryName": "Right", "displayName": "Right"}
    image, world = as_dicts(points + 0.5), as_dicts(points)
    return {"landmarks": [image], "worldLandmarks": [world], "handednesses": [[named]]}


def python_solution(points):
    """`MessageToDict` of the results of mp.solutions.hands."""
    named = {"classification": [{"index": 1, "score": 0.9, "label": "Right"}]}
    return {
        "multi_hand_world_landmarks": [{"landmark": as_dicts(points)}],
        "multi_handedness": [named],
    }


def javascript_solution(points):
    """The results of @mediapipe/hands."""
    named = {"index": 1, "score": 0.9, "label": "Right"}
    return {"multiHandWorldLandmarks": [as_dicts(points)], "multiHandedness": [named]}


@pytest.fixture
def read(tmp_path):
    """Writes results as JSON, and reads them with poses of an object."""

    def through_file(frames, **options):
        (tmp_path / "hand.json").write_text(json.dumps(frames))
        return geneoh.load(tmp_path / "hand.json", object_pose=POSES, **options)

    return through_file


@pytest.fixture
def read_table(tmp_path):
    """Writes a table, and reads it with poses of an object."""

    def through_file(header, rows, **options):
        write_table(tmp_path / "hand.csv", header, rows)
        return geneoh.load(tmp_path / "hand.csv", object_pose=POSES, **options)

    return through_file


RESULTS = (python_task, javascript_task, python_solution, javascript_solution)


@pytest.mark.parametrize("shape", RESULTS)
def test_results_are_read_without_a_source(shape, read):
    frames = [shape(points) for points in POINTS]
    frames[SEEN] = {name: [] for name in frames[SEEN]}
    (hand,) = read(frames).hands
    assert hand.side == "right"
    assert hand.valid.tolist() == [True] * SEEN + [False]
    np.testing.assert_allclose(hand.joints[:SEEN], POINTS[:SEEN], atol=1e-6)
    np.testing.assert_allclose(hand.confidence[:SEEN], 0.9, atol=1e-6)


def test_results_in_lines_and_under_frames_are_read(tmp_path):
    frames = [python_task(points) for points in POINTS]
    lines = tmp_path / "lines.jsonl"
    lines.write_text("\n".join(map(json.dumps, frames)))
    named = tmp_path / "named.json"
    named.write_text(json.dumps({"frames": frames}))
    for path in (lines, named):
        sequence = geneoh.load(path, object_pose=POSES)
        np.testing.assert_allclose(sequence.hands[0].joints, POINTS, atol=1e-6)
        assert "about the centre of each hand" in sequence.source
        assert "30 frames a second assumed" in sequence.source


def test_a_line_that_broke_off_is_named(tmp_path):
    """It was called line 1, and all other lines were good."""
    lines = [json.dumps(python_task(points)) for points in POINTS]
    path = tmp_path / "hand.jsonl"
    path.write_text("\n".join([*lines[:3], lines[3][:200]]))
    with pytest.raises(InputError, match=r"jsonl, line 4: expected JSON.*\(.*: column 201 "):
        geneoh.load(path, side="right")
    path.write_text("\n".join(lines[:3]))
    assert geneoh.load(path, side="right").frames == 3


def test_results_by_the_numbers_of_their_frames_keep_those_that_are_left_out(read):
    numbers = (0, 1, 3, 4, 5)
    results = {str(number): python_task(POINTS[k]) for k, number in enumerate(numbers)}
    (hand,) = read(dict(reversed(results.items()))).hands
    assert hand.valid.tolist() == [number in numbers for number in range(6)]
    np.testing.assert_allclose(hand.joints[list(numbers)], POINTS, atol=1e-6)


@pytest.mark.parametrize(("fps", "unit"), [(30, 1e3), (60, 1e3), (25, 1e3), (30, 1e6)])
def test_results_by_their_times_have_the_rate_of_these(fps, unit, read):
    times = [round(k * unit / fps) for k in range(FRAMES)]
    results = {str(time): python_task(POINTS[k]) for k, time in enumerate(times)}
    assert read(results).fps == pytest.approx(fps, rel=1e-3)


def test_the_rate_beside_results_is_read_and_another_one_refused(read):
    results = {"fps": 60, "frames": [python_task(points) for points in POINTS]}
    sequence = read(results)
    assert sequence.fps == 60
    assert "assumed" not in sequence.source
    with pytest.raises(InputError, match="says 60 frames a second, got --fps 30"):
        read(results, fps=30.0)


def test_two_hands_come_by_their_sides_and_the_caller_corrects_one(read):
    frame = javascript_task(HAND)
    frame["handednesses"].append([{"score": 0.8, "categoryName": "Left"}])
    frame["worldLandmarks"].append(as_dicts(HAND * [-1, 1, 1]))
    assert {hand.side for hand in read([frame] * FRAMES).hands} == {"left", "right"}
    (hand,) = read([python_task(HAND)] * FRAMES, side="left").hands
    assert hand.side == "left"


def test_wrong_labels_of_one_hand_make_no_second_hand(read):
    frames = [python_task(points) for points in POINTS]
    frames[1]["handedness"][0][0]["category_name"] = "Left"
    sequence = read(frames)
    (hand,) = sequence.hands
    assert hand.side == "right"
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)
    assert "one right hand, though 1 of 5 frames name the other side" in sequence.source
    (hand,) = read(frames, side="left").hands
    assert (hand.side, hand.valid.tolist()) == ("left", [True] * FRAMES)


def test_two_hands_in_some_frame_keep_their_own_sides(read):
    frames = [javascript_task(points) for points in POINTS]
    frames[1]["handednesses"][0][0]["categoryName"] = "Left"
    frames[3]["handednesses"].append([{"score": 0.8, "categoryName": "Right"}])
    frames[3]["worldLandmarks"].append(as_dicts(HAND * [-1, 1, 1]))
    sequence = read(frames)
    valid = {hand.side: int(hand.valid.sum()) for hand in sequence.hands}
    assert valid == {"right": 4, "left": 2}
    assert "in 1 frame both hands have one side" in sequence.source
    np.testing.assert_allclose(sequence.hand("left").joints[3], HAND * [-1, 1, 1], atol=1e-6)
    np.testing.assert_allclose(sequence.hand("right").joints[3], POINTS[3], atol=1e-6)


def two_hands(right: np.ndarray, labels: tuple[str, str]) -> dict[str, object]:
    """A result of a right hand and its image in a mirror, in this order."""
    frame = javascript_task(right)
    frame["handednesses"] = [[{"score": 0.8, "categoryName": label}] for label in labels]
    frame["worldLandmarks"].append(as_dicts(right * [-1, 1, 1]))
    return frame


def test_hands_of_one_label_are_told_apart_by_the_frames_before(read):
    labels = [("Right", "Left"), *[("Left", "Left"), ("Right", "Right")] * 2]
    frames = [two_hands(p, names) for p, names in zip(POINTS, labels, strict=True)]
    sequence = read(frames)
    np.testing.assert_allclose(sequence.hand("right").joints, POINTS, atol=1e-6)
    np.testing.assert_allclose(sequence.hand("left").joints, POINTS * [-1, 1, 1], atol=1e-6)


def test_exchanged_sides_of_two_hands_are_found_by_their_fingers(read):
    bent = POINTS.copy()
    bent[:, 4::4, 2] += 0.05
    for labels in (("Right", "Left"), ("Left", "Right")):
        sequence = read([two_hands(points, labels) for points in bent])
        np.testing.assert_allclose(sequence.hand("right").joints, bent, atol=1e-6)
        assert ("sides were exchanged" in sequence.source) == (labels[0] == "Left")


@pytest.mark.parametrize("nested", [True, False])
def test_the_holistic_landmarker_says_sides_by_its_fields(read, nested):
    frames = []
    for points in POINTS:
        right, left = as_dicts(points), as_dicts(points * [-1, 1, 1])
        names = ("right_hand_world_landmarks", "left_hand_world_landmarks")
        hands = ([right], [left]) if nested else (right, left)
        frames.append({"pose_landmarks": [], **dict(zip(names, hands, strict=True))})
    sequence = read(frames)
    np.testing.assert_allclose(sequence.hand("right").joints, POINTS, atol=1e-6)
    np.testing.assert_allclose(sequence.hand("left").joints, POINTS * [-1, 1, 1], atol=1e-6)


def test_frames_without_a_hand_may_come_first_and_results_beside_their_time(read):
    timed = [{"frame": t, "result": python_task(points)} for t, points in enumerate(POINTS)]
    timed[0] = {"frame": 0}
    (hand,) = read(timed).hands
    assert hand.valid.tolist() == [False] + [True] * (FRAMES - 1)


def test_landmarks_of_the_picture_in_an_array_are_refused(tmp_path):
    picture = POINTS.copy()
    picture[..., 2] -= picture[:, :1, 2]
    np.save(tmp_path / "hand.npy", picture + [0.5, 0.5, 0])
    with pytest.raises(InputError, match="landmarks of the picture"):
        geneoh.read("keypoints", tmp_path / "hand.npy", side="right")


def test_wrong_labels_in_a_table_make_no_second_hand(read_table):
    header, rows = long(NAMES)
    rows = [[*row[:-1], "Left" if row[1] == 12 else "Right"] for row in rows]
    (hand,) = read_table(header, rows).hands
    assert (hand.side, hand.valid.tolist()) == ("right", [True] * FRAMES)


@pytest.mark.parametrize("name", ["landmarks", "hand_landmarks", "multi_hand_landmarks"])
def test_landmarks_of_the_picture_are_refused(name, read):
    with pytest.raises(InputError, match=r"have no size; save hand_world_landmarks"):
        read([{name: [as_dicts(HAND)]}], side="right")


def test_other_json_is_refused_with_what_is_read(read):
    with pytest.raises(InputError, match=r"worldLandmarks.*got 'verts' without any"):
        read({"verts": HAND.tolist()}, side="right")


def test_frames_of_a_stream_in_a_file_are_told_how_to_be_cleaned(read):
    with pytest.raises(InputError, match=r"frames of a stream; pipe them through .*--stream"):
        read([{"right_joints": HAND.tolist()}])


def write_table(path, header, rows):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


def wide(names):
    header = ["frame", *names]
    return header, [[10 + t, *POINTS[t].ravel()] for t in range(FRAMES)]


def long(names):
    rows = [
        [t * 21 + point, 10 + t, names[point], *POINTS[t, point], "Right"]
        for t in range(FRAMES)
        for point in range(21)
    ]
    return ["", "Frame", "landmark", "x", "y", "z", "hand"], rows


LONG = ["frame", "landmark", "x", "y", "z"]
TABLES = {
    "x0": wide([f"{axis}{point}" for point in range(21) for axis in "xyz"]),
    "x_0": wide([f"{axis}_{point}" for point in range(21) for axis in "xyz"]),
    "landmark_0_x": wide([f"landmark_{point}_{axis}" for point in range(21) for axis in "xyz"]),
    "WRIST_x": wide([f"{name}_{axis}" for name in NAMES for axis in "xyz"]),
    "Wrist.X": wide([f"{name.title()}.{axis}" for name in NAMES for axis in "XYZ"]),
    "long by number": long(list(range(21))),
    "long by name": long(NAMES),
    "long by enum": long([f"HandLandmark.{name}" for name in NAMES]),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_read_without_a_source(name, read_table):
    (hand,) = read_table(*TABLES[name], side="right").hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


def test_a_table_of_more_points_than_21_is_refused(read_table):
    header, rows = TABLES["landmark_0_x"]
    more = [*header, "landmark_21_x"], [[*row, 0.5] for row in rows]
    with pytest.raises(InputError, match=r"number 21; name the order .*--joint-order"):
        read_table(*more, side="right")


FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
SEGMENTS = ("Metacarpal", "Proximal", "Intermediate", "Distal", "Tip")
OPENXR = ["Palm", "Wrist"]
OPENXR += [f"{f}{s}" for f in FINGERS for s in SEGMENTS if (f, s) != ("Thumb", "Intermediate")]
IN_CAPITALS = [re.sub(r"(?<!^)(?=[A-Z])", "_", name).upper() for name in OPENXR]
WEBXR = [re.sub("(Proximal|Interm|Distal)", r"Phalanx\1", name) for name in OPENXR]
WEBXR = [re.sub(r"(?<!^)(?=[A-Z])", "-", name).lower() for name in WEBXR]
WEBXR = [re.sub("^(index|middle|ring|little)", r"\1-finger", name) for name in WEBXR]
OF_XR = np.zeros((FRAMES, 26, 3))
OF_XR[:, ORDERS["openxr"].entries] = POINTS
AXES = ("px", "py", "pz", "qx", "qy", "qz", "qw")
POSES_OF_XR = np.concatenate([OF_XR, np.full((FRAMES, 26, 4), 0.5)], axis=2)


def wide_xr(names, columns=OF_XR):
    return ["time_s", *names], [[t / 30, *columns[t].ravel()] for t in range(FRAMES)]


def long_xr(names, skip=0):
    rows = [
        [t, "Right", names[point], *POSES_OF_XR[t, point]]
        for t in range(FRAMES)
        for point in range(skip, 26)
    ]
    return ["frame", "hand", "joint_id", *(f"{a[0]}_{a[1]}" for a in AXES)], rows


XR_TABLES = {
    "snake case": wide_xr([f"right_{n.lower()}_{axis}" for n in IN_CAPITALS for axis in "xyz"]),
    "camel case": wide_xr([f"Right{n}Pos{axis}" for n in OPENXR for axis in "XYZ"]),
    "enum": wide_xr([f"XR_HAND_JOINT_{n}_EXT_{a}" for n in IN_CAPITALS for a in AXES], POSES_OF_XR),
    "long": long_xr(OPENXR),
    "long of WebXR": long_xr(WEBXR, skip=1),
    "long by number": long_xr(range(26)),
    "x0": wide_xr([f"{axis}{point}" for point in range(26) for axis in "xyz"]),
}


@pytest.mark.parametrize("name", XR_TABLES)
def test_tables_of_headsets_are_read(name, read_table):
    """They were refused: only the names of MediaPipe and the numbers 0 to 20 were known."""
    order = "openxr" if name in ("long by number", "x0") else "openpose"
    (hand,) = read_table(*XR_TABLES[name], side="right", joint_order=order).hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


@pytest.mark.parametrize(
    "names",
    [
        {"PIP": "MiddleJoint", "MCP": "Knuckle", "DIP": "DistalJoint"},  # MRTK
        {"MCP": "1", "PIP": "2", "DIP": "3"},  # OVR
        {"MCP": "Knuckle", "PIP": "IntermediateBase", "DIP": "IntermediateTip"},  # ARKit
    ],
)
def test_joints_of_a_finger_have_other_names_in_other_programs(names, read_table):
    header, rows = TABLES["WRIST_x"]
    for old, new in names.items():
        header = [re.sub(rf"^(?!THUMB)(\w+)_{old}_", rf"\g<1>{new}_", name) for name in header]
    (hand,) = read_table(header, rows, side="right").hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


def test_two_hands_of_one_row_are_told_by_the_names_of_their_columns(read_table):
    header, rows = XR_TABLES["camel case"]
    both = [*header, *(name.replace("Right", "Left") for name in header[1:])]
    rows = [[*row, *(2 * number for number in row[1:])] for row in rows]
    hands = {hand.side: hand for hand in read_table(both, rows).hands}
    np.testing.assert_allclose(hands["right"].joints, POINTS, atol=1e-6)
    np.testing.assert_allclose(hands["left"].joints, 2 * POINTS, atol=1e-6)


def test_an_order_of_points_with_names_is_refused(read_table):
    with pytest.raises(InputError, match="points with names, which say their order; drop it"):
        read_table(*XR_TABLES["camel case"], side="right", joint_order="openxr")
    with pytest.raises(InputError, match="all 21 points, got --joint-order aria"):
        read_table(*XR_TABLES["x0"], side="right", joint_order="aria")


def test_an_order_of_points_in_json_is_refused(read):
    with pytest.raises(InputError, match="got JSON, which says its order; drop it"):
        read([python_task(points) for points in POINTS], joint_order="openxr")


def test_a_table_of_excel_keeps_the_numbers_of_its_frames(tmp_path):
    header, rows = TABLES["x0"]
    write_table(tmp_path / "hand.csv", header, [rows[0], rows[1], rows[4]])
    text = (tmp_path / "hand.csv").read_text()
    (tmp_path / "hand.csv").write_text(text, encoding="utf-8-sig")
    (hand,) = geneoh.load(tmp_path / "hand.csv", side="right", object_pose=POSES).hands
    assert hand.valid.tolist() == [True, True, False, False, True]


@pytest.mark.parametrize("stamped", [False, True])
def test_a_row_without_numbers_is_a_frame_where_no_column_numbers_them(tmp_path, stamped):
    header, rows = TABLES["x0"]
    blank = [""] * len(header)
    rows = [*rows[:2], blank, *rows[2:], blank]
    first = 0 if stamped else 1
    write_table(tmp_path / "hand.csv", header[first:], [row[first:] for row in rows])
    (hand,) = geneoh.load(tmp_path / "hand.csv", side="right").hands
    seen = [True] * FRAMES if stamped else [True, True, False, *[True] * (FRAMES - 2)]
    assert hand.valid.tolist() == seen
    np.testing.assert_allclose(hand.joints[hand.valid], POINTS, atol=1e-6)


@pytest.mark.parametrize("ending", ["csv", "json", "flat.json"])
def test_left_and_right_in_turn_without_numbers_are_the_hands_of_each_frame(tmp_path, ending):
    header = ["hand", *TABLES["x0"][0][1:]]
    hands = [("left", POINTS * [-1, 1, 1]), ("right", POINTS)]
    rows = [[side, *hand[t].ravel()] for t in range(FRAMES) for side, hand in hands]
    frames = [{"hand": row[0], "joints": row[1:]} for row in rows]
    if ending == "flat.json":
        frames = [dict(zip(header, row, strict=True)) for row in rows]
    path = tmp_path / f"hand.{ending}"

    def read(count):
        path.write_text(json.dumps(frames[:count]))
        if ending == "csv":
            write_table(path, header, rows[:count])
        return geneoh.load(path)

    sequence = read(2 * FRAMES)
    for side, hand in hands:
        np.testing.assert_allclose(sequence.hand(side).joints, hand, atol=1e-6)
    assert "each two entries are taken for one frame" in sequence.source
    for count in (2 * FRAMES - 1, 4):  # a detector may guess the side anew in each frame
        assert len(read(count).hands) == 1


def test_numbered_images_tell_which_frames_are_left_out(tmp_path):
    header, rows = TABLES["x0"]
    images = [f"video/frame_{n:04d}.jpg" for n in (7, 8, 9, 12, 13)]
    named = [[image, *row[1:]] for image, row in zip(images, rows, strict=True)]
    write_table(tmp_path / "hand.csv", ["image", *header[1:]], named)
    frames = [
        {"file_name": image, "right": points}
        for image, points in zip(images, POINTS.tolist(), strict=True)
    ]
    (tmp_path / "hand.json").write_text(json.dumps(frames))
    for name in ("hand.csv", "hand.json"):
        (hand,) = geneoh.load(tmp_path / name, side="right").hands
        assert hand.valid.tolist() == [True, True, True, False, False, True, True]
        np.testing.assert_allclose(hand.joints[hand.valid], POINTS, atol=1e-6)


@pytest.mark.parametrize("name", ["HAND.CSV", "HAND.JSON", "HAND.JSONL", "HAND.NPY"])
def test_endings_may_be_in_capitals(name, tmp_path):
    path = tmp_path / name
    if name.endswith("CSV"):
        write_table(path, *TABLES["x0"])
    elif name.endswith("NPY"):
        with path.open("wb") as file:
            np.save(file, POINTS)
    else:
        lines = [json.dumps(python_task(points)) for points in POINTS]
        path.write_text("\n".join(lines) if name.endswith("L") else f"[{','.join(lines)}]")
    (hand,) = geneoh.load(path, side="right", object_pose=POSES).hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


def test_decimal_commas_are_read_where_semicolons_separate_cells(tmp_path):
    path = tmp_path / "hand.csv"
    write_table(path, *TABLES["x0"])
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    (hand,) = geneoh.load(path, side="right", object_pose=POSES).hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


def test_decimal_commas_between_commas_are_refused(tmp_path):
    path = tmp_path / "hand.csv"
    write_table(path, *TABLES["x0"])
    path.write_text(path.read_text().replace(".", ","))
    with pytest.raises(InputError, match=r"one with 63 cells more; where decimals have commas"):
        geneoh.load(path, side="right", object_pose=POSES)


def test_a_frame_or_a_landmark_that_a_table_lacks_is_not_observed(read_table):
    """All of a frame was lost where a single landmark was."""
    header, rows = long(NAMES)
    kept = [row for row in rows if row[1] != 12 and (row[1], row[2]) != (13, "PINKY_TIP")]
    (hand,) = read_table(header, kept).hands
    assert hand.side == "right"
    assert hand.valid.tolist() == [True, True, False, True, True]
    assert (hand.confidence[hand.valid] == 0).nonzero().tolist() == [[2, 20]]


@pytest.mark.parametrize("cell", ["1,052.3", "0,1052", "1 052.3", "x0"])
def test_a_cell_of_another_way_to_write_numbers_is_refused(cell, read_table):
    """Its frame counted as one without a hand, and nothing said so."""
    header, rows = TABLES["x0"]
    rows = [list(row) for row in rows]
    rows[1][header.index("z3")] = cell
    with pytest.raises(InputError, match=f"line 3: 'z3' must be a number.*got '{cell}'"):
        read_table(header, rows, side="right")


@pytest.mark.parametrize("cell", ["", "N/A", "#DIV/0!", "-1.#IND", "null"])
def test_a_cell_without_a_number_is_not_observed(cell, read_table):
    header, rows = TABLES["x0"]
    rows = [list(row) for row in rows]
    rows[1][header.index("z3")] = cell
    (hand,) = read_table(header, rows, side="right").hands
    assert (hand.confidence == 0).nonzero().tolist() == [[1, 3]]


def test_confidences_of_a_table_are_told_to_be_unread(read_table):
    header, rows = TABLES["x0"]
    words = "the confidences in its columns are not read"
    assert words not in read_table(header, rows, side="right").source
    more = [[*row, 0.5] for row in rows]
    assert words in read_table([*header, "x20_score"], more, side="right").source


def test_the_unit_of_a_table_can_be_said(read_table):
    header, rows = TABLES["x0"]
    in_mm = [[row[0], *(1000 * number for number in row[1:])] for row in rows]
    (hand,) = read_table(header, in_mm, side="right", keypoint_unit="mm").hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


@pytest.mark.parametrize(
    ("header", "rows", "words"),
    [
        (["a", "b"], [[1, 2]], "x0, y0, z0 to z20 or WRIST_x"),
        (LONG, [["one", 3, 0, 0, 0]], "line 2 must have"),
        (LONG, [[1, 40, 0, 0, 0]], "the 21 points of the order openpose, 0 to 20, got number 40"),
        (LONG, [], "expected rows"),
        (LONG, [[0, 0, 0, 0, 0], [9e8, 0, 0, 0, 0]], "expected rows"),
    ],
)
def test_other_tables_are_refused_with_what_is_read(header, rows, words, read_table):
    with pytest.raises(InputError, match=words):
        read_table(header, rows, side="right")


def test_a_table_of_the_picture_is_refused_by_its_wrist_without_depth(read_table):
    header, _ = TABLES["x0"]
    image = HAND - HAND[0] + [0.4, 0.5, 0]
    with pytest.raises(InputError, match="have no size"):
        read_table(header, [[0, *image.ravel()], [1, *image.ravel()]], side="right")


def test_a_npy_of_keypoints_is_read_without_a_source(tmp_path):
    np.save(tmp_path / "hand.npy", POINTS)
    (hand,) = geneoh.load(tmp_path / "hand.npy", side="right", object_pose=POSES).hands
    np.testing.assert_allclose(hand.joints, POINTS, atol=1e-6)


def test_a_table_without_a_heading_is_told(tmp_path):
    """Its first row was taken for the names of its columns."""
    np.savetxt(tmp_path / "hand.csv", POINTS.reshape(FRAMES, 63), delimiter=",")
    with pytest.raises(InputError, match="a table with a heading, got numbers in its first line"):
        geneoh.load(tmp_path / "hand.csv", side="right")


@pytest.mark.parametrize(
    "form", [".poses[{}].position.{}", "field.poses{}.position.{}", "poses_{}.position.{}"]
)
def test_tables_of_bags_of_ros_are_read(form, read_table):
    """Of geometry_msgs/PoseArray, by rosbag, rostopic and bagpy."""
    axes = [(point, axis) for point in range(21) for axis in "xyz"]
    names = [form.format(*each) for each in axes]
    turns = [name.replace("position", "orientation") for name in names]
    start = 1_700_000_000_000_000_000
    rows = [
        [start + round(1e9 * k / 30), k, "camera", *POINTS[k].ravel(), *np.zeros(63)]
        for k in range(FRAMES)
    ]
    header = ["%time", "header.seq", "header.frame_id", *names, *turns]
    sequence = read_table(header, rows, side="right")
    np.testing.assert_allclose(sequence.hands[0].joints, POINTS, atol=1e-6)
    assert sequence.fps == pytest.approx(30)


def test_more_hands_than_one_of_a_side_are_told(read):
    """The surest one was taken, and nothing said so."""
    frames = [python_task(points) for points in POINTS]
    for name in ("handedness", "hand_world_landmarks", "hand_landmarks"):
        frames[2][name] = 3 * frames[2][name]
    assert "in 1 frame more hands than one of a side: the surest is kept" in read(frames).source


@pytest.mark.parametrize(
    "form",
    ["2024-01-01 10:00:{:06.3f}", "2024-01-01T10:00:{:06.3f}Z", "2024-01-01T10:00:{:06.3f}+02:00"],
)
def test_times_of_a_table_may_be_dates(form, read_table):
    header, rows = TABLES["x0"]
    rows = [[form.format(k / 25), *row] for k, row in enumerate(rows)]
    blank = [""] * len(rows[0])
    sequence = read_table(["timestamp", *header], [rows[0], blank, *rows[1:]], side="right")
    assert sequence.fps == pytest.approx(25)
    np.testing.assert_allclose(sequence.hands[0].joints, POINTS, atol=1e-6)


@pytest.mark.parametrize("name", ["hand.json", "hand.jsonl"])
@pytest.mark.parametrize(
    "text", [lambda f: "\n".join(map(json.dumps, f)), lambda f: json.dumps(f, indent=1)]
)
def test_json_of_another_ending_is_read(name, text, tmp_path):
    """Advice was to copy the file again."""
    (tmp_path / name).write_text(text([python_task(points) for points in POINTS]))
    assert geneoh.load(tmp_path / name).frames == FRAMES
