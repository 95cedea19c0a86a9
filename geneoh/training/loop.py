"""The training loop of all stages: visible, resumable, the same on CPU and GPU."""

import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from typing_extensions import assert_never

from geneoh.baselines.regression import RegressionDenoiser
from geneoh.baselines.toch import TochAutoencoder
from geneoh.choices import StageName
from geneoh.denoisers.motion import MotionDenoiser
from geneoh.denoisers.spatial import SpatialDenoiser
from geneoh.denoisers.temporal import TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.errors import CheckpointError
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from geneoh.synthesis.motion import Interactions
from geneoh.synthesis.shards import seed_of
from geneoh.training import losses
from geneoh.training.batches import Batch, draw_batch
from geneoh.training.config import TrainConfig
from geneoh.training.optimizer import Optimizer, multiply_in, quick_precision
from geneoh.training.resume import (
    append_row,
    forget_rows_after,
    last_row,
    refuse_other_run,
    training_record,
)

Loss = Callable[..., Tensor]


@dataclass(frozen=True)
class Progress:
    """What the caller hears after each step."""

    step: int
    steps: int
    loss: float
    left: float | None
    """Error left on validation windows over the input's error; None between validations."""


def build_model(stage: StageName, config: TrainConfig) -> nn.Module:
    """A fresh network of the stage, initialised from the config's seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed_of(config.seed, stage, "weights"))
        match stage:
            case "motion":
                return MotionDenoiser(config.motion)
            case "spatial":
                return SpatialDenoiser(config.spatial)
            case "temporal":
                return TemporalDenoiser(config.temporal)
            case "trajectory":
                return TrajectoryDenoiser(config.trajectory)
            case "toch":
                return TochAutoencoder(config.toch)
            case "regression":
                return RegressionDenoiser(config.regression)
            case _:
                assert_never(stage)


def loss_of(stage: StageName, step: int, config: TrainConfig) -> Loss:
    """The loss to take at a step; the temporal stage learns its autoencoder first."""
    match stage:
        case "motion":
            return losses.motion_loss
        case "spatial":
            return losses.spatial_loss
        case "temporal":
            early = step < config.autoencoder_steps
            return losses.reconstruction_loss if early else losses.temporal_loss
        case "trajectory":
            return losses.trajectory_loss
        case "toch" | "regression":
            return losses.keypoint_loss
        case _:
            assert_never(stage)


def learning_rate(step: int, config: TrainConfig) -> float:
    """Warm-up, plateau, linear decay to zero."""
    warm = min(1.0, (step + 1) / config.warmup)
    left = (config.steps - step) / max(1.0, config.decay * config.steps)
    return config.rate * warm * min(1.0, left)


@dataclass
class TrainState:
    """All that a run needs to go on: network, moving average, optimiser, step, seconds, losses."""

    model: nn.Module
    average: dict[str, Tensor]
    optimizer: Optimizer
    step: int = 0
    seconds: float = 0.0
    recent: list[float] = field(default_factory=list)
    """Losses since the last row of the log."""

    def to_checkpoint(self, record: dict[str, Any]) -> Checkpoint:
        """All tensors of the state, flat, with the record."""
        tensors = {f"model.{n}": t for n, t in self.model.state_dict().items()}
        tensors |= {f"average.{n}": t for n, t in self.average.items()}
        tensors |= {f"optimizer.{n}": t for n, t in self.optimizer.tensors().items()}
        counted = {"step": self.step, "seconds": self.seconds, "recent": self.recent}
        return Checkpoint(tensors, record | counted)

    def restore(self, checkpoint: Checkpoint) -> None:
        """Take up a saved state; `CheckpointError` when it belongs to another network."""

        def group(prefix: str) -> dict[str, Tensor]:
            found = checkpoint.tensors.items()
            return {n.removeprefix(prefix): t for n, t in found if n.startswith(prefix)}

        try:
            self.model.load_state_dict(group("model."))
        except RuntimeError as error:
            raise CheckpointError(
                f"the saved run was made with another network size ({str(error).splitlines()[0]}); "
                "use its config or another output folder"
            ) from error
        self.average = group("average.")
        self.optimizer.restore(group("optimizer."))
        self.step, self.seconds = checkpoint.record["step"], checkpoint.record["seconds"]
        self.recent = checkpoint.record.get("recent", [])


@dataclass(frozen=True)
class Supply:
    """Where the batches of a run come from."""

    stage: StageName
    config: TrainConfig
    device: torch.device
    before: MotionDenoiser | None
    """MotionDiff for a stage that follows it."""

    def batch(self, data: Interactions, *parts: object) -> tuple[Batch, torch.Generator]:
        """Of one step, with its generator: they depend on seed and step only, so runs resume."""
        config = self.config
        generator = torch.Generator().manual_seed(seed_of(config.seed, *parts))
        batch = draw_batch(
            data,
            config.batch,
            generator=generator,
            withheld=config.withheld,
            before=self.before,
        )
        batch = batch.to(self.device)
        if self.stage == "motion":
            _ = batch.motion.network_input  # made and kept here, in parallel to the step before
        return batch, generator

    def batches(self, data: Interactions, first: int) -> Iterator[tuple[Batch, torch.Generator]]:
        """Those of the steps from `first` on, each made while the one before it is learned."""
        with ThreadPoolExecutor(max_workers=1) as worker:

            def prepared(step: int) -> Future[tuple[Batch, torch.Generator]]:
                return worker.submit(self.batch, data, "step", step)

            ready = prepared(first)
            for step in range(first, self.config.steps):
                batch = ready.result()
                if step + 1 < self.config.steps:
                    ready = prepared(step + 1)
                yield batch


@torch.no_grad()
def set_latent_statistics(model: nn.Module, batch: Batch) -> None:
    """Whiten the latent of a trained autoencoder (paper C.5 avoids a normalisation of T itself)."""
    assert isinstance(model, TemporalDenoiser), "only the temporal stage has a latent"
    encoder = model.autoencoder
    encoder.latent_mean.zero_()
    encoder.latent_std.fill_(1.0)
    latent, _ = losses.temporal_latents(model, batch)
    encoder.latent_mean.copy_(latent.mean((0, 1)))
    encoder.latent_std.copy_(latent.std((0, 1)).clamp(min=1e-3))


def validate(state: TrainState, data: Interactions, supply: Supply) -> float:
    """Mean `recovered_fraction` of the averaged weights over fixed validation batches."""
    kept = {n: t.clone() for n, t in state.model.state_dict().items()}
    state.model.load_state_dict(state.average)
    total = 0.0
    count = supply.config.validation_batches
    for index in range(count):
        batch, generator = supply.batch(data, "validation", index)
        total += float(losses.recovered_fraction(state.model, batch, generator=generator))
    state.model.load_state_dict(kept)
    return total / count


def train(
    stage: StageName,
    config: TrainConfig,
    data: Interactions,
    validation: Interactions,
    folder: Path,
    *,
    device: torch.device,
    before: MotionDenoiser | None = None,
    made: Mapping[str, Any] | None = None,
    on_step: Callable[[Progress], None] | None = None,
) -> Path:
    """Train one stage and return the path of its weights, `folder`/`stage`.safetensors.

    The run's state stands in `folder`/`stage`_state.safetensors after every `checkpoint_every`
    steps; an interrupted run started again with the same folder continues there. `stage`_log.csv
    holds a row per validation: step, mean training loss since the last row, error left, rate,
    seconds. `before` is MotionDiff for a stage that follows it, `made` the config and seed of the
    data for the record.

    Raises:
        CheckpointError: the folder holds a run of another network, config or data.
    """
    folder.mkdir(parents=True, exist_ok=True)
    state_path, log_path = folder / f"{stage}_state.safetensors", folder / f"{stage}_log.csv"
    model = build_model(stage, config).to(device)
    precision = quick_precision(device)
    multiply_in(model, precision)
    optimizer = Optimizer(model, config, precision)
    state = TrainState(model, {n: t.clone() for n, t in model.state_dict().items()}, optimizer)
    record = training_record(stage, config, data, validation, device, before=before, made=made)
    if state_path.exists():
        saved = load_checkpoint(state_path)
        refuse_other_run(state_path, saved.record, record)
        state.restore(saved)
        state.average = {n: t.to(device) for n, t in state.average.items()}
    forget_rows_after(log_path, state.step)
    supply = Supply(stage, config, device, before)
    upcoming = supply.batches(data, state.step)
    while state.step < config.steps:
        began = time.monotonic()
        if stage == "temporal" and state.step == config.autoencoder_steps:
            model.load_state_dict(state.average)
            batch, _ = supply.batch(data, "latent")
            set_latent_statistics(model, batch)
            state.average = {n: t.clone() for n, t in model.state_dict().items()}
        batch, generator = next(upcoming)
        loss = loss_of(stage, state.step, config)(model, batch, generator=generator)
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), config.clip)
        optimizer.step(learning_rate(state.step, config))
        update_average(state, config.ema)
        state.step += 1
        state.recent.append(loss.item())
        left = None
        if state.step % config.validate_every == 0 or state.step == config.steps:
            left = validate(state, validation, supply)
        state.seconds += time.monotonic() - began
        if left is not None:
            mean = sum(state.recent) / len(state.recent)
            row = [state.step, mean, left, learning_rate(state.step, config)]
            append_row(log_path, [*row, round(state.seconds, 1)])
            state.recent.clear()
        if state.step % config.checkpoint_every == 0 or state.step == config.steps:
            save_checkpoint(state_path, state.to_checkpoint(record))
        if on_step is not None:
            on_step(Progress(state.step, config.steps, loss.item(), left))
    final = record | {"step": state.step, "seconds": round(state.seconds)}
    final |= last_row(log_path, "loss", "error_left")
    path = folder / f"{stage}.safetensors"
    half = {n: t.half() if t.is_floating_point() else t for n, t in state.average.items()}
    save_checkpoint(path, Checkpoint(half, final))
    return path


@torch.no_grad()
def update_average(state: TrainState, decay: float) -> None:
    """Move the averaged weights towards the network's; faster at first, to forget the start."""
    decay = min(decay, (1 + state.step) / (10 + state.step))
    for name, tensor in state.model.state_dict().items():
        state.average[name].lerp_(tensor, 1 - decay)
