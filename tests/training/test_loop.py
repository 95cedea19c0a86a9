import csv
import math
from dataclasses import replace

import pytest
import torch
from draws import seeded
from stage_runs import Interrupted, heard_losses, stop_after, train_stage

from geneoh.baselines.networks import load_baseline
from geneoh.denoisers.library import load_denoisers
from geneoh.errors import CheckpointError, ConfigError
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.synthesis.draws import Draws
from geneoh.training import stages
from geneoh.training.batches import draw_batch
from geneoh.training.config import TrainConfig
from geneoh.training.loop import learning_rate, update_average
from geneoh.training.losses import latent_loss, motion_loss, reconstruction_loss, temporal_latent
from geneoh.training.optimizer import Optimizer
from geneoh.training.resume import LogRow, TrainState
from geneoh.training.stages import build_model, loss_of, set_latent_statistics

CPU = torch.device("cpu")
STAGES = ("motion", "spatial", "trajectory", "relations", "temporal", "latent")
BASELINES = ("toch", "regression")


def same(first, second) -> bool:
    a, b = (load_checkpoint(path).tensors for path in (first, second))
    return a.keys() == b.keys() and all(torch.equal(a[name], b[name]) for name in a)


def logged(path) -> list[list[str]]:
    """The log but for its last column, the seconds."""
    with path.open(newline="") as file:
        return [row[:-1] for row in csv.reader(file)]


@pytest.mark.parametrize("stage", [*STAGES, *BASELINES])
def test_a_resumed_run_is_the_run_that_was_not_interrupted(tmp_path, clips, tiny, stage):
    """The latent one is interrupted where it turns from the autoencoder to the latent."""
    rest = (clips, clips)
    whole = train_stage(stage, tiny, *rest, tmp_path / "whole", device=CPU)
    for step in (2, 3):  # at a checkpoint, and after the next step, which is taken again
        with pytest.raises(Interrupted):
            train_stage(stage, tiny, *rest, tmp_path / "cut", device=CPU, on_step=stop_after(step))
    resumed = train_stage(stage, tiny, *rest, tmp_path / "cut", device=CPU)
    assert same(whole, resumed)
    state, log = f"{stage}_state.safetensors", f"{stage}_log.csv"
    assert same(whole.with_name(state), resumed.with_name(state))
    assert logged(whole.with_name(log)) == logged(resumed.with_name(log))


def test_rows_of_steps_that_are_taken_again_are_not_logged_twice(tmp_path, clips, tiny):
    often = replace(tiny, checkpoint_every=2, validate_every=1)
    with pytest.raises(Interrupted):
        train_stage("motion", often, clips, clips, tmp_path, device=CPU, on_step=stop_after(3))
    assert [row[0] for row in logged(tmp_path / "motion_log.csv")] == ["step", "1", "2", "3"]
    resumed = replace(often, steps=3, validate_every=3)
    train_stage("motion", resumed, clips, clips, tmp_path, device=CPU)
    assert [row[0] for row in logged(tmp_path / "motion_log.csv")] == ["step", "1", "2", "3"]


def test_a_finished_run_is_left_as_it_is(tmp_path, clips, tiny):
    rest, heard = (clips, clips, tmp_path), []
    first = train_stage("motion", tiny, *rest, device=CPU)
    weights = load_checkpoint(first).tensors
    train_stage("motion", tiny, *rest, device=CPU, on_step=lambda *at: heard.append(at))
    assert heard == []
    again = load_checkpoint(first).tensors
    assert all(torch.equal(again[name], weights[name]) for name in weights)


def test_trained_weights_of_all_stages_can_be_loaded(tmp_path, clips, tiny):
    short = replace(tiny, steps=1)
    for stage in STAGES:
        path = train_stage(stage, short, clips, clips, tmp_path, device=CPU)
        assert path == tmp_path / f"{stage}.safetensors"
    denoisers = load_denoisers(tmp_path)
    assert denoisers.motion.config == tiny.motion
    record = load_checkpoint(tmp_path / "temporal.safetensors").record
    assert record["stage"] == "temporal"
    assert record["step"] == 1
    assert record["sequences"] == 4
    assert record["config"]["seed"] == tiny.seed
    _, loss, left, *_ = logged(tmp_path / "temporal_log.csv")[-1]
    assert (record["loss"], record["error_left"]) == (float(loss), float(left))


@pytest.mark.parametrize("name", BASELINES)
def test_trained_weights_of_a_baseline_can_be_loaded(tmp_path, clips, tiny, name):
    short = replace(tiny, steps=1)
    train_stage(name, short, clips, clips, tmp_path, device=CPU)
    network = load_baseline(name, tmp_path)
    assert network.config == getattr(tiny, name)
    assert not any(p.requires_grad for p in network.parameters())


