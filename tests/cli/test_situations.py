"""The everyday situations that docs/reliability.md lists: each is tried with the command.

Here are those that `bad_inputs` does not have, which the tests of `geneoh denoise` try.
"""

import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bad_inputs as bad
import numpy as np
import pytest
import quick_presets
import trimesh
from bad_inputs import BOX_CORNERS, BOX_FACES, FRAMES, good_arrays, with_arrays, write_mesh
from click.testing import CliRunner
from recorded_inputs import (
    beside,
    by_a_known_camera,
    by_a_moving_camera,
    by_an_inverted_camera,
    cut,
    in_a_box,
    inverted,
    late,
    recorded,
    recorded_keypoints,
    reflected_at_the_palm,
    that_stays_behind,
    transposed,
    with_faulty_frame,
    with_hands_on_a_line,
    with_poses_on_a_line,
    with_repeated_poses,
    with_two_hands,
)

import geneoh
from geneoh.readers.joint_orders import ORDERS

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reliability.md"
RUN = "denoise hand.npz --obj object.obj --preset fast --steps 1"
UNTIPPED = ~np.isin(np.arange(21), (4, 8, 12, 16, 20))[:, None]
FRAME_BY_FRAME = np.arange(FRAMES, dtype=np.float32)[:, None, None]


@dataclass(frozen=True)
class Situation:
    """What a user does, and what comes of it."""

    name: str
    words: str
    """Words of the answer, several with " ... " between them."""
    spoil: Callable[[Path], object] = lambda folder: None
    """Changes the good hand.npz and object.obj of a folder."""
    command: str = RUN
    code: int = 2


def text(name: str, content: str | bytes) -> Callable[[Path], object]:
    """Write a file."""
    return lambda folder: (folder / name).write_bytes(
        content if isinstance(content, bytes) else content.encode()
    )


def first_frames(count: int) -> Callable[[Path], None]:
    """Keep some frames of every field."""
    fields = ("joints", "object_rotation", "object_translation")
    return with_arrays(**dict.fromkeys(fields, lambda array: array[:count]))


def with_a_hole(folder: Path) -> None:
    """A box that lacks a small triangle."""
    verts, faces = trimesh.remesh.subdivide(BOX_CORNERS, BOX_FACES)
    write_mesh(folder / "object.obj", verts, faces[:-1])


def in_mano_order(joints: np.ndarray) -> np.ndarray:
    """The keypoints as MANO orders them."""
    return joints[:, np.argsort(ORDERS["mano"].entries)]


def with_tips(value: float) -> Callable[[np.ndarray], np.ndarray]:
    """Put a number into the fingertips of one frame."""

    def change(joints: np.ndarray) -> np.ndarray:
        joints[3, 4::4] = value
        return joints

    return change


def with_unseen_left_hand(folder: Path) -> None:
    """The good track in geneoh's own layout, with a left hand of NaN."""
    arrays = {name: array for name, array in good_arrays().items() if name != "side"}
    arrays["right_joints"] = arrays.pop("joints")
    own = {
        "format": "geneoh-sequence",
        "version": 1,
        "left_joints": np.full((FRAMES, 21, 3), np.nan),
    }
    np.savez(folder / "hand.npz", **arrays, **own)


def scaled_mesh(factor: float) -> Callable[[Path], None]:
    """The box in another unit."""
    return lambda folder: write_mesh(folder / "object.obj", BOX_CORNERS * factor)


def with_vertices(corners: str, faces: str = "") -> Callable[[Path], None]:
    """The box with further lines in its file."""

    def write(folder: Path) -> None:
        lines = (folder / "object.obj").read_text()
        (folder / "object.obj").write_text(f"{lines}{corners}\n{faces}\n")

    return write


def quads(folder: Path) -> None:
    """The box of six faces with four corners."""
    corners = "\n".join(f"v {x:g} {y:g} {z:g}" for x, y, z in BOX_CORNERS)
    faces = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    (folder / "object.obj").write_text("\n".join([corners, *(f"f {face}" for face in faces), ""]))


def results_before(folder: Path) -> None:
    """The result of an earlier run."""
    geneoh.save(geneoh.load(folder / "hand.npz", obj=folder / "object.obj"), folder / "out.npz")


