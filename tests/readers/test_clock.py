"""Recordings whose frames are not evenly apart are read at the times that their files say."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from bad_inputs import good_arrays
from trees import written

import geneoh
from geneoh.errors import InputError
from geneoh.readers.clock import Clock, clock_of
from geneoh.readers.records import Record

KEPT = np.array([1, 2, 4, 5, 9])
"""Numbers of the frames that are in a file."""
EVERY = KEPT[-1] - KEPT[0] + 1
HAND = good_arrays()["joints"][0].astype(np.float64)
SPEED = 0.6
"""Metres a second."""


def joints_at(seconds: np.ndarray) -> np.ndarray:
    """A hand that moves at a constant speed."""
    return HAND + SPEED * seconds[:, None, None] * np.array([1.0, 0, 0])


def fields(seconds: np.ndarray, **more) -> dict[str, np.ndarray]:
    """Fields of bare keypoints beside an object that moves with the hand."""
    pose = np.tile(np.eye(4), (len(seconds), 1, 1))
    pose[:, 0, 3] = SPEED * seconds
    joints = joints_at(seconds).astype(np.float32)
    return {"joints": joints, "obj_pose": pose, "side": np.array("right"), **more}


def clock(**field) -> Clock:
    ((name, values),) = field.items()
    found = clock_of(Record("file", {name: np.asarray(values)}), len(values), None)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("name", "values", "fps"),
    [
        ("frame_ids", KEPT, 30.0),
        ("frame", 7 + KEPT.astype(float), 30.0),
        ("timestamps", KEPT / 25, None),
        ("time", 1e6 + 1000 * KEPT / 25, None),
        ("timestamps_us", 1e6 * KEPT / 25, None),
        ("timestamp", 10**18 + 40_000_000 * KEPT, 25.0),
        ("timestamps", np.datetime64("2026-01-01", "ns") + 40_000_000 * KEPT, None),
        ("time_ms", (40_000_000 * KEPT).astype("m8[ns]"), None),
    ],
)
def test_frames_that_are_left_out_count_as_not_observed(name, values, fps, tmp_path):
    rate = fps or 25.0
    said = {} if fps is None else {"fps": np.array(fps)}
    np.savez(tmp_path / "hand.npz", **fields(KEPT / rate, **{name: values}, **said))
    sequence = geneoh.load(tmp_path / "hand.npz", object_pose=None)
    (hand,) = sequence.hands
    assert sequence.fps == rate
    assert np.flatnonzero(hand.valid).tolist() == (KEPT - KEPT[0]).tolist()
    assert sequence.object.valid[:, 0].tolist() == hand.valid.tolist()
    np.testing.assert_array_equal(hand.joints[hand.valid], joints_at(KEPT / rate).astype("f4"))
    assert bool(hand.joints[~hand.valid].isnan().all())
    assert f"4 of 9 frames are left out by '{name}'" in sequence.source


@pytest.mark.parametrize("name", ["FPS", "frame_rate", "frameRate", "framerate"])
@pytest.mark.parametrize("ending", ["npz", "json"])
def test_a_rate_is_read_by_each_of_its_names(name, ending, tmp_path):
    joints = joints_at(KEPT / 24)
    np.savez(tmp_path / "hand.npz", side="right", joints=joints, **{name: 24})
    value = {"side": "right", "joints": joints.tolist(), name: 24}
    (tmp_path / "hand.json").write_text(json.dumps(value))
    sequence = geneoh.load(tmp_path / f"hand.{ending}")
    assert sequence.fps == 24
    assert "assumed" not in sequence.source


def test_uneven_times_are_read_at_even_ones(tmp_path):
    times = np.arange(60) / 30
    times[1:-1] += np.random.default_rng(0).uniform(-0.01, 0.01, 58)
    np.savez(tmp_path / "hand.npz", **fields(times, time=times, fps=np.array(30.0)))
    sequence = geneoh.load(tmp_path / "hand.npz")
    assert sequence.frames == 60
    assert bool(sequence.hands[0].valid.all())
    at = joints_at(np.arange(60) / 30)
    np.testing.assert_allclose(sequence.hands[0].joints, at, atol=1e-5)
    np.testing.assert_allclose(sequence.object.translation[:, 0, 0], SPEED * np.arange(60) / 30)
    assert "not even by 'time'" in sequence.source


def test_even_times_change_nothing(tmp_path):
    times = np.arange(40) / 30
    np.savez(tmp_path / "plain.npz", **fields(times, fps=np.array(30.0)))
    rounded = np.round(1000 * times)
    np.savez(tmp_path / "timed.npz", **fields(times, timestamp_ms=rounded))
    plain, timed = (geneoh.load(tmp_path / f"{name}.npz") for name in ("plain", "timed"))
    assert timed == replace(plain, source=timed.source)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"time": np.arange(9) / 10, "fps": np.array(30.0)}, "'time' says 10 frames a second"),
        ({"frame": [0, 1, 2, 3, 0, 1, 2, 3, 4], "fps": np.array(30.0)}, "rise from frame to"),
        ({"time": np.full(9, np.nan)}, "rise from frame to frame"),
        ({"time": 2.0 * np.arange(9)}, "'time_s', 'time_ms'"),
        ({"frame": np.append(np.arange(8), 10**7), "fps": np.array(30.0)}, "less than 108000"),
    ],
)
def test_times_that_can_be_none_are_refused(more, words, tmp_path):
    np.savez(tmp_path / "hand.npz", **fields(np.arange(9) / 30, **more))
    with pytest.raises(InputError, match=words):
        geneoh.load(tmp_path / "hand.npz")


@pytest.mark.parametrize("fps", [5, 240])
@pytest.mark.parametrize("start", [0, 1000.5, 1.7e9])
def test_the_unit_of_times_at_5_and_at_240_frames_a_second_is_found(fps, start):
    times = start + np.arange(600) / fps
    assert clock(time=times).fps == fps
    assert clock(time=1000 * times).fps == fps
    assert clock(time=np.round(1000 * times)).fps == pytest.approx(fps, rel=1e-3)


def test_an_hour_at_a_high_rate_is_read_by_its_times():
    assert clock(time=np.arange(240 * 3600) / 240).fps == 240


def test_fields_that_are_no_column_of_numbers_are_left_alone(tmp_path):
    other = {"frames": np.array([0, 9]), "time": np.array(3.0), "frame": np.array(["a"] * 9)}
    np.savez(tmp_path / "hand.npz", **fields(np.arange(9) / 30, fps=np.array(30.0), **other))
    assert geneoh.load(tmp_path / "hand.npz").frames == 9


def test_numbers_a_constant_step_apart_are_a_lower_rate(tmp_path):
    kept = np.array([0, 4, 8, 16])
    np.savez(tmp_path / "hand.npz", **fields(kept / 120, frame=kept, fps=np.array(120.0)))
    sequence = geneoh.load(tmp_path / "hand.npz")
    assert sequence.fps == 30
    assert sequence.hands[0].valid.tolist() == [True, True, True, False, True]
    assert "one frame in 4" in sequence.source


def test_rate_is_found_beside_gaps_and_jitter():
    noise = np.random.default_rng(1)
    for fps in (10, 30, 60):
        kept = np.flatnonzero(noise.random(400) < 0.7)
        times = (kept + noise.normal(0, 0.03, len(kept))) / fps
        assert clock(time=times).fps == fps


def test_a_stated_rate_holds_where_times_are_uneven():
    noise = np.random.default_rng(2)
    for _ in range(50):
        kept = np.flatnonzero(noise.random(60) < 0.8)
        times = (kept + noise.uniform(-0.2, 0.2, len(kept))) / 30
        found = clock_of(Record("file", {"time": times}), len(times), 30.0)
        assert found is not None
        assert found.fps == 30


def test_a_rate_that_is_nearly_that_of_the_times_gives_way():
    found = clock_of(Record("file", {"time": np.arange(200) / 28.4}), 200, 30.0)
    assert found is not None
    assert found.fps == pytest.approx(28.4)


def test_bare_arrays_are_read_at_their_times(tmp_path):
    np.savez(tmp_path / "hand.npz", joints=joints_at(KEPT / 30), frame_ids=KEPT)
    poses = np.tile(np.eye(4), (len(KEPT), 1, 1))
    sequence = geneoh.read("keypoints", tmp_path / "hand.npz", side="right", object_pose=poses)
    assert np.flatnonzero(sequence.hands[0].valid).tolist() == (KEPT - KEPT[0]).tolist()
    pose, wrist = np.zeros((len(KEPT), 48)), joints_at(KEPT / 30)[:, 0]
    np.savez(tmp_path / "pose.npz", pose=pose, trans=wrist, timestamps=KEPT / 50)
    how = {"side": "right", "translation": "wrist"}
    sequence = geneoh.read("parameters", tmp_path / "pose.npz", **how)
    assert (sequence.fps, sequence.frames) == (50, EVERY)


def results(seconds: np.ndarray, **stamps) -> list[dict]:
    """MediaPipe's results with something of time in each."""
    frames = []
    for index, points in enumerate(joints_at(seconds)):
        landmarks = [dict(zip("xyz", map(float, point), strict=True)) for point in points]
        frames.append({name: float(values[index]) for name, values in stamps.items()})
        frames[-1] |= {"hand_world_landmarks": [landmarks]}
    return frames