def test_the_log_has_a_row_per_validation(tmp_path, clips, tiny):
    told = []
    with heard_losses() as (losses, errors):
        run = {"device": CPU, "on_step": lambda *at: told.append(at)}
        train_stage("motion", tiny, clips, clips, tmp_path, **run)
    with (tmp_path / "motion_log.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["step", "loss", "error_left", "rate", "seconds"]
    assert [int(row["step"]) for row in rows] == [2, 4]
    assert float(rows[0]["loss"]) == pytest.approx((losses[0] + losses[1]) / 2)
    assert [float(row["error_left"]) for row in rows] == pytest.approx(errors)
    assert [float(row["rate"]) for row in rows] == [learning_rate(s, tiny) for s in (2, 4)]
    assert told == [(s, 4) for s in (1, 2, 3, 4)]


def test_the_loss_falls(clips, tiny):
    """A hundred steps on one batch, noised anew each time, against the noises of a test."""
    batch = draw_batch(
        clips,
        4,
        tiny,
        generator=seeded(),
    )
    model = build_model("motion", tiny)
    optimizer = Optimizer(model, tiny)

    def loss(seed: int) -> torch.Tensor:
        return motion_loss(model, batch, Draws(4, seeded(seed)))

    def tested() -> float:
        with torch.no_grad():
            return float(sum(loss(seed) for seed in range(1000, 1010)) / 10)

    before = tested()
    for step in range(100):
        model.zero_grad()
        loss(step).backward()
        optimizer.step(1e-2)
    assert tested() < 0.75 * before


def test_a_state_of_another_network_size_is_refused(tiny):
    def state(width: int) -> TrainState:
        model = build_model("motion", replace(tiny, motion=replace(tiny.motion, width=width)))
        return TrainState(model, model.state_dict(), Optimizer(model, tiny))

    with pytest.raises(CheckpointError, match="another network size"):
        state(32).restore(state(16).to_checkpoint({}))


def test_a_state_is_restored_whole(tmp_path, tiny):
    def state() -> TrainState:
        model = build_model("motion", tiny)
        average = {n: t.clone() for n, t in model.state_dict().items()}
        return TrainState(model, average, Optimizer(model, tiny))

    first, second = state(), state()
    sum(p.sum() for p in first.model.parameters()).backward()
    first.optimizer.step(1e-2)
    first.step, first.seconds, first.recent = 7, 1.5, [0.5, 0.25]
    first.log.append(LogRow(4, 0.75, 0.9, 1e-3, 1.0))
    update_average(first, 0.5)
    second.restore(first.to_checkpoint({"stage": "motion"}))
    a, b = (s.to_checkpoint({}) for s in (first, second))
    counted = {"step": 7, "seconds": 1.5, "recent": [0.5, 0.25]}
    assert a.record == b.record == counted | {"log": first.log}
    assert a.tensors.keys() == b.tensors.keys()
    for part in ("adamw", "muon"):
        assert any(name.startswith(f"optimizer.{part}.") for name in a.tensors)
    assert all(torch.equal(a.tensors[name], b.tensors[name]) for name in a.tensors)


def test_attention_heads_that_cannot_share_a_width_are_refused(tiny):
    with pytest.raises(ConfigError, match=r"2 x the number of heads, got 33 for 2 heads"):
        build_model("motion", replace(tiny, motion=replace(tiny.motion, width=33)))


def test_a_run_whose_loss_is_no_number_ends_with_its_last_state(tmp_path, clips, tiny, monkeypatch):
    def broken_from_the_third(stage, step, config):
        if step < 2:
            return loss_of(stage, step, config)
        return lambda *given: math.nan * loss_of(stage, step, config)(*given)

    monkeypatch.setattr(stages, "loss_of", broken_from_the_third)
    with pytest.raises(ConfigError, match="step 3: expected finite loss and gradient"):
        train_stage("motion", replace(tiny, checkpoint_every=1), clips, clips, tmp_path, device=CPU)
    kept = load_checkpoint(tmp_path / "motion_state.safetensors").tensors
    assert all(bool(t.isfinite().all()) for n, t in kept.items() if n.startswith("model."))
    assert not (tmp_path / "motion.safetensors").exists()


def test_the_rate_warms_up_holds_and_falls_to_zero():
    config = TrainConfig(steps=1000, rate=1e-3, warmup=100, decay=0.3)
    rates = [learning_rate(step, config) for step in range(1001)]
    assert rates[0] == pytest.approx(1e-5)
    assert rates[49] == pytest.approx(5e-4)
    assert rates[99:701] == pytest.approx([1e-3] * 602)
    assert rates[850] == pytest.approx(5e-4)
    assert rates[1000] == 0
    assert max(rates) <= 1e-3 + 1e-12


def test_the_average_forgets_its_start_and_then_moves_slowly(tiny):
    model = build_model("motion", tiny)
    average = {n: torch.zeros_like(t) for n, t in model.state_dict().items()}
    state = TrainState(model, average, Optimizer(model, tiny))
    for step, kept in ((0, 0.1), (100_000, 0.99)):
        for tensor in state.average.values():
            tensor.zero_()
        state.step = step
        update_average(state, 0.99)
        for name, tensor in model.state_dict().items():
            torch.testing.assert_close(state.average[name], (1 - kept) * tensor)


def test_fresh_weights_follow_the_seed_and_leave_the_global_generator_alone(tiny):
    torch.manual_seed(3)
    before = torch.random.get_rng_state()
    first, second = (build_model("spatial", tiny).state_dict() for _ in range(2))
    other = build_model("spatial", replace(tiny, seed=1)).state_dict()
    assert torch.equal(torch.random.get_rng_state(), before)
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert any(not torch.equal(first[name], other[name]) for name in first)


def test_the_latent_stage_learns_its_autoencoder_first(tiny):
    assert loss_of("latent", 1, tiny) is reconstruction_loss
    assert loss_of("latent", 2, tiny) is latent_loss
    assert loss_of("motion", 0, tiny) is motion_loss


def test_the_latent_is_white_once_its_statistics_are_set(clips, tiny):
    model = build_model("latent", tiny)
    batch = draw_batch(clips, 2, TrainConfig(), generator=seeded())
    for _ in range(2):  # what was set before does not matter
        set_latent_statistics(model, batch)
        latent = temporal_latent(model, batch, batch.clean)
        torch.testing.assert_close(latent.mean((0, 1)), torch.zeros(6), atol=1e-4, rtol=0)
        torch.testing.assert_close(latent.std((0, 1)), torch.ones(6), atol=1e-3, rtol=0)
