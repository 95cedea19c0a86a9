"""`geneoh denoise --stream` as a tracker pipes into it: lines, bad lines, a reader that leaves."""

import errno
import io
import json
import re
from importlib import import_module

import msgpack
import numpy as np
import pytest
import torch
from bad_inputs import BOX_CORNERS, good_arrays, write_mesh
from click.testing import CliRunner

from geneoh.denoisers.library import Denoisers
from geneoh.pipeline.streaming import recent
from geneoh.pipeline.streaming import stream as stream_module
from geneoh.pipeline.streaming.stream import Stream
from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.npz.files import hand_arrays

RUN = ("denoise", "--stream", "--lag", "0.1")


@pytest.fixture(autouse=True)
def unmoved(monkeypatch):
    """Stages and a fit that leave the hand as it is: what a stream is worth is tested elsewhere."""

    def same(run, surface, poses, near, chosen, fps, **more):
        noise = torch.randn(2, *run.subject.joints.shape, generator=run.generator)
        return run.subject.joints + 0.001 * noise, near

    none = object.__new__(Denoisers)
    monkeypatch.setattr(stream_module, "load_denoisers", lambda *given, **more: none)
    monkeypatch.setattr(recent.RecentRun, "relied_on", same)
    monkeypatch.setattr(recent, "fit_hand", lambda target, trust, shaped, start, **more: start)


@pytest.fixture
def lines(tmp_path) -> list[dict]:
    """Frames of a hand at a box, whose mesh is in `object.obj`."""
    write_mesh(tmp_path / "object.obj", BOX_CORNERS)
    arrays = good_arrays()
    rows = [
        {
            "right_joints": arrays["joints"][frame].tolist(),
            "object_rotation": arrays["object_rotation"][frame].tolist(),
            "object_translation": arrays["object_translation"][frame].tolist(),
        }
        for frame in range(len(arrays["joints"]))
    ]
    return [dict(rows[frame % len(rows)]) for frame in range(12)]


@pytest.fixture
def stream(command, tmp_path, monkeypatch):
    """Run `geneoh denoise --stream ARGUMENTS` on lines of text."""
    monkeypatch.chdir(tmp_path)

    def run(given: list | bytes, *arguments: str, code: int = 0):
        text = given
        if not isinstance(given, bytes):
            text = "".join(
                (line if isinstance(line, str) else json.dumps(line)) + "\n" for line in given
            )
        result = CliRunner().invoke(command, [*RUN, *arguments], input=text)
        assert result.exit_code == code, result.output
        return result

    return run


def test_every_line_comes_out_once_with_its_pose(stream, lines):
    result = stream(lines, "--obj", "object.obj")
    found = [json.loads(line) for line in result.stdout.splitlines()]
    assert [line["frame"] for line in found] == list(range(12))
    for line, given in zip(found, lines, strict=True):
        assert line["object_rotation"] == given["object_rotation"]
        assert np.shape(line["right_joints"]) == (21, 3)
        assert np.shape(line["right_joint_spread"]) == (21,)
        assert np.shape(line["right_finger_contact"]) == (5,)
        assert line["right_filled"] is False


def test_the_command_gives_what_python_gives(stream, lines):
    result = stream(lines, "--obj", "object.obj", "--seed", "3")
    python, found = Stream("object.obj", lag=0.1, seed=3), []
    for line in lines:
        pose = (line["object_rotation"], line["object_translation"])
        found.append(python.push(line["right_joints"], pose))
    found = [frame for frame in found if frame] + python.flush()
    for line, frame in zip(map(json.loads, result.stdout.splitlines()), found, strict=True):
        for name, values in hand_arrays(frame.hand).items():
            if name in line:
                np.testing.assert_allclose(line[name], np.squeeze(values), atol=1e-6)


def test_the_pose_of_a_moving_camera_is_taken_and_written(stream, lines):
    for number, line in enumerate(lines):
        camera = np.eye(4)
        camera[:3, 3] = 0.01 * number
        line["camera_to_world"] = camera.tolist()
    result = stream(lines, "--obj", "object.obj", "--seed", "3")
    python, found = Stream("object.obj", lag=0.1, seed=3), []
    for line in lines:
        pose = (line["object_rotation"], line["object_translation"])
        camera = line["camera_to_world"]
        found.append(python.push(line["right_joints"], pose, camera_to_world=camera))
    found = [frame for frame in found if frame] + python.flush()
    written = map(json.loads, result.stdout.splitlines())
    for line, frame, given in zip(written, found, lines, strict=True):
        np.testing.assert_allclose(line["right_joints"], frame.hand.joints[0], atol=1e-6)
        assert line["camera_to_world"] == given["camera_to_world"]
    del lines[4]["camera_to_world"]
    assert "in every frame or in none" in stream(lines, "--obj", "object.obj", code=2).stderr


