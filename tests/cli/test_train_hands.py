"""Training of the networks that make hands of a moving body and a sentence."""

from dataclasses import replace

import bodies
import numpy as np
import pytest
import torch
from made_bodies import SKELETON, made_motion
from made_gestures import made_gestures, write_gesture_shards

from geneoh.body.motion import BodyMotion
from geneoh.choices import BODY_STAGES
from geneoh.generators.both2hands.library import load_both2hands
from geneoh.generators.both2hands.sampling import generate_hands
from geneoh.nn.checkpoint import load_checkpoint

FEW = ("steps=1", "batch=3", "validation_batches=1", "text_hands.words.pieces=60")
SMALL = tuple(
    f"{stage}.{name}={size}"
    for stage in BODY_STAGES
    for name, size in (("width", 16), ("depth", 1), ("heads", 2))
)


@pytest.fixture
def small(tmp_path) -> tuple[str, str]:
    """A configuration of one small step, which serves all stages."""
    (tmp_path / "small.toml").write_text("\n".join((*FEW, *SMALL)))
    return "--config", "small.toml"


def test_the_networks_of_hands_are_trained_one_after_the_other_and_used(geneoh, tmp_path, small):
    write_gesture_shards(tmp_path / "bodies", val=made_gestures(4, seed=1), train=made_gestures(6))
    run = ("--data", "bodies", "-o", "run", "--threads", "1", *small)
    for stage in BODY_STAGES:
        geneoh("train", "--stage", stage, *run)
    networks, motion = load_both2hands(tmp_path / "run"), made_motion(bodies=1, frames=5)
    assert networks.blend.config.width == 16
    made = generate_hands(
        BodyMotion(motion.root[0], motion.rotations[0]),
        SKELETON,
        "the left hand waves",
        steps=1,
        generator=torch.Generator().manual_seed(0),
        networks=networks,
    )
    assert made.rotations.shape == (5, 52, 3, 3)


def test_a_network_that_goes_on_keeps_its_words_and_its_scale(geneoh, tmp_path, small):
    write_gesture_shards(tmp_path / "bodies", val=made_gestures(4, seed=1), train=made_gestures(6))
    said = np.array([["fingers spread", "a fist"]] * 6)
    other = replace(made_gestures(6), joined=said)
    write_gesture_shards(tmp_path / "other", val=other, train=other)
    run = ("train", "--threads", "1", *small, "--set", "rate=1e-9")
    text, first = ("--stage", "text_hands"), ("--data", "bodies", "-o", "a")
    second = ("--data", "other", "-o", "b")
    for words in (
        (*text, *first),
        ("--stage", "body_hands", *second),
        (*text, *second, "--start", "a"),
    ):
        trained = geneoh(*run, *words)
    one, two = (load_checkpoint(tmp_path / n / "text_hands.safetensors") for n in "ab")
    assert one.record["tokenizer"] == two.record["tokenizer"]
    assert one.record["words"] != two.record["words"]
    assert one.tensors["scale.size"].equal(two.tensors["scale.size"])
    assert "scale and noise" not in trained.output


def test_networks_of_hands_learn_from_recordings_of_the_user(geneoh, tmp_path, small):
    (tmp_path / "data").mkdir()
    bodies.both57m(tmp_path / "data" / "a.p", bodies.swaying(40), bodies.swaying(35, seed=1))
    run = ("--data", "both57m=data", "-o", "run", *small)
    for stage in BODY_STAGES:
        trained = geneoh("train", "--stage", stage, *run)
        assert "both57m: 2 clips; 1 clip, of 1 recording or person, held out" in trained.output
    record = load_checkpoint(tmp_path / "run" / "blend.safetensors").record
    assert record["made"] == {"source": "both57m", "clips": 2, "skeleton": False}
    networks = load_both2hands(tmp_path / "run")
    assert networks.speech(["fingers spread"]).shape[0] == 1


def test_networks_of_hands_are_blended_where_recordings_lack_a_text(geneoh, tmp_path, small):
    names = [f"idea400__subset_0001__wave{n}_clip_1" for n in range(6)]
    motions = {name: bodies.swaying(40, seed=n) for n, name in enumerate(names)}
    tree = bodies.motion_x_tree(tmp_path / "data", **motions)
    for file in (tree / "texts").rglob("wave3_clip_1.*"):
        file.unlink()
    for stage in BODY_STAGES:
        trained = geneoh("train", "--stage", stage, "--data", "motionx=data", "-o", "run", *small)
        assert ("are those of run/body_hands.safetensors" in trained.output) == (
            stage == "text_hands"
        )
    assert load_both2hands(tmp_path / "run").body.config.width == 16


def test_data_sets_without_what_a_stage_learns_from_are_refused(geneoh, tmp_path):
    bodies.amass(tmp_path / "walk_poses.npz", bodies.swaying(140))

    def refused(stage, *words):
        ended = geneoh("train", "--stage", stage, "-o", "run", *words, code=2)
        return ended.stderr

    assert "got none (1 without sentences)" in refused("text_hands", "--data", "amass=.")
    assert "expected one of both57m, motionx, amass before '='" in refused(
        "blend", "--data", "grab=."
    )
    assert "--skeleton: expected none" in refused("blend", "--skeleton", "walk_poses.npz")
    assert "v_template" in refused(
        "body_hands", "--data", "amass=.", "--skeleton", "walk_poses.npz"
    )
    assert not (tmp_path / "run").exists()


def test_networks_of_hands_need_one_folder_of_bodies_and_no_other_options(geneoh, tmp_path):
    def refused(*words):
        ended = geneoh("train", "--stage", "body_hands", "-o", "run", *words, code=2)
        return ended.stderr

    assert "expected train_*.safetensors" in refused()
    assert "--data: expected one source" in refused("--data", "a", "--data", "b")
    assert "--text-encoder: expected none" in refused("--text-encoder", "clip")
    assert "--mano: expected none" in refused("--mano", str(tmp_path))


@pytest.mark.parametrize("stage", ["text", "body_hands", "text_hands", "blend"])
def test_a_variable_for_all_commands_is_no_option_that_a_stage_refuses(geneoh, monkeypatch, stage):
    monkeypatch.setenv("GENEOH_MANO_DIR", "mano")
    ended = geneoh("train", "--stage", stage, "--set", "nothing=1", code=2)
    assert "'nothing'" in ended.stderr


def test_a_width_of_texts_without_an_encoder_of_texts_is_refused(geneoh, tmp_path):
    write_gesture_shards(tmp_path / "bodies", val=made_gestures(4, seed=1), train=made_gestures(6))
    ended = geneoh(
        "train", "--stage", "text_hands", "--data", "bodies", "--set", "text_hands.text=8", code=2
    )
    assert "--set text_hands.text=8: expected 0, as in the weights" in ended.stderr
