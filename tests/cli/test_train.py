"""`geneoh synthesize`, `realism` and `train` on a very small scale, and refusals of `eval`."""

from pathlib import Path

import pytest

from geneoh.synthesis import shards


@pytest.fixture
def tiny_shards(monkeypatch):
    """Shards of two interactions instead of 128."""
    plain = shards.SynthesisConfig
    monkeypatch.setattr(
        shards, "SynthesisConfig", lambda count=6: plain(count=count, shard=2, points=64)
    )


SMALL = ("steps=2", "batch=2", "validation_batches=1", "autoencoder_steps=1", "warmup=1")


def test_synthesized_data_trains_every_stage_and_denoise_takes_the_weights(
    geneoh, tmp_path, tiny_shards
):
    made = geneoh("synthesize", "--count", 4)
    assert made.exit_code == 0, made.output
    assert "2 shards made" in made.stdout
    assert (tmp_path / "runs" / "data" / "sheet.png").read_bytes().startswith(b"\x89PNG")
    assert "0 shards made" in geneoh("synthesize", "--count", 4).stdout
    other = geneoh("synthesize", "--count", 4, "--seed", 1)
    assert other.exit_code == 2
    assert "was made with seed 0 where 1 is asked for" in other.stderr
    examples = Path(__file__).parents[2] / "examples"
    recording = examples / "taco_clean.npz", "--obj", examples / "taco_object.obj"
    compared = geneoh("realism", *recording)
    assert compared.exit_code == 2
    assert "take a longer recording or more data" in compared.stderr
    settings = [word for setting in SMALL for word in ("--set", setting)]
    for stage in ("motion", "spatial", "temporal", "toch", "regression"):
        trained = geneoh("train", "--stage", stage, *settings)
        assert trained.exit_code == 0, trained.output
        assert (tmp_path / "runs" / f"{stage}.safetensors").exists()
        log = (tmp_path / "runs" / f"{stage}_log.csv").read_text().splitlines()
        assert log[0] == "step,loss,error_left,rate,seconds"
        assert len(log) == 2


def test_training_without_data_says_how_to_make_some(geneoh):
    result = geneoh("train", "--stage", "spatial")
    assert result.exit_code == 2
    assert "geneoh synthesize" in result.stderr


def test_misspelt_setting_is_refused_with_the_nearest(geneoh):
    result = geneoh("train", "--stage", "motion", "--set", "stepz=3")
    assert result.exit_code == 2
    assert "steps" in result.stderr


def test_eval_of_a_missing_recording_says_where_it_looked(geneoh):
    result = geneoh("eval", "--dataset", "taco", "--root", "nowhere")
    assert result.exit_code == 2
    assert "nowhere" in result.stderr