def test_msgpack_in_gives_the_same_frames_as_msgpack(stream, lines):
    packed = b"".join(map(msgpack.packb, lines))
    result = stream(packed, "--obj", "object.obj")
    asked = [json.loads(line) for line in stream(lines, "--obj", "object.obj").stdout.splitlines()]
    assert list(msgpack.Unpacker(io.BytesIO(result.stdout_bytes))) == asked


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (b"\x81\xc1", "frame 2: expected a frame as a msgpack map"),
        (b"\x05", "frame 2: expected a frame as a msgpack map.*got 5"),
        (b"\x81\x01\x02", "frame 2: .*with names as its keys"),
        (b"\x82\xa1a", "frame 2: .*got the beginning of one"),
        (b"\x81\xa1a\xdb\x7f\xff\xff\xff", "frame 2: .*got the beginning of one"),
    ],
)
def test_what_is_no_msgpack_frame_is_told_with_its_number(stream, lines, bad, said):
    result = stream(b"".join(map(msgpack.packb, lines[:2])) + bad, "--obj", "object.obj", code=2)
    assert re.search(said, result.stderr), result.stderr


def test_what_comes_out_can_be_piped_in_again(stream, lines):
    once = stream(lines, "--obj", "object.obj").stdout.splitlines()
    again = stream(once, "--obj", "object.obj")
    assert len(again.stdout.splitlines()) == 12


def test_both_hands_and_lost_ones_are_cleaned(stream, lines):
    for line in lines:
        line["left_joints"] = (np.array(line["right_joints"]) * [-1, 1, 1]).tolist()
    lines[0]["left_joints"] = None
    del lines[5]["right_joints"]
    lines[6]["object_rotation"] = lines[6]["object_translation"] = None
    found = [json.loads(line) for line in stream(lines, "--obj", "object.obj").stdout.splitlines()]
    assert [line["frame"] for line in found if line["right_filled"]] == [5]
    assert [line["frame"] for line in found if line["left_filled"]] == [0]
    assert all(np.isfinite(line["left_joints"]).all() for line in found)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("no json", "line 5: expected a frame as a JSON object"),
        ("[1, 2]", "line 5: expected a frame as a JSON object"),
        ("[" * 100_000, "line 5: expected a frame as a JSON object"),
        ('{"right_joints": [1, 2]}', "line 5: 'right_joints' must be numbers of shape"),
        ('{"right_joints": "far away"}', "line 5: 'right_joints' must be an array of numbers"),
        ('{"object_rotation": [[1]]}', "line 5: expected 'object_rotation' together with"),
        ('{"x": "' + "y" * 2**20 + '"}', "line 5: expected one frame of at most"),
    ],
)
def test_a_bad_line_is_one_sentence_and_those_before_it_are_out(stream, lines, line, words):
    result = stream([*lines[:4], line, *lines], "--obj", "object.obj", code=2)
    (said,) = result.stderr.splitlines()
    assert said.startswith("Error: standard input, " + words), said
    assert [json.loads(line)["frame"] for line in result.stdout.splitlines()] == [0]


def test_a_first_line_without_a_hand_is_refused(stream):
    result = stream(['{"joints": null}'], code=2)
    assert "line 1: the first frame must name its hands" in result.stderr


def test_a_first_line_without_the_places_of_a_hand_is_refused(stream):
    result = stream([{"right_confidence": [1.0] * 21}], code=2)
    assert "line 1: the first frame must name its hands" in result.stderr


def test_a_first_line_without_the_hand_that_is_asked_for_is_refused(stream, lines):
    result = stream(lines, "--obj", "object.obj", "--side", "left", code=2)
    assert result.stdout == ""
    assert "such as 'left_joints'" in result.stderr
    assert "or correct --side left" in result.stderr