def landmarks(kind: str) -> Callable[[Path], None]:
    """MediaPipe's results as JSON."""

    def write(folder: Path) -> None:
        import json

        points = [dict(zip("xyz", point, strict=True)) for point in good_arrays()["joints"][0]]
        points = [{axis: float(number) for axis, number in point.items()} for point in points]
        hand = {"handedness": [[{"categoryName": "Right", "score": 0.9}]], kind: [points]}
        (folder / "hand.json").write_text(json.dumps([hand] * FRAMES))
        np.save(folder / "pose.npy", np.tile(np.eye(4), (FRAMES, 1, 1)))

    return write


def keypoint_file(folder: Path) -> None:
    """The keypoints as a npy, with the object's poses in another one."""
    np.save(folder / "hand.npy", good_arrays()["joints"])
    np.save(folder / "pose.npy", np.tile(np.eye(4), (FRAMES, 1, 1)))


def own_layout(folder: Path) -> None:
    """The hand under the names of geneoh-sequence."""
    results_before(folder)
    (folder / "out.npz").rename(folder / "hand.npz")


def left_handed_axes(folder: Path) -> None:
    """The recording as a program of Unity has it."""
    recorded()(folder)
    flip = np.array([1.0, 1.0, -1.0], np.float32)
    with np.load(folder / "hand.npz") as file:
        fields = dict(file)
    fields["joints"] = fields["joints"] * flip
    fields["object_rotation"] = fields["object_rotation"] * flip * flip[:, None]
    fields["object_translation"] = fields["object_translation"] * flip
    np.savez(folder / "hand.npz", **fields)


