"""The training loop of all stages: visible, resumable, the same on CPU and GPU."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from geneoh.baselines.regression import RegressionDenoiser
from geneoh.baselines.toch import TochAutoencoder
from geneoh.choices import StageName
from geneoh.denoisers.motion import MotionDenoiser
from geneoh.denoisers.relations import RelationDenoiser
from geneoh.denoisers.spatial import SpatialDenoiser
from geneoh.denoisers.temporal import TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.errors import ConfigError
from geneoh.nn.checkpoint import load_checkpoint, save_checkpoint
from geneoh.synthesis.draws import Part
from geneoh.synthesis.motion import Interactions
from geneoh.synthesis.shards import seed_of
from geneoh.training import losses
from geneoh.training.batches import Batch, draw_batch
from geneoh.training.config import TrainConfig
from geneoh.training.optimizer import Optimizer, multiply_in, quick_precision
from geneoh.training.processes import Team, noted_interrupts
from geneoh.training.resume import (
    TrainState,
    refuse_other_run,
    training_record,
    write_log,
)

Loss = Callable[..., Tensor]

STAGES: dict[StageName, tuple[Callable[[Any], nn.Module], Loss]] = {
    "motion": (MotionDenoiser, losses.motion_loss),
    "spatial": (SpatialDenoiser, losses.spatial_loss),
    "temporal": (TemporalDenoiser, losses.temporal_loss),
    "trajectory": (TrajectoryDenoiser, losses.trajectory_loss),
    "relations": (RelationDenoiser, losses.relation_loss),
    "toch": (TochAutoencoder, losses.keypoint_loss),
    "regression": (RegressionDenoiser, losses.keypoint_loss),
}
"""Network and loss of each stage."""


@dataclass(frozen=True)
class Progress:
    """The progress of a run, which the caller gets after each step."""

    step: int
    steps: int
    loss: float
    error_left: float | None
    """Error left on validation windows over the input's error; None between validations."""


def build_model(stage: StageName, config: TrainConfig) -> nn.Module:
    """A fresh network of the stage, initialised from the config's seed."""
    network, _ = STAGES[stage]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed_of(config.seed, stage, "weights"))
        return network(getattr(config, stage))


def loss_of(stage: StageName, step: int, config: TrainConfig) -> Loss:
    """The loss to take at a step; the temporal stage learns its autoencoder first."""
    if stage == "temporal" and step < config.autoencoder_steps:
        return losses.reconstruction_loss
    return STAGES[stage][1]


def learning_rate(step: int, config: TrainConfig) -> float:
    """Warm-up, plateau, linear decay to zero."""
    warm = min(1.0, (step + 1) / config.warmup)
    left = (config.steps - step) / max(1.0, config.decay * config.steps)
    return config.rate * warm * min(1.0, left)


@dataclass(frozen=True)
class Piece:
    """Windows of a batch on which the loss is taken at once."""

    batch: Batch
    generator: torch.Generator
    part: Part  # which windows of the batch they are

    def loss(self, of: Loss, model: nn.Module) -> Tensor:
        """What the windows add to the loss of the batch."""
        share = self.part.count / self.part.total
        return share * of(model, self.batch, generator=self.generator, part=self.part)


@dataclass(frozen=True)
class BatchSource:
    """Where the batches of a run come from."""

    stage: StageName
    config: TrainConfig
    device: torch.device
    motion_denoiser: MotionDenoiser | None  # MotionDiff for a stage that follows it
    team: Team = field(default_factory=Team)

    def batch(
        self, data: Interactions, *parts: object, part: Part | None = None
    ) -> tuple[Batch, torch.Generator]:
        """A batch, or part of it, with its generator, by seed and `parts` (purpose, number)."""
        config = self.config
        generator = torch.Generator().manual_seed(seed_of(config.seed, *parts))
        batch = draw_batch(
            data,
            config.batch,
            config,
            generator=generator,
            motion_denoiser=self.motion_denoiser,
            part=part,
        )
        return batch.to(self.device), generator

    def pieces(self, data: Interactions, step: int) -> list[Piece]:
        """This process's part of the batch of a step, in the pieces that are worked off in turn."""
        whole = Part(0, self.config.batch, self.config.batch)
        own = whole.divided(self.team.size)[self.team.rank]
        batch, generator = self.batch(data, "step", step, part=own)
        pieces = []
        for part in own.divided(self.config.accumulate):
            rows = slice(part.first - own.first, part.first - own.first + part.count)
            piece = batch.take(rows, "B")
            if self.stage == "motion":
                _ = piece.motion.network_input  # made and kept here, in parallel to the step before
            again = torch.Generator().set_state(generator.get_state())
            pieces.append(Piece(piece, again, part))
        return pieces

    def batches(self, data: Interactions, first: int) -> Iterator[list[Piece]]:
        """The batches of the steps from `first` on, each made while the one before is learned."""
        with ThreadPoolExecutor(max_workers=1) as worker:

            def prepared(step: int) -> Future[list[Piece]]:
                return worker.submit(self.pieces, data, step)

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


def validate(state: TrainState, data: Interactions, source: BatchSource) -> float:
    """Mean `recovered_fraction` of the averaged weights over fixed validation batches."""
    kept = {n: t.clone() for n, t in state.model.state_dict().items()}
    state.model.load_state_dict(state.average)
    team, count = source.team, source.config.validation_batches
    left = torch.zeros(count, dtype=torch.float64, device=source.device)
    for index in range(team.rank, count, team.size):
        batch, generator = source.batch(data, "validation", index)
        left[index] = losses.recovered_fraction(state.model, batch, generator=generator)
    state.model.load_state_dict(kept)
    team.add_up([left])
    return sum(left.tolist()) / count