@pytest.mark.parametrize("given", [b"", b"\n \n"])
def test_a_stream_without_a_frame_is_told_in_one_sentence(stream, given):
    result = stream(given, code=2)
    assert result.stdout == ""
    (said,) = result.stderr.splitlines()
    assert said.startswith("Error: standard input: expected the frames of a hand, ")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--preset", "paper"), "a stream has the presets 'default' and 'fast'"),
        (("--fps", "5000"), "a stream has fps from 1 to 1000"),
        (("--device", "cuda:99"), "cuda:99"),
        (("--side", "left", "--hand", "mano", "--mano", "."), "MANO_LEFT.pkl"),
    ],
)
def test_options_are_refused_before_the_first_frame(stream, options, words):
    result = stream(b"", *options, code=2)
    (said,) = result.stderr.splitlines()
    assert words in said


def test_a_mano_hand_waits_for_the_side_that_the_first_frame_says(stream, lines):
    mano = ("--hand", "mano", "--mano", ".")
    assert "got none; pipe" in stream(b"", *mano, code=2).stderr
    assert "MANO_RIGHT.pkl" in stream(lines, *mano, code=2).stderr


def test_a_mesh_in_millimetres_is_taken_in_its_unit(stream, lines, tmp_path):
    write_mesh(tmp_path / "large.obj", 1000 * BOX_CORNERS)
    refused = stream(lines, "--obj", "large.obj", code=2)
    assert "pass --unit mm" in refused.stderr
    taken = stream(lines, "--obj", "large.obj", "--unit", "mm")
    assert taken.stderr == ""
    assert taken.stdout == stream(lines, "--obj", "object.obj").stdout


def test_a_doubt_is_one_warning_and_no_frame_is_lost(stream, lines, caplog):
    for line in lines:
        del line["object_rotation"], line["object_translation"]
    result = stream(lines, "--obj", "object.obj")
    assert len(result.stdout.splitlines()) == 12
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith("standard input: no pose of the object in the first 12 frames")


