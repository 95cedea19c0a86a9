"""The training loop of all networks: resumable, the same on CPU and GPU."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from geneoh.errors import CheckpointError, ConfigError
from geneoh.files.journal import only_run_in
from geneoh.nn.checkpoint import load_checkpoint, save_checkpoint
from geneoh.nn.precision import multiply_in, quick_precision
from geneoh.progress import OnStep
from geneoh.training.optimizer import Optimizer
from geneoh.training.processes import Team, noted_interrupts
from geneoh.training.resume import TrainState, refuse_other_run, run_record, write_log
from geneoh.training.run_config import RunConfig
from geneoh.training.tasks import MicroBatch, Task


def learning_rate(step: int, config: RunConfig) -> float:
    """Learning rate of a step: linear warm-up, plateau, linear decay to zero."""
    warm = min(1.0, (step + 1) / config.warmup)
    left = (config.steps - step) / max(1.0, config.decay * config.steps)
    return config.rate * warm * min(1.0, left)


def batches(
    task: Task, first: int, team: Team, device: torch.device
) -> Iterator[Sequence[MicroBatch]]:
    """The batches from step `first` on; a thread prepares each one during the previous step."""
    with ThreadPoolExecutor(max_workers=1) as worker:

        def prepared(step: int) -> Future[Sequence[MicroBatch]]:
            return worker.submit(task.pieces, step, team, device)

        ready = prepared(first)
        for step in range(first, task.config.steps):
            batch = ready.result()
            if step + 1 < task.config.steps:
                ready = prepared(step + 1)
            yield batch


def validate(state: TrainState, task: Task, team: Team, device: torch.device) -> float:
    """Mean validation error of the weights that would be written, over fixed batches."""
    kept = {n: t.clone() for n, t in state.model.state_dict().items()}
    state.model.load_state_dict(state.result)
    count = task.config.validation_batches
    left = torch.zeros(count, dtype=torch.float64, device=device)
    for index in range(team.rank, count, team.size):
        left[index] = task.validate(state.model, index)
    state.model.load_state_dict(kept)
    team.add_up([left])
    return sum(left.tolist()) / count


def train(
    task: Task,
    folder: Path,
    *,
    device: torch.device,
    start: Mapping[str, Tensor] | None = None,
    on_step: OnStep | None = None,
    team: Team | None = None,
) -> Path:
    """Train a network and return the path of its weights, `folder`/NAME.safetensors.

    The run's state is saved in `folder`/NAME_state.safetensors after every `checkpoint_every`
    steps; a run started again with the same folder continues from it. NAME_log.csv has a row per
    validation (see `LogRow`). Ctrl-C ends a run after the current step and saves the state. `start`
    holds initial weights, which are random by default. Of several processes, the first writes the
    files; all have the same result.

    Raises:
        CheckpointError: the folder holds a run of another network, config or data, or of more
            steps.
        ConfigError: a batch has fewer samples than pieces to divide it into, or loss or gradient
            are not finite, or `start_share` is not zero without `start`.
        InputError: the folder cannot be made, or another run of the task is working in it.
    """
    team, config = team or Team(), task.config
    if (pieces := team.size * config.accumulate) > config.batch:
        raise ConfigError(
            f"batch: expected {pieces} windows or more for accumulate={config.accumulate} in "
            f"{team.size} processes, got {config.batch}; raise it or lower accumulate"
        )
    with only_run_in(folder, f".{task.name}.lock") if not team.rank else nullcontext():
        return train_alone(task, folder, device=device, start=start, on_step=on_step, team=team)


def trained(task: Task, folder: Path, **how: Any) -> Any:
    """The trained network of a task, for inference on the CPU.

    It is trained in the folder if it is not yet; `how` and errors are those of `train`.
    """
    path = train(task, folder, device=torch.device("cpu"), **how)
    network = task.network()
    network.load_state_dict(load_checkpoint(path).tensors)
    return network.eval().requires_grad_(False)


def train_alone(
    task: Task,
    folder: Path,
    *,
    device: torch.device,
    start: Mapping[str, Tensor] | None,
    on_step: OnStep | None,
    team: Team,
) -> Path:
    """Train in a folder that is locked for this run; see `train`."""
    config = task.config
    state_path, log_path = (
        folder / f"{task.name}_{what}" for what in ("state.safetensors", "log.csv")
    )
    record = run_record(task.record(), device, start, team.size)
    state = first_state(task, device, start)
    if state_path.exists():
        restore(state, state_path, task, record)
        if not team.rank:
            write_log(log_path, state.log)
    upcoming = batches(task, state.step, team, device)
    with noted_interrupts(team) as interrupted:
        while state.step < config.steps:
            began = time.monotonic()
            task.before_step(state)
            stopped = update(state, next(upcoming), config, team, interrupted)
            last = state.step == config.steps
            validates = last or state.step % config.validate_every == 0
            left = validate(state, task, team, device) if validates else None
            state.seconds += time.monotonic() - began
            if left is not None:
                state.note_validation(left, learning_rate(state.step, config))
                if not team.rank:
                    write_log(log_path, state.log)
            saves = last or stopped or state.step % config.checkpoint_every == 0
            if saves and not team.rank:
                save_checkpoint(state_path, state.to_checkpoint(record))
            if on_step is not None:
                on_step(state.step, config.steps)
            if stopped and not last:
                raise KeyboardInterrupt
    path = folder / f"{task.name}.safetensors"
    if not team.rank:
        save_checkpoint(path, state.weights(record))
    return path


def restore(state: TrainState, path: Path, task: Task, record: Mapping[str, Any]) -> None:
    """Load the saved state of the same run; `CheckpointError` if it has taken too many steps."""
    saved = load_checkpoint(path, remedy="remove it to train anew, or choose another output folder")
    refuse_other_run(path, saved.record, record, task.config.unread_by(task.name))
    state.restore(saved)
    if state.step > task.config.steps:
        raise CheckpointError(
            f"{path}: the saved run has taken {state.step} steps, more than the "
            f"{task.config.steps} that are asked for; ask for as many, or choose another output "
            "folder"
        )


def first_state(task: Task, device: torch.device, start: Mapping[str, Tensor] | None) -> TrainState:
    """The state of a run before its first step."""
    if task.config.start_share and start is None:
        raise ConfigError(
            "start_share: expected 0 without weights to start from, got "
            f"{task.config.start_share:g}; name them with --start, or leave it out"
        )
    model = task.network().to(device)
    if start is not None:
        model.load_state_dict(start)
    precision = quick_precision(device)
    multiply_in(model, precision)
    average = {n: t.clone() for n, t in model.state_dict().items()}
    optimizer = Optimizer(model, task.config, precision)
    return TrainState(model, average, optimizer, start, task.config.start_share)


def update(
    state: TrainState,
    pieces: Iterable[MicroBatch],
    config: RunConfig,
    team: Team,
    interrupted: Callable[[], bool],
) -> bool:
    """Take one step of the optimiser and update the averaged weights; whether any process was
    interrupted."""
    state.model.zero_grad(set_to_none=True)
    parts = []
    for piece in pieces:
        part = piece.loss(state.model)
        part.backward()
        parts.append(part.detach())
    taken = torch.stack(parts).sum()
    stop = taken.new_tensor(float(interrupted()))
    team.add_up([*(p.grad for p in state.model.parameters() if p.grad is not None), taken, stop])
    norm = nn.utils.clip_grad_norm_(state.model.parameters(), config.clip)
    if not bool((taken + norm).isfinite()):
        raise ConfigError(
            f"step {state.step + 1}: expected finite loss and gradient, got {taken.item():g} and "
            f"{norm.item():g}; lower rate or clip, or correct the other settings"
        )
    state.optimizer.step(learning_rate(state.step, config))
    update_average(state, config.ema)
    state.step += 1
    state.recent.append(taken.item())
    return bool(stop)


@torch.no_grad()
def update_average(state: TrainState, decay: float) -> None:
    """Update the moving average of the weights; its decay is smaller during the first steps."""
    decay = min(decay, (1 + state.step) / (10 + state.step))
    for name, tensor in state.model.state_dict().items():
        state.average[name].lerp_(tensor, 1 - decay)
