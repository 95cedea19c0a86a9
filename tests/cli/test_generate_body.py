"""`geneoh generate --body`; the networks are tested elsewhere."""

from pathlib import Path

import bodies
import numpy as np
import pytest
import torch
import trimesh

from geneoh.generators.both2hands import on_body
from geneoh.pipeline.options import Options
from geneoh.pipeline.results import Denoised
from geneoh.readers.bodies.read import read_body
from geneoh.readers.npz.files import load

SENTENCE = "the right hand waves, the left rests"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """walk.npz, and networks that leave all hands flat."""
    monkeypatch.setattr(on_body, "generate_hands", lambda motion, *_, **__: motion)
    monkeypatch.setattr(on_body, "load_both2hands", lambda *_, **__: None)
    bodies.smplx_names(tmp_path / "walk.npz", bodies.swaying(6))
    return tmp_path


def test_hands_are_written_beside_the_body_and_told(geneoh, folder):
    result = geneoh("generate", "--body", "walk.npz", SENTENCE)
    assert "read walk.npz (smplx names): 6 frames at 30 frames a second" in result.output
    assert "note: y is taken to point up" in result.output
    assert result.output.splitlines()[-1] == "wrote walk_hands.npz"
    assert len(load(folder / "walk_hands.npz").hands) == 2


def test_each_format_is_written_by_its_ending(geneoh, folder):
    outputs = ("a.npz", "a.bvh", "a.glb")
    names = [word for name in outputs for word in ("-o", name)]
    result = geneoh("generate", "--body", "walk.npz", SENTENCE, *names, "--up", "y")
    assert "note" not in result.output
    turns = [read_body(folder / name).motion.rotations for name in outputs[:2]]
    torch.testing.assert_close(*turns, atol=1e-4, rtol=0)
    assert "right hand" in trimesh.load_scene(folder / "a.glb").geometry


def test_a_device_that_is_not_there_is_told(geneoh, folder):
    result = geneoh("generate", "--body", "walk.npz", SENTENCE, "--device", "nothing", code=2)
    assert "--device nothing: expected a device of this machine" in result.stderr


def test_hands_with_an_object_go_through_the_cleaner(geneoh, folder, monkeypatch):
    seen = []

    def cleaned(sequence, options, on_progress):
        seen.append((sequence, options))
        return Denoised(sequence, {}, ("a pose is lost",))

    monkeypatch.setattr(on_body, "denoise", cleaned)
    bodies.held_cylinder(folder, bodies.swaying(6))
    held = ("--obj", "mug.obj", "--object-pose", "poses.npy")
    told = geneoh("generate", "--body", "walk.npz", SENTENCE, *held, "--seed", 4).stdout
    assert "note: a pose is lost" in told
    with np.load(folder / "walk_hands.npz") as arrays:
        assert "a pose is lost" in arrays["notes"]
    ((sequence, options),) = seen
    assert options == Options(seed=4)
    poses = np.load(folder / "poses.npy")
    np.testing.assert_allclose(sequence.object.translation[:, 0], poses[:, :3, 3], atol=1e-6)
    assert [hand.side for hand in sequence.hands] == ["right"]
    assert len(load(folder / "walk_hands.npz").object.meshes) == 1
    geneoh("generate", "--body", "walk.npz", SENTENCE, *held, "--refine", "none")
    assert len(seen) == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--body", "walk.npz", ""], "expected an English sentence, found no words"),
        (["--body", "walk.npz", "die rechte Hand winkt"], "on what hands do, found 1 known"),
        (["--body", "walk.npz", "123"], "found 0 known words among 1; write one such as"),
        (["--body", "none.npz", SENTENCE], "none.npz: no such file"),
        (["--body", "joints.npz", SENTENCE], "expected a body as 'global_orient'"),
        (["--body", "walk.npz", SENTENCE, "--fps", "60"], "says 30 frames a second, got --fps 60"),
        (["--body", "handless.bvh", SENTENCE], "expected a body with arms and hands"),
        (
            ["--body", "walk.bvh", SENTENCE, "--skeleton", "none.npz"],
            "leave --skeleton none.npz out",
        ),
        (["--body", "walk.fbx", SENTENCE], "got '.fbx'; export it as BVH"),
        (
            ["--body", "norate.npz", SENTENCE, "--fps", "0"],
            "got 0; correct it in the file or in --fps",
        ),
        (["--body", "walk.npz", SENTENCE, "--frames", "40"], "--frames has no meaning with --body"),
        (["--body", "walk.npz", SENTENCE, "--refine", "paper"], "--refine paper has no meaning"),
        (["--body", "walk.npz", SENTENCE, "-o", "a.mp4"], "expected .npz, .bvh, .glb"),
        (["--body", "walk.npz", SENTENCE, "-o", "walk.npz"], "is an input and never replaced"),
        (["--body", "walk.npz", SENTENCE, "--clip", "3"], "lower --clip"),
        (["--body", "walk.npz", SENTENCE, "--obj", "joints.npz"], "joints.npz"),
        (["--obj", "box.obj", SENTENCE, "--clip", "0"], "--clip needs --body"),
        ([SENTENCE], "Missing option '--obj' or '--body'"),
    ],
)
def test_bad_input_ends_in_a_sentence_and_exit_code_2(geneoh, folder, arguments, said):
    np.savez(folder / "joints.npz", joints=np.zeros((6, 21, 3)))
    with np.load(folder / "walk.npz") as walk:
        np.savez(
            folder / "norate.npz", **{name: walk[name] for name in walk.files if name != "fps"}
        )
    (folder / "walk.fbx").write_bytes(b"Kaydara FBX Binary  \0")
    bvh = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}\n"
    (folder / "handless.bvh").write_text(f"{bvh}MOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    result = geneoh("generate", *arguments, code=2)
    assert said in result.output
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