def test_a_doubt_about_the_object_of_two_hands_is_one_warning(stream, lines, caplog):
    for frame, line in enumerate(lines):
        line["left_joints"] = line["right_joints"]
        line["object_translation"] = [[0.01 * (frame // 2), 0.0, 0.0]]
    stream(lines, "--obj", "object.obj")
    said = [record.getMessage() for record in caplog.records]
    assert len([words for words in said if "repeats the one before" in words]) == 1


def test_null_within_numbers_and_an_empty_list_are_what_was_lost(stream, lines):
    lines[2]["right_joints"] = [[None] * 3] * 21
    lines[3]["right_joints"][8] = [None] * 3
    lines[4]["object_translation"] = [None] * 3
    lines[5]["right_joints"] = []
    lines[6]["right_joints"][8] = None
    lines[7]["right_joints"] = [None] * 21
    lines[8]["object_rotation"], lines[8]["object_translation"] = [None], [None]
    found = [json.loads(line) for line in stream(lines, "--obj", "object.obj").stdout.splitlines()]
    assert [line["frame"] for line in found if line["right_filled"]] == [2, 5, 7]


@pytest.mark.parametrize("name", ["right_pose", "right_wrist"])
@pytest.mark.parametrize("value", [None, [], "left out"])
def test_a_hand_without_one_of_its_fields_is_lost_in_a_later_line(stream, lines, name, value):
    for line in lines:
        line |= {"right_pose": [[0.0] * 3] * 16, "right_wrist": line["right_joints"][0]}
        line["right_confidence"] = [1.0] * 21
        del line["right_joints"]
    lines[5] |= {"right_joints": None, name: value}
    if value == "left out":
        del lines[5][name]
    found = [json.loads(line) for line in stream(lines, "--obj", "object.obj").stdout.splitlines()]
    assert [line["frame"] for line in found if line["right_filled"]] == [5]


def test_a_hand_whose_joints_are_null_beside_their_confidence_is_lost(stream, lines):
    for line in lines:
        line["right_confidence"] = [1.0] * 21
    lines[0]["right_joints"] = None
    del lines[5]["right_joints"]
    found = [json.loads(line) for line in stream(lines, "--obj", "object.obj").stdout.splitlines()]
    assert [line["frame"] for line in found if line["right_filled"]] == [0, 5]


@pytest.mark.parametrize(
    ("times", "rate", "words"),
    [
        ([0, 1, 2, 4, 5, 6], "60", "'timestamp_ns' leaves out 1 frame of"),
        ([0, 1, 2, 3, 4, 5], "30", "'timestamp_ns' says 60 frames a second, got 30"),
        ([0, 1.2, 2, 2.8, 4, 5], "60", None),
    ],
)
def test_times_that_contradict_the_rate_are_told(stream, lines, caplog, times, rate, words):
    timed = [{**x, "timestamp_ns": t * 1e9 / 60} for x, t in zip(lines, times, strict=False)]
    stream(timed, "--obj", "object.obj", "--fps", rate)
    said = [record.getMessage() for record in caplog.records]
    assert said == [] if words is None else words in said[0]


def test_a_hand_that_the_first_line_does_not_name_is_told_once(stream, lines, caplog):
    for line in lines[3:]:
        line["left_joints"] = (np.array(line["right_joints"]) * [-1, 1, 1]).tolist()
    result = stream(lines, "--obj", "object.obj")
    assert "left_joints" not in result.stdout
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith("standard input, line 4: the left hand is left out")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("object_pose", "'object_pose' is not read; is it 'obj_pose'?"),
        ("right_confidense", "'right_confidense' is not read; is it 'right_confidence'?"),
        ("camera_position", "'camera_position' is not read in a stream"),
    ],
)
def test_fields_that_are_not_read_are_told(stream, lines, caplog, name, words):
    rows = [{"right_joints": line["right_joints"], name: [0.0, 0.0, 0.0]} for line in lines]
    stream(rows)
    assert words in caplog.text


def test_the_ray_of_the_camera_is_that_of_each_hand():
    streaming = import_module("geneoh_cli.streaming")
    fields = {"right_joints": [[0.0] * 3] * 21, "left_joints": None, "camera_ray": [0, 0, 1]}
    assert streaming.hand_in(fields, "right")["camera_ray"] == [0, 0, 1]
    assert streaming.hand_in(fields, "left") is None


def test_keypoints_in_another_order_end_the_stream_at_their_line(stream, lines):
    mano = np.argsort(ORDERS["mano"].entries)
    for line in lines:
        line["right_joints"] = np.array(line["right_joints"])[mano].tolist()
    result = stream(lines, "--obj", "object.obj", code=2)
    assert "standard input, line 10: the keypoints of the right hand must be" in result.stderr


def test_files_and_a_stream_exclude_each_other(stream, lines):
    result = stream(lines, "hand.npz", "--report", "page.html", code=2)
    assert "drop NOISY, --report" in result.stderr


def test_a_lag_without_a_stream_is_refused(command):
    result = CliRunner().invoke(command, ["denoise", "hand.npz", "--lag", "0.1"])
    assert result.exit_code == 2
    assert "--lag is the lag of --stream" in result.stderr


class Sink(io.BytesIO):
    """Standard output that counts what was flushed, and may be closed by its reader."""

    def __init__(self, most: int = 1000) -> None:
        """Take `most` lines."""
        super().__init__()
        self.most, self.flushed = most, []

    def flush(self) -> None:
        """Note how many lines are out."""
        self.flushed.append(self.getvalue().count(b"\n"))
        if len(self.flushed) > self.most:
            raise BrokenPipeError(errno.EPIPE, "Broken pipe")


class Typed(io.BytesIO):
    """Standard input that ends with Ctrl-C."""

    def readline(self, size: int | None = -1, /) -> bytes:
        """The next line, or the interruption."""
        if line := super().readline(size):
            return line
        raise KeyboardInterrupt


@pytest.fixture
def pipes(monkeypatch, lines):
    """Standard input with the lines, and standard output."""

    def use(source: type[io.BytesIO], sink: Sink) -> Sink:
        given = source("".join(json.dumps(line) + "\n" for line in lines).encode())
        monkeypatch.setattr(import_module("geneoh_cli.streaming"), "ends", lambda: (given, sink))
        return sink

    return use


def test_each_line_is_flushed(stream, pipes):
    sink = pipes(io.BytesIO, Sink())
    stream([], "--obj", "object.obj")
    assert sink.flushed == list(range(1, 13))


def test_a_reader_that_leaves_ends_it_quietly(stream, pipes):
    pipes(io.BytesIO, Sink(most=2))
    assert stream([], "--obj", "object.obj", code=1).output == ""


def test_ctrl_c_ends_it_in_one_line(stream, pipes):
    sink = pipes(Typed, Sink())
    result = stream([], "--obj", "object.obj", code=130)
    assert len(result.stderr.splitlines()) == 1
    assert sink.flushed == list(range(1, 10))