SITUATIONS = [
    # The file
    Situation(
        "A folder is given", "Is a directory ... say with --from whose data", command="denoise ."
    ),
    Situation("The file is empty", "hand.npz", text("hand.npz", "")),
    Situation("The file is a text", "expected an npz", text("hand.npz", "frame,x,y,z\n")),
    Situation("A pipe is given", "pipe", lambda f: os.mkfifo(f / "p.npz"), "denoise p.npz"),
    Situation("A device is given", "device", command="denoise /dev/zero -o x.npz"),
    Situation(
        "Mesh and track are swapped", "", command="denoise object.obj --obj hand.npz -o x.npz"
    ),
    # The hand's fields
    Situation(
        "Fields have names of one's own",
        "'keypoints' ... rename the fields",
        with_arrays(joints=None, keypoints=good_arrays()["joints"]),
    ),
    Situation(
        "Keypoints are (21, 3, T)",
        "(T, 21, 3)",
        with_arrays(joints=lambda joints: joints.transpose(1, 2, 0)),
    ),
    Situation(
        "The side is the wrong one",
        "handedness ... --side left",
        recorded(side="right"),
        code=0,
    ),
    Situation(
        "Left-handed axes, as of Unity",
        "as Unity and Unreal have: negate one coordinate",
        left_handed_axes,
        code=0,
    ),
    Situation(
        "Keypoints in MANO's order",
        "OpenPose order ... --joint-order mano",
        with_arrays(joints=in_mano_order),
    ),
    Situation(
        "Keypoints in MANO's order, said",
        "wrote",
        with_arrays(joints=in_mano_order),
        f"{RUN} --joint-order mano",
        0,
    ),
    Situation(
        "An order is given to a layout that has one",
        "always in OpenPose order",
        own_layout,
        f"{RUN} --joint-order mano",
    ),
    Situation(
        "Keypoints in millimetres, said",
        "wrote",
        with_arrays(joints=lambda joints: 1000 * joints),
        f"{RUN} --keypoint-unit mm",
        0,
    ),
    Situation(
        "Keypoints in centimetres",
        "centimetres, divide by 100",
        with_arrays(joints=lambda joints: 100 * joints),
    ),
    # Frames
    Situation("No frame", "at least one frame", first_frames(0)),
    Situation("One frame", "wrote", first_frames(1), code=0),
    Situation("Two frames", "wrote", first_frames(2), code=0),
    Situation(
        "NaN in single keypoints",
        "5 keypoints are NaN or at the origin in 1 of 6 frames",
        with_arrays(joints=with_tips(np.nan)),
        code=0,
    ),
    Situation(
        "Keypoints that no frame has, such as fingertips",
        "note: 5 keypoints that no frame has (4, 8, 12, 16, 20): estimated from the others",
        recorded(joints=np.where(UNTIPPED, recorded_keypoints(), np.nan)),
        code=0,
    ),
    Situation(
        "Zeros in single keypoints",
        "5 keypoints are NaN or at the origin in 1 of 6 frames",
        with_arrays(joints=with_tips(0.0)),
        code=0,
    ),
    Situation(
        "Zeros in a frame",
        "1 frame in which ... in one place",
        with_arrays(joints=bad.with_nan_in(3, 0.0)),
        code=0,
    ),
    Situation(
        "The hand is elsewhere in a frame",
        "the left hand leaps farther than a hand can move in 1 frame: taken as missing",
        with_faulty_frame(lambda joints: joints[5] + 0.3),
        code=0,
    ),
    Situation(
        "A single keypoint is apart from its hand",
        "the left hand has 1 keypoint apart from it in 1 frame: taken as missing",
        with_faulty_frame(lambda joints: joints[5] + 0.1 * (np.arange(21)[:, None] == 8)),
        code=0,
    ),
    Situation(
        "The hand is turned over in a frame",
        "the left hand turns faster than a hand can turn in 1 frame: taken as missing",
        with_faulty_frame(
            lambda joints: 2 * joints[5].mean(0) * [1, 1, 0] + joints[5] * [-1, -1, 1]
        ),
        code=0,
    ),
    Situation(
        "The hand is of the other side in a frame",
        "the left hand is bent backward ... in 1 frame: taken as missing",
        with_faulty_frame(lambda joints: reflected_at_the_palm(joints[5])),
        code=0,
    ),
    Situation(
        "The hand repeats a frame",
        "the left hand repeats the frame before ... in 1 frame: taken as missing",
        with_faulty_frame(lambda joints: joints[4]),
        code=0,
    ),
    Situation(
        "The hand moves on a straight line at an exactly even speed for four frames or more",
        "the left hand moves on straight lines at an exactly even speed in 4 frames: taken as",
        with_hands_on_a_line,
        code=0,
    ),
    Situation(
        "The hand stays behind the object that it holds, and then leaps after it",
        "the left hand stays behind the object that it holds, and then leaps after it, in 9 frames",
        that_stays_behind("left_joints", "left_pose", "left_wrist"),
        code=0,
    ),
    Situation(
        "The hand comes some frames later or earlier than the object that it holds",
        "left hand: timing: ... 6 frames later ... (--hand-delay 6, unless a note tells",
        late,
        code=0,
    ),
    Situation(
        "The video is cut: a hand leaps elsewhere and stays for two thirds of a second",
        "cuts: a hand leaps to another place before frame 25, ... each shot is cleaned by itself",
        cut,
        code=0,
    ),
    Situation(
        "Left and right are exchanged in some frames",
        "the left and the right hand are exchanged in 3 frames: each got what the other had",
        with_two_hands(slice(4, 7)),
        code=0,
    ),
    Situation(
        "One hand follows the other one in some frames",
        "the left hand follows the other hand in 3 frames ... taken as missing",
        with_two_hands(slice(0, 0), following=slice(4, 7)),
        code=0,
    ),
    Situation(
        "One hand has two names",
        "the left and the right hand are in one place in 12 of 12 frames ... pass --side",
        with_two_hands(slice(0, 0), same=True),
        code=0,
    ),
    Situation(
        "A second hand is in no frame", "left hand is in no frame", with_unseen_left_hand, code=0
    ),
    Situation("A negative rate", "1 to 1000", with_arrays(fps=None), f"{RUN} --fps -30"),
    Situation(
        "Frame numbers beside the frames leave some out",
        "left out by 'frame_ids'",
        with_arrays(frame_ids=np.r_[0, 2 : 1 + FRAMES]),
        code=0,
    ),
    Situation(
        "Times of the frames that are uneven",
        "not even by 'timestamps'",
        with_arrays(timestamps=np.arange(FRAMES) / 30 + 0.006 * (np.arange(FRAMES) % 2)),
        code=0,
    ),
    Situation(
        "Times of the frames that contradict the rate",
        "'timestamps' says 15 frames a second, got 30",
        with_arrays(timestamps=np.arange(FRAMES) / 15),
    ),
    Situation(
        "Frame numbers that start again",
        "'frame' must be numbers that rise",
        with_arrays(frame=np.arange(FRAMES) % (FRAMES - 2)),
    ),
    # The object's poses
    Situation(
        "No mesh",
        "nothing is known of contact",
        command=RUN.replace(" --obj object.obj", ""),
        code=0,
    ),
    Situation(
        "The pose repeats a frame while the object moves",
        "repeats the one before, between two leaps, in 5 frames: taken as missing",
        with_repeated_poses,
        code=0,
    ),
    Situation(
        "The pose moves on a straight line at an exactly even speed for four frames or more",
        "the pose of the object moves on straight lines at an exactly even speed in 4 frames",
        with_poses_on_a_line,
        code=0,
    ),
    Situation(
        "The pose stays behind the hand that moves the object, and then leaps after it",
        "the pose of the object stays behind the hand that moves it, and then leaps after it, in 8",
        that_stays_behind("object_rotation", "object_translation"),
        code=0,
    ),
    Situation(
        "The camera moves, and hand and object are in its frame",
        "note: the camera moves: its motion was removed before the hand was cleaned",
        by_a_moving_camera,
        code=0,
    ),
    Situation(
        "The same with the poses of the camera",
        "note: the camera's motion was removed by its poses before the hand was cleaned",
        by_a_known_camera,
        code=0,
    ),
    Situation(
        "The poses of the camera are inverted, late, of another scale or other axes",
        "note: by the camera's poses the object moves while no hand moves with it",
        by_an_inverted_camera,
        code=0,
    ),
    Situation(
        "Rotations are transposed",
        "wanders ... with the object's rotation transposed",
        transposed,
        code=0,
    ),
    Situation(
        "Poses are from the world to the object",
        "wanders ... with the object's poses inverted",
        inverted,
        code=0,
    ),
    Situation(
        "The object is out of reach",
        "too far to touch ... --object-pose",
        with_arrays(object_translation=np.full((FRAMES, 1, 3), 0.3)),
        code=0,
    ),
    Situation(
        "Hand and object are centimetres apart from where they touched, for seconds",
        "note: the hand was moved by ... off their place; without a mesh",
        beside,
        code=0,
    ),
    # The mesh
    Situation(
        "The mesh is a convex hull or a box of a hollow object",
        "note: cleaned against the object, fingers stay ... mm deep in it ... larger",
        in_a_box,
        code=0,
    ),
    Situation(
        "A mesh of another program", "expected a mesh file", command="denoise hand.npz --obj a.fbx"
    ),
    Situation(
        "A texture for a mesh", "expected a mesh file", command="denoise hand.npz --obj a.png"
    ),
    Situation("An empty mesh file", "object.obj", text("object.obj", "")),
    Situation("A mesh in millimetres, said", "wrote", scaled_mesh(1000), f"{RUN} --unit mm", 0),
    Situation("A mesh that is scaled twice", "too small for a hand", scaled_mesh(0.001)),
    Situation(
        "A mesh with a hole",
        "wrote",
        with_a_hole,
        code=0,
    ),
    Situation(
        "A mesh that is open, as a scan without its bottom",
        "note: the mesh of the object is open ... if the object is solid there, close its mesh",
        lambda f: write_mesh(f / "object.obj", BOX_CORNERS, BOX_FACES[:-1]),
        code=0,
    ),
    Situation(
        "A mesh whose faces look both ways",
        "wrote",
        lambda f: write_mesh(
            f / "object.obj", BOX_CORNERS, np.concatenate([BOX_FACES, BOX_FACES[:, ::-1]])
        ),
        code=0,
    ),
    Situation("A mesh of quads", "wrote", quads, code=0),
    Situation("A vertex 100 km away", "wrote", with_vertices("v 1e5 0 0"), code=0),
    Situation(
        "A face without area far away",
        "wrote",
        with_vertices("v 1e5 0 0", "f 9 9 1"),
        code=0,
    ),
    # Other files
    Situation(
        "A npy of keypoints",
        "wrote",
        keypoint_file,
        RUN.replace("npz", "npy") + " --object-pose pose.npy --side right",
        0,
    ),
    Situation(
        "A npy of keypoints with a mesh, but no poses",
        "pass --object-pose",
        keypoint_file,
        "denoise hand.npy --obj object.obj --side right",
    ),
    Situation(
        "A npy of keypoints without a side",
        "--side",
        keypoint_file,
        "denoise hand.npy --obj object.obj",
    ),
    Situation(
        "MediaPipe's world landmarks",
        "about the centre of each hand",
        landmarks("worldLandmarks"),
        "denoise hand.json --obj object.obj --object-pose pose.npy --preset fast --steps 1",
        0,
    ),
    Situation(
        "MediaPipe's landmarks of the picture",
        "hand_world_landmarks",
        landmarks("landmarks"),
        "denoise hand.json --obj object.obj --object-pose pose.npy",
    ),
    # Options
    Situation("An option that does not exist", "--help", command=f"{RUN} --presett fast"),
    Situation("No sample", "--samples", command=f"{RUN} --samples 0"),
    Situation("A negative seed", "--seed", command=f"{RUN} --seed -1"),
    Situation("No such device", "--device gpu", command=f"{RUN} --device gpu"),
    Situation(
        "A folder without weights", "expected weights there", command=f"{RUN} --weights nowhere"
    ),
    Situation("A source that does not exist", "'nobody'", command=f"{RUN} --from nobody"),
    Situation(
        "An option of a source without --from", "--clip needs --from", command=f"{RUN} --clip a"
    ),
    Situation(
        "A noise that does not exist", "'loud'", command="corrupt hand.npz --noise loud -o x.npz"
    ),
    Situation("A data set that is not there", "GRAB", command="eval --dataset grab -o runs"),
    Situation("A command that does not exist", "clean", command="clean hand.npz"),
    # Results
    Situation(
        "A result in a folder that is not there", "cannot be written", command=f"{RUN} -o no/x.npz"
    ),
    Situation("A folder that cannot be written to", "/proc/x.npz", command=f"{RUN} -o /proc/x.npz"),
    Situation("The result is the input", "is an input", command=f"{RUN} -o hand.npz"),
    Situation("The result is the mesh", "expected .npz", command=f"{RUN} -o object.obj"),
    Situation("Another ending", "expected .npz, got '.glb'", command=f"{RUN} -o x.glb"),
    Situation(
        "A file of someone else's is there",
        "--overwrite",
        text("out.npz", "mine"),
        f"{RUN} -o out.npz",
    ),
    Situation(
        "A result of geneoh's is there", "wrote out.npz", results_before, f"{RUN} -o out.npz", 0
    ),
    Situation("The page is the result", "expected .html", command=f"{RUN} -o x.npz --report x.npz"),
    Situation(
        "A device for the result",
        "a device",
        lambda f: (f / "null.npz").symlink_to("/dev/null"),
        f"{RUN} -o null.npz",
    ),
]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a good track and a good mesh, which is the working directory."""
    bad.write_good(tmp_path)
    monkeypatch.chdir(tmp_path)
    quick_presets.use(monkeypatch)  # what is said does not hang on how well a hand is fitted
    return tmp_path


@pytest.mark.parametrize("situation", SITUATIONS, ids=lambda each: each.name)
def test_what_happens_is_what_the_page_says(situation, folder, command, caplog):
    situation.spoil(folder)
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    result = CliRunner().invoke(command, situation.command.split())
    said = " ".join((result.output + caplog.text).split())
    assert result.exit_code == situation.code, said
    place = 0
    for words in situation.words.split(" ... "):
        assert words in said[place:], said
        place = said.index(words, place)
    if situation.code:
        assert {path: path.read_bytes() for path in before} == before
        assert "Traceback" not in said


def test_ctrl_c_ends_in_one_line(folder, command, monkeypatch):
    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(geneoh, "denoise", interrupted)
    result = CliRunner().invoke(command, RUN.split())
    assert (result.exit_code, "stopped; nothing half-written was left" in result.output) == (
        130,
        True,
    )
    assert sorted(path.name for path in folder.iterdir()) == ["hand.npz", "object.obj"]


def test_a_film_without_ffmpeg_is_refused(folder, command, monkeypatch):
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    result = CliRunner().invoke(
        command, ["view", "hand.npz", "--obj", "object.obj", "-o", "film.mp4"]
    )
    assert (result.exit_code, "geneoh[view]" in result.output) == (2, True), result.output
    assert sorted(path.name for path in folder.iterdir()) == ["hand.npz", "object.obj"]


def test_the_page_lists_the_situations_that_are_tried():
    table, _, _ = PAGE.read_text("utf-8").partition("\n## Hand and object out of step")
    _, *rows = re.findall(r"^\| (.+?) \| .+ \| .+ \|$", table, re.MULTILINE)
    inputs = {case.name for case in (*bad.REFUSED, *bad.TOLD)}
    tried = [situation.name for situation in SITUATIONS]
    assert len(set(tried)) == len(tried)
    assert inputs.isdisjoint(tried)
    assert set(tried) <= set(rows)
    assert set(rows) - inputs - set(tried) == {"A film, and no ffmpeg", "Ctrl-C during the work"}
