from dataclasses import replace
from functools import partial
from pathlib import Path

import fake_cleaning
import numpy as np
import pytest
import torch
import trimesh

import geneoh
from geneoh.generators.text2hoi import generate as module
from geneoh.generators.text2hoi.generate import Generated
from geneoh.generators.text2hoi.physics.jointed import asked_joint, joined
from geneoh.generators.text2hoi.sentences.prompt import read_prompt
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"
SENTENCE = "lift the box with the left hand"


@pytest.fixture
def made(monkeypatch) -> list:
    """What `geneoh generate` asks for; the networks are tested elsewhere."""
    asked = []

    def pretended(sentence, meshes, options, *, joint=None, on_progress=None):
        asked_joint(meshes, joint)
        prompt = read_prompt(sentence)
        asked.append((sentence, options))
        hand = HandTrack("left", torch.ones(4, dtype=torch.bool), joints=torch.rand(4, 21, 3))
        sequence = Sequence((hand,), ObjectTrack.resting(meshes, 4), 30.0)
        return Generated(sequence, torch.zeros(len(joined(meshes).verts)), prompt, None)

    monkeypatch.setattr(module, "generate", pretended)
    return asked


@pytest.fixture
def generate(geneoh):
    """Run `geneoh generate ARGUMENTS` beside box.obj."""
    trimesh.creation.box((0.05, 0.06, 0.1)).export("box.obj")
    return partial(geneoh, "generate")


def test_the_clip_is_written_beside_the_mesh_and_told(generate, made):
    result = generate(SENTENCE, "--obj", "box.obj", "--frames", "40", "--seed", "3")
    assert "lift with the left hand: 4 frames" in result.output
    with np.load("box_generated.npz") as arrays:
        assert str(arrays["prompt"]) == SENTENCE
    ((_, options),) = made
    assert (options.frames, options.seed, options.refine) == (40, 3, "geneoh")


def test_the_device_that_is_named_is_asked_for(generate, made):
    generate(SENTENCE, "--obj", "box.obj", "--device", "cuda:7")
    ((_, options),) = made
    assert options.device == "cuda:7"


def test_an_object_of_two_parts_is_written_beside_the_first(generate, made):
    trimesh.creation.box((0.05, 0.06, 0.01)).apply_translation((0, 0, 0.055)).export("lid.obj")
    parts = ["--obj", "box.obj", "--obj", "lid.obj", "--joint", "hinge:0,0.03,0.05:-1,0,0"]
    generate("open the box with the left hand", *parts)
    with np.load("box_generated.npz") as arrays:
        assert arrays["object_files"].tolist() == ["box.obj", "lid.obj"]


def test_a_verb_that_was_never_learned_is_told_with_the_nearest(generate, made):
    result = generate("brush the box with the left hand", "--obj", "box.obj")
    assert "note: 'brush' was never learned; the nearest verb is" in result.output


def test_a_sentence_without_quotes_is_told_to_be_put_in_them(generate, made):
    result = generate(*SENTENCE.split(), "--obj", "box.obj", code=2)
    assert "put a text with spaces in quotes" in result.stderr


def test_a_sentence_may_be_in_a_file(generate, made):
    Path("prompt.txt").write_text(SENTENCE + "\n")
    generate("@prompt.txt", "--obj", "box.obj")
    assert made[0][0] == SENTENCE


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["", "--obj", "box.obj"], "expected an English sentence"),
        (["heb die Tasse hoch", "--obj", "box.obj"], "expected an English sentence"),
        (["the left hand and a right hand box", "--obj", "none.obj"], "no such file"),
        ([SENTENCE], "Missing option '--obj'"),
        ([SENTENCE, "--obj", "box.obj", "--frames", "1"], "2<=x<=150"),
        ([SENTENCE, "--obj", "box.obj", "-o", "clip.mp4"], ".npz"),
        ([SENTENCE, "--obj", "box.obj", "-o", "box.obj"], "box.obj"),
        ([SENTENCE, "--obj", "box.obj", "--up", "w"], "--up"),
        (
            [SENTENCE, *["--obj", "box.obj"] * 3],
            "one mesh, or two for the parts of an object, got 3",
        ),
        ([SENTENCE, "--obj", "box.obj", "--joint", "slide:1,0,0"], "two parts, got one mesh"),
        ([SENTENCE, *["--obj", "box.obj"] * 2, "--joint", "slide:0,0,0"], "got zeros"),
        ([SENTENCE, *["--obj", "box.obj"] * 2, "--joint", "slide:1,0,0:-5"], "range above 0"),
    ],
)
def test_bad_input_ends_in_a_sentence_and_exit_code_2(generate, made, arguments, said):
    before = None
    result = generate(*arguments, code=2)
    before = Path("box.obj").read_bytes()
    assert said in result.output
    assert Path("box.obj").read_bytes() == before
    assert not list(Path().glob("*.npz"))


def test_files_that_geneoh_did_not_write_stay(generate, made):
    Path("clip.npz").write_bytes(b"mine")
    result = generate(SENTENCE, "--obj", "box.obj", "-o", "clip.npz", code=2)
    assert "--overwrite" in result.output
    assert Path("clip.npz").read_bytes() == b"mine"


def test_hands_that_were_made_through_a_thin_wall_are_told():
    made = fake_cleaning.denoise(geneoh.load(EXAMPLES / "taco_clean.npz")[:6], geneoh.Options())
    (side,) = made.hands
    hand = made.hands[side]
    through = replace(hand, after=replace(hand.after, through_fraction=0.5))
    sound, told = (list(replace(made, hands={side: each}).measures()) for each in (hand, through))
    assert told[: len(sound)] == sound
    assert "goes through a thin wall of the object in 50.0% of the frames" in told[-1]