@pytest.mark.parametrize(("name", "words"), [("frame", "{0:06d}"), ("time", "{1:.6f}")])
def test_times_and_numbers_of_json_may_be_texts(name, words, tmp_path):
    frames = results(KEPT / 30)
    for frame, number in zip(frames, KEPT.tolist(), strict=True):
        frame[name] = words.format(number, number / 30)
    (tmp_path / "hand.json").write_text(json.dumps(frames))
    sequence = geneoh.load(tmp_path / "hand.json", side="right")
    assert sequence.fps == pytest.approx(30)
    assert np.flatnonzero(sequence.hands[0].valid).tolist() == (KEPT - KEPT[0]).tolist()


@pytest.mark.parametrize("stamps", [{"timestamp_ms": 1000 * KEPT / 30}, {"frame": KEPT}])
def test_times_in_results_of_mediapipe_are_read(stamps, tmp_path):
    path = tmp_path / "hand.jsonl"
    path.write_text("\n".join(map(json.dumps, results(KEPT / 30, **stamps))))
    sequence = geneoh.load(path, side="right")
    assert sequence.fps == 30
    assert np.flatnonzero(sequence.hands[0].valid).tolist() == (KEPT - KEPT[0]).tolist()
    assert ("assumed" in sequence.source) == ("frame" in stamps)


