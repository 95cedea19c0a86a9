"""`geneoh eval --generator` on a very small scale, and its refusals."""

import csv
import json
from dataclasses import replace

import pytest
import torch
from made_actions import box_actions, write_action_shards
from made_networks import TINY
from trees import write_mano
from trees.labelled import GRAB_MILK, POUR_MILK, labelled_h2o

from geneoh.choices import ACTION_STAGES
from geneoh.config import as_dict
from geneoh.evaluation.generation.scores import MEASURES
from geneoh.generators.text2hoi.networks.autoencoders import ContactNetwork
from geneoh.generators.text2hoi.networks.interaction import InteractionNetwork
from geneoh.generators.text2hoi.networks.refiner import RefinerNetwork
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint

SMALL = (
    *("--generator", "text2hoi", "--dataset", "synthetic", "--root", "data"),
    *("--weights", "weights", "--set", "repetitions=2", "--set", "classifiers=2"),
    *("--set", "classifier.steps=2", "--set", "classifier.width=8"),
)
VERBS = ["lift", "pour", "press"]
PARTS = ["no contact map", "not refined", "paper's refiner"]


@pytest.fixture
def data(tmp_path):
    """Six training and six validation clips."""
    made = {"frames": 12, "points": 64}
    train, val = (box_actions(2 * VERBS, seed=seed, **made) for seed in (0, 1))
    write_action_shards(tmp_path / "data", val=val, train=train)
    write_tiny_weights(tmp_path / "weights")
    return tmp_path / "data"


def write_tiny_weights(folder):
    """Networks that learned nothing, for the shipped text encoder."""
    networks = (ContactNetwork, InteractionNetwork, RefinerNetwork)
    for name, network in zip(ACTION_STAGES, networks, strict=True):
        config = getattr(TINY, name)
        config = config if name == "refiner" else replace(config, text=128)
        with torch.random.fork_rng():
            torch.manual_seed(0)
            tensors = network(config).state_dict()
        record = {"config": {name: as_dict(config)}}
        save_checkpoint(folder / f"{name}.safetensors", Checkpoint(tensors, record))


@pytest.mark.slow
def test_rows_are_printed_and_everything_is_written(geneoh, tmp_path, data):
    done = geneoh("eval", *SMALL, "-o", "out")
    out = tmp_path / "out"
    whole = json.loads((out / "generation.json").read_text())
    rows = list(whole["table"])
    assert rows[:3] == ["real", "random verbs", "nearest training clip"]
    assert rows[3:] == [f"text2hoi, {part}" for part in PARTS]
    assert all(row in done.stdout for row in rows)
    assert whole["command"].startswith("geneoh eval --dataset synthetic --generator text2hoi")
    hashes = whole["settings"]["classifier"]["hashes"]
    assert list(hashes) == ["0", "1"]
    assert all(f"{n} {mark}" in (out / "generation.md").read_text() for n, mark in hashes.items())
    with (out / "generation.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 2 * len(rows)
    assert set(lines[0]) == {"row", "repetition", *(measure.key for measure in MEASURES)}
    # a second run takes the classifiers that are there, and replaces the report
    geneoh("eval", *SMALL, "-o", "out")
    assert json.loads((out / "generation.json").read_text()) == whole


@pytest.mark.slow
def test_actions_of_a_data_set_are_scored(geneoh, tmp_path):
    labelled_h2o(tmp_path / "h2o", GRAB_MILK, POUR_MILK)
    write_tiny_weights(tmp_path / "weights")
    source = ("--dataset", "h2o", "--root", "h2o", "--mano", write_mano(tmp_path / "mano"))
    few = ("--set", "recorded.points=64", "--set", "repetitions=1")
    done = geneoh("eval", *SMALL[:2], *source, *SMALL[6:], *few, "-o", "out")
    assert "note: h2o: 2 actions of 1 objects, validated on the training data" in done.stdout
    table = json.loads((tmp_path / "out" / "generation.json").read_text())["table"]
    # both splits are the same clips, so that the nearest training clips are the real ones
    assert table["nearest training clip"]["depth_mm"] == table["real"]["depth_mm"]


def test_other_files_are_kept(geneoh, tmp_path, data):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "generation.md").write_text("mine")
    done = geneoh("eval", *SMALL, "-o", "out", code=2)
    assert "generation.md" in done.stderr
    assert (tmp_path / "out" / "generation.md").read_text() == "mine"


def test_missing_weights_are_told(geneoh, tmp_path, data):
    (tmp_path / "weights" / "interaction.safetensors").write_bytes(b"")
    done = geneoh("eval", *SMALL, "-o", "out", code=2)
    assert "interaction.safetensors" in done.stderr


@pytest.mark.parametrize(
    ("asked", "word"),
    [
        (("--dataset", "taco"), "--dataset"),
        (("--dataset", "synthetic"), "--root"),
        (("--dataset", "synthetic", "--root", "nowhere", "--weights", "weights"), "nowhere"),
        (("--dataset", "synthetic", "--root", ".", "--method", "geneoh"), "--method"),
        (("--dataset", "synthetic", "--root", ".", "--seed", 1, "--seed", 2), "--seed"),
        (("--dataset", "synthetic", "--root", ".", "--set", "classifiers=0"), "classifiers"),
        (("--dataset", "synthetic", "--root", ".", "--mano", "."), "--mano is for recordings"),
    ],
)
def test_what_does_not_go_with_a_generator_is_one_sentence(geneoh, tmp_path, asked, word):
    write_tiny_weights(tmp_path / "weights")
    done = geneoh("eval", "--generator", "text2hoi", *asked, code=2)
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert word in done.stderr
