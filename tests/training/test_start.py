"""Runs that go on from weights that have learned, and a run that learns one recording by heart."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from stage_runs import train_stage

from geneoh.baselines.networks import SHIPPED as BASELINE_WEIGHTS
from geneoh.choices import STAGES
from geneoh.denoisers.library import SHIPPED
from geneoh.denoisers.motion import MotionConfig
from geneoh.errors import CheckpointError, ConfigError
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.training.config import TrainConfig
from geneoh.training.data import DataSource, training_data
from geneoh.training.loop import first_state
from geneoh.training.recordings import ClipConfig
from geneoh.training.stages import StageTask
from geneoh.training.start import started_from
from geneoh.training.windows import WindowConfig

CPU = torch.device("cpu")
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_starts_from_its_shipped_weights(stage, clips):
    folder = BASELINE_WEIGHTS if stage in ("toch", "regression") else SHIPPED
    shipped = load_checkpoint(folder / f"{stage}.safetensors").tensors
    config, weights = started_from(None, stage, TrainConfig())
    state = first_state(StageTask(stage, config, clips, clips), CPU, weights)
    assert state.step == 0
    for name, tensor in state.model.state_dict().items():
        assert tensor.equal(shipped[name].to(tensor.dtype)), name
        assert state.average[name].equal(tensor), name
    assert config.autoencoder_steps == 0


def test_weights_of_a_folder_bring_their_network_and_go_on_learning(clips, tiny, tmp_path):
    train_stage("motion", tiny, clips, clips, tmp_path / "first", device=CPU)
    config, weights = started_from(tmp_path / "first", "motion", replace(TrainConfig(), batch=2))
    assert config.motion == tiny.motion
    config = replace(config, steps=1, validation_batches=1, warmup=1, rate=1e-6)
    out = tmp_path / "second"
    train_stage("motion", config, clips, clips, out, device=CPU, start=weights)
    after = load_checkpoint(out / "motion.safetensors").tensors
    for name, tensor in weights.items():
        if tensor.is_floating_point():
            torch.testing.assert_close(after[name], tensor, atol=2e-3, rtol=2e-3)
    with pytest.raises(CheckpointError, match=r"first weights \(fingerprint\)"):
        train_stage("motion", config, clips, clips, out, device=CPU)


def test_the_latent_stage_keeps_the_statistics_of_the_autoencoder_that_it_starts_from(clips):
    config, weights = started_from(None, "latent", TrainConfig())
    task = StageTask("latent", config, clips, clips)
    state = first_state(task, CPU, weights)
    task.before_step(state)
    for name in ("autoencoder.latent_mean", "autoencoder.latent_std"):
        assert state.model.state_dict()[name].equal(weights[name].float()), name


def test_a_run_may_keep_a_share_of_the_weights_that_it_starts_from(clips, tiny, tmp_path):
    """What is validated and written is the mean; the state goes on from the weights alone."""
    train_stage("motion", tiny, clips, clips, tmp_path / "first", device=CPU)
    config, first = started_from(tmp_path / "first", "motion", replace(tiny, rate=0.05))
    written, states, errors = [], [], []
    for share in (0.0, 0.4, 1.0):
        out, chosen = tmp_path / str(share), replace(config, start_share=share)
        path = train_stage("motion", chosen, clips, clips, out, device=CPU, start=first)
        saved = load_checkpoint(path)
        assert saved.record["config"]["start_share"] == share
        written.append(saved.tensors)
        states.append(load_checkpoint(out / "motion_state.safetensors").tensors)
        errors.append(saved.record["error_left"])
    assert len(set(errors)) == 3
    for name, tensor in states[0].items():
        assert tensor.equal(states[1][name]), name
    learned, mixed, kept = written
    for name, tensor in first.items():
        mean = 0.6 * learned[name].double() + 0.4 * tensor.double()
        torch.testing.assert_close(mixed[name].double(), mean, atol=2e-3, rtol=2e-3)
        assert kept[name].equal(tensor.to(kept[name].dtype)), name
    assert not learned["head.weight"].equal(mixed["head.weight"])
    with pytest.raises(ConfigError, match="start_share: expected 0 without weights"):
        train_stage("motion", chosen, clips, clips, tmp_path / "none", device=CPU)


def test_settings_of_another_network_than_that_of_the_weights_are_refused(clips, tiny, tmp_path):
    train_stage("motion", tiny, clips, clips, tmp_path, device=CPU)
    same = replace(TrainConfig(), motion=MotionConfig(width=tiny.motion.width))
    assert started_from(tmp_path, "motion", same)[0].motion == tiny.motion
    other = replace(TrainConfig(), motion=MotionConfig(width=32))
    with pytest.raises(ConfigError, match=r"motion network of .* has width 16 where 32 is asked"):
        started_from(tmp_path, "motion", other)


@pytest.mark.parametrize("stage", STAGES)
def test_a_folder_without_weights_of_the_stage_is_refused(stage, tmp_path):
    with pytest.raises(CheckpointError, match=rf"{stage}\.safetensors: expected weights there"):
        started_from(tmp_path, stage, TrainConfig())


def test_weights_of_another_network_are_refused(tmp_path):
    (tmp_path / "motion.safetensors").write_bytes((SHIPPED / "spatial.safetensors").read_bytes())
    with pytest.raises(CheckpointError, match="expected weights of this version's motion network"):
        started_from(tmp_path, "motion", TrainConfig())


@pytest.mark.slow
def test_one_recording_can_be_learned_by_heart(tiny, tmp_path):
    config = replace(
        tiny,
        **{"steps": 60, "batch": 8, "rate": 5e-3, "warmup": 5, "checkpoint_every": 60},
        validate_every=20,
        windows=WindowConfig(frames=16, short_share=0.0, fast_share=0.0),
        clips=ClipConfig(shortest=16, longest=32, points=48),
        augmentation=replace(tiny.augmentation, share=0.0, style_share=0.0),
    )
    source = DataSource(EXAMPLES / "taco_clean.npz", "sequences")
    data = training_data([source], tmp_path / "cache", config)
    train_stage("motion", config, data.training, data.validation, tmp_path, device=CPU)
    rows = (tmp_path / "motion_log.csv").read_text().splitlines()[1:]
    losses = [float(row.split(",")[1]) for row in rows]
    assert losses[2] < 0.8 * losses[0]