def write_table(path: Path, head: list[str], rows: list[list]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(head)
        writer.writerows(rows)


def test_the_camera_is_told_for_frames_that_are_left_out():
    told = fields(KEPT / 60, frame_ids=KEPT, fps=60.0, camera_ray=[0.0, 0.0, 2.0])
    told = {name: value for name, value in told.items() if name not in ("joints", "side")}
    (hand,) = geneoh.from_arrays(right_joints=joints_at(KEPT / 60), **told).hands
    assert hand.camera_ray.tolist() == [[0, 0, 1]] * EVERY


def test_the_unit_and_the_times_of_our_own_json_are_read(tmp_path):
    points = (1000 * joints_at(KEPT / 60)).tolist()
    value = {"format": "geneoh-landmarks", "version": 1, "camera": [0, 0, 500]}
    value["stamps"] = (1e18 + 1e9 * KEPT / 60).tolist()
    value["hands"] = {"right": [{"points": hand} for hand in points]}
    (tmp_path / "hand.json").write_text(json.dumps(value))
    sequence = geneoh.load(tmp_path / "hand.json", keypoint_unit="mm")
    (hand,) = sequence.hands
    assert sequence.fps == 60
    assert np.flatnonzero(hand.valid).tolist() == (KEPT - KEPT[0]).tolist()
    np.testing.assert_allclose(hand.joints[hand.valid], joints_at(KEPT / 60), atol=1e-6)
    to_wrist = hand.joints[0, 0] - torch.tensor([0, 0, 0.5])
    torch.testing.assert_close(hand.camera_ray[0], to_wrist / to_wrist.norm())


def test_times_in_tables_are_read(tmp_path):
    names = [f"{axis}{k}" for k in range(21) for axis in "xyz"]
    values = joints_at(KEPT / 60).reshape(len(KEPT), 63).tolist()
    stamps = [[f"{time:.4f}", *row] for time, row in zip(KEPT / 60, values, strict=True)]
    write_table(tmp_path / "wide.csv", ["Timestamp", *names], stamps)
    points = [
        [frame, f"{frame / 60:.4f}", k, *point]
        for frame, hand in zip(KEPT, joints_at(KEPT / 60), strict=True)
        for k, point in enumerate(hand)
    ]
    write_table(tmp_path / "long.csv", ["frame", "time", "landmark", "x", "y", "z"], points)
    timed = [row[1:] for row in points]
    write_table(tmp_path / "timed.csv", ["time", "landmark", "x", "y", "z"], timed)
    of_ros = [[int(frame / 60), int(frame / 60 % 1 * 1e9)] for frame in KEPT]
    of_ros = [[*stamp, *row] for stamp, row in zip(of_ros, values, strict=True)]
    write_table(tmp_path / "ros.csv", ["header.stamp.sec", "header.stamp.nanosec", *names], of_ros)
    for name in ("wide.csv", "long.csv", "timed.csv", "ros.csv"):
        sequence = geneoh.load(tmp_path / name, side="right")
        assert sequence.fps == 60, name
        assert np.flatnonzero(sequence.hands[0].valid).tolist() == (KEPT - KEPT[0]).tolist()
        seen = sequence.hands[0].joints[sequence.hands[0].valid]
        np.testing.assert_allclose(seen, joints_at(KEPT / 60), atol=1e-6)


def test_times_that_are_no_numbers_are_told(tmp_path):
    path = tmp_path / "hand.json"
    dates = [f"2026-01-01T10:00:0{second}" for second in range(len(KEPT))]
    frames = [r | {"timestamp": d} for r, d in zip(results(KEPT / 30), dates, strict=True)]
    path.write_text(json.dumps({"frames": frames}))
    assert "'timestamp' is not one number" in geneoh.load(path, side="right").source
    assert "'frames'" not in geneoh.load(path, side="right").source
    np.savez(tmp_path / "hand.npz", **fields(KEPT / 30, timestamps=np.array(dates)))
    assert "'timestamps' is not one number" in geneoh.load(tmp_path / "hand.npz").source
    np.savez(tmp_path / "hand.npz", **fields(KEPT / 30, timestamps=KEPT[1:] / 30))
    assert "'timestamps' is not one number" in geneoh.load(tmp_path / "hand.npz").source


@pytest.mark.parametrize(
    ("frame", "time", "words"),
    [(2, 0.0, "got 0 after 0.0.* in frame 2"), (1, np.nan, "nan after 0 in frame 1")],
)
def test_times_that_do_not_rise_are_refused_with_the_frame_that_shows_it(
    frame, time, words, tmp_path
):
    times = np.arange(len(KEPT)) / 30
    times[frame] = time
    np.savez(tmp_path / "hand.npz", **fields(KEPT / 30, timestamps=times))
    with pytest.raises(InputError, match=f"'timestamps' must be numbers that rise .*{words}"):
        geneoh.load(tmp_path / "hand.npz")


@pytest.mark.parametrize(
    ("times", "remedy"),
    [
        (1.7e9 + KEPT / 30, "float32 has too few digits for them: save them as float64"),
        (1.7e18 + 1e9 * KEPT / 30, "float32 has too few digits for them: save them as float64"),
        (KEPT[[0, 1, 1, 3, 4]] / 30, "leave out the frames that have none or that of the one"),
        (KEPT[[0, 1, 2, 0, 1]] / 30, "cut the recording where they start again"),
    ],
)
def test_times_that_do_not_rise_are_told_to_be_of_few_digits_where_they_are(
    times, remedy, tmp_path
):
    np.savez(tmp_path / "hand.npz", **fields(KEPT / 30, timestamps=times.astype(np.float32)))
    with pytest.raises(InputError, match=remedy):
        geneoh.load(tmp_path / "hand.npz")


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (["", "", ""], "line 2 must have the number or the time of its frame"),
        (["0", "0.5", "10:00"], "line 4 must have"),
        (["0", "0.1", "0.1"], "landmark 0 twice in frame 2"),
    ],
)
def test_tables_whose_times_tell_no_frames_are_refused(times, words, tmp_path):
    names = [f"{axis}{k}" for k in range(21) for axis in "xyz"]
    rows = [[time, *HAND.ravel()] for time in times]
    write_table(tmp_path / "hand.csv", ["time", *names], rows)
    with pytest.raises(InputError, match=words):
        geneoh.load(tmp_path / "hand.csv", side="right")


def test_frames_that_aria_left_out_are_not_observed(tmp_path):
    case = written("aria", tmp_path)
    table = tmp_path / "hand_tracking/hand_tracking_results.csv"
    lines = table.read_text().splitlines()
    table.write_text("\n".join(lines[:3] + lines[4:]))
    sequence = geneoh.read("aria", tmp_path)
    assert sequence.fps == case.fps
    assert np.flatnonzero(~sequence.hands[0].valid).tolist() == [2]