def train(
    stage: StageName,
    config: TrainConfig,
    data: Interactions,
    validation: Interactions,
    folder: Path,
    *,
    device: torch.device,
    motion_denoiser: MotionDenoiser | None = None,
    data_record: Mapping[str, Any] | None = None,
    start: Mapping[str, Tensor] | None = None,
    on_step: Callable[[Progress], None] | None = None,
    team: Team | None = None,
) -> Path:
    """Train one stage and return the path of its weights, `folder`/`stage`.safetensors.

    The run's state is saved in `folder`/`stage`_state.safetensors after every `checkpoint_every`
    steps; a run started again with the same folder continues there. `stage`_log.csv has a row per
    validation (see `LogRow`). Ctrl-C ends a run after its step, with the state saved. A stage that
    follows MotionDiff needs `motion_denoiser`; the record of the weights holds `data_record`;
    `start` takes the place of random first weights. Of several processes the first writes the
    files; all have the same result.

    Raises:
        CheckpointError: the folder holds a run of another network, config or data.
        ConfigError: there are fewer windows in a batch than pieces to divide it into.
    """
    team = team or Team()
    check_division(config, team)
    folder.mkdir(parents=True, exist_ok=True)
    state_path, log_path = folder / f"{stage}_state.safetensors", folder / f"{stage}_log.csv"
    made_from = {"motion_denoiser": motion_denoiser, "data_record": data_record, "start": start}
    record = training_record(stage, config, data, validation, device, **made_from)
    record["processes"] = team.size
    state = first_state(stage, config, device, start)
    if state_path.exists():
        saved = load_checkpoint(
            state_path, remedy="remove it to train anew, or choose another output folder"
        )
        refuse_other_run(state_path, saved.record, record)
        state.restore(saved)
        if not team.rank:
            write_log(log_path, state.log)
    source = BatchSource(stage, config, device, motion_denoiser, team)
    upcoming = source.batches(data, state.step)
    with noted_interrupts(team) as interrupted:
        while state.step < config.steps:
            began = time.monotonic()
            if stage == "temporal" and state.step == config.autoencoder_steps:
                # the denoiser of the latent starts with the averaged weights of the autoencoder
                state.model.load_state_dict(state.average)
                set_latent_statistics(state.model, source.batch(data, "latent")[0])
                state.average = {n: t.clone() for n, t in state.model.state_dict().items()}
            loss = loss_of(stage, state.step, config)
            taken, stopped = update(state, next(upcoming), loss, config, team, interrupted)
            last = state.step == config.steps
            validates = last or state.step % config.validate_every == 0
            left = validate(state, validation, source) if validates else None
            state.seconds += time.monotonic() - began
            if left is not None:
                state.note_validation(left, learning_rate(state.step, config))
                if not team.rank:
                    write_log(log_path, state.log)
            saves = last or stopped or state.step % config.checkpoint_every == 0
            if saves and not team.rank:
                save_checkpoint(state_path, state.to_checkpoint(record))
            if on_step is not None:
                on_step(Progress(state.step, config.steps, taken, left))
            if stopped and not last:
                raise KeyboardInterrupt
    path = folder / f"{stage}.safetensors"
    if not team.rank:
        save_checkpoint(path, state.weights(record))
    return path


def check_division(config: TrainConfig, team: Team) -> None:
    """Refuse to divide a batch into more pieces than it has windows."""
    if config.accumulate < 1:
        raise ConfigError(
            f"accumulate: expected 1 piece or more, got {config.accumulate}; raise it"
        )
    pieces = team.size * config.accumulate
    if pieces > config.batch:
        raise ConfigError(
            f"batch: expected {pieces} windows or more for accumulate={config.accumulate} in "
            f"{team.size} processes, got {config.batch}; raise it or lower accumulate"
        )


def first_state(
    stage: StageName,
    config: TrainConfig,
    device: torch.device,
    start: Mapping[str, Tensor] | None = None,
) -> TrainState:
    """The state of a run before its first step."""
    model = build_model(stage, config).to(device)
    if start is not None:
        model.load_state_dict(start)
    precision = quick_precision(device)
    multiply_in(model, precision)
    average = {n: t.clone() for n, t in model.state_dict().items()}
    return TrainState(model, average, Optimizer(model, config, precision))


def update(
    state: TrainState,
    pieces: Iterable[Piece],
    loss: Loss,
    config: TrainConfig,
    team: Team,
    interrupted: Callable[[], bool],
) -> tuple[float, bool]:
    """One step of the optimiser and of the averaged weights.

    Returns the loss of the batch, and whether any process was interrupted.
    """
    state.optimizer.zero_grad()
    parts = []
    for piece in pieces:
        part = piece.loss(loss, state.model)
        part.backward()
        parts.append(part.detach())
    taken = torch.stack(parts).sum()
    stop = taken.new_tensor(float(interrupted()))
    team.add_up([*(p.grad for p in state.model.parameters() if p.grad is not None), taken, stop])
    nn.utils.clip_grad_norm_(state.model.parameters(), config.clip)
    state.optimizer.step(learning_rate(state.step, config))
    update_average(state, config.ema)
    state.step += 1
    state.recent.append(taken.item())
    return taken.item(), bool(stop)


@torch.no_grad()
def update_average(state: TrainState, decay: float) -> None:
    """Move the averaged weights towards the network's; faster at first, to forget the start."""
    decay = min(decay, (1 + state.step) / (10 + state.step))
    for name, tensor in state.model.state_dict().items():
        state.average[name].lerp_(tensor, 1 - decay)
