"""The state of a training run, its record and log, and the check before a run is resumed."""

import hashlib
import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from geneoh.choices import STAGES
from geneoh.config import flat
from geneoh.errors import CheckpointError
from geneoh.files.atomic import write_whole
from geneoh.files.text import csv_text
from geneoh.nn.checkpoint import Checkpoint
from geneoh.nn.precision import quick_precision
from geneoh.training.optimizer import Optimizer

MAY_CHANGE = ("steps", "checkpoint_every", "validate_every", "validation_batches")
"""Settings that may change when a run is resumed: they affect at most its last steps."""
OF_DATA = ("synthesis", "clips", "recorded")  # settings of how data is made
COMPARED = {
    "stage": "stage",
    "data": "training data (fingerprint)",
    "validation": "validation data (fingerprint)",
    "words": "words of the data (fingerprint)",
    "tokenizer": "vocabulary (fingerprint)",
    "before": "MotionDiff (fingerprint)",
    "text": "text encoder (fingerprint)",
    "contact": "contact network (fingerprint)",
    "branches": "networks that are blended (fingerprint)",
    "interaction": "interaction network (fingerprint)",
    "start": "first weights (fingerprint)",
}
"""Other fields of the record that must be equal when a run is resumed, with names for errors."""


class LogRow(NamedTuple):
    """A row of the log of a run, written at each validation."""

    step: int
    loss: float  # mean training loss since the previous row
    error_left: float  # validation error (`Task.validate`)
    rate: float  # learning rate
    seconds: float  # total time spent on training


@dataclass
class TrainState:
    """Everything that a run needs to continue."""

    model: nn.Module
    average: dict[str, Tensor]  # moving average of the weights
    optimizer: Optimizer
    first: Mapping[str, Tensor] | None = None  # initial weights; None for random ones
    first_share: float = 0.0  # weight of the initial weights in `result`
    step: int = 0
    seconds: float = 0.0
    recent: list[float] = field(default_factory=list)  # losses since the last row of the log
    log: list[LogRow] = field(default_factory=list)

    @property
    def result(self) -> dict[str, Tensor]:
        """The weights for inference: the averaged ones, mixed with the initial ones."""
        if self.first is None or not self.first_share:
            return self.average
        return {
            name: tensor.lerp(self.first[name].to(tensor), self.first_share)
            if tensor.is_floating_point()
            else tensor
            for name, tensor in self.average.items()
        }

    def to_checkpoint(self, record: dict[str, Any]) -> Checkpoint:
        """All tensors of the state by name, with the record of the run."""
        tensors = {f"model.{n}": t for n, t in self.model.state_dict().items()}
        tensors |= {f"average.{n}": t for n, t in self.average.items()}
        tensors |= {f"optimizer.{n}": t for n, t in self.optimizer.tensors().items()}
        counted = {"step": self.step, "seconds": self.seconds, "recent": self.recent}
        return Checkpoint(tensors, record | counted | {"log": self.log})

    def restore(self, checkpoint: Checkpoint) -> None:
        """Load a saved state; `CheckpointError` if its network has another size."""

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
        for name, tensor in group("average.").items():
            self.average[name].copy_(tensor)
        self.optimizer.restore(group("optimizer."))
        record = checkpoint.record
        self.step, self.seconds = record["step"], record["seconds"]
        self.recent = record.get("recent", [])
        self.log = [LogRow(*row) for row in record.get("log", [])]

    def note_validation(self, error_left: float, rate: float) -> None:
        """Add a row to the log."""
        loss = sum(self.recent) / len(self.recent)
        self.log.append(LogRow(self.step, loss, error_left, rate, round(self.seconds, 1)))
        self.recent.clear()

    def weights(self, record: dict[str, Any]) -> Checkpoint:
        """The result in half precision, with the record and the last row of the log."""
        half = {n: t.half() if t.is_floating_point() else t for n, t in self.result.items()}
        final = record | {"step": self.step, "seconds": round(self.seconds)}
        if self.log:
            final |= {"loss": self.log[-1].loss, "error_left": self.log[-1].error_left}
        return Checkpoint(half, final)


def digest(parts: Iterable[Tensor | str]) -> str:
    """A fingerprint of tensors and texts, the same on every machine."""
    found = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            found.update(f"{part}\0".encode())
        else:
            found.update(str(tuple(part.shape)).encode())
            found.update(part.detach().cpu().contiguous().numpy().tobytes())
    return found.hexdigest()[:16]


def run_record(
    task: Mapping[str, Any],
    device: torch.device,
    start: Mapping[str, Tensor] | None,
    processes: int,
) -> dict[str, Any]:
    """The record in a checkpoint: that of the task, with machine, precision and torch version."""
    return {
        **task,
        "start": None if start is None else digest(start.values()),
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else device.type,
        "precision": str(quick_precision(device)).removeprefix("torch."),
        "threads": torch.get_num_threads(),
        "cores": os.cpu_count(),
        "torch": torch.__version__,
        "processes": processes,
    }


def refuse_other_run(
    path: Path, saved: Mapping[str, Any], current: Mapping[str, Any], unread: Collection[str] = ()
) -> None:
    """`CheckpointError` if a saved state was made with another stage, config or data.

    Only fields that the saved record holds are compared. Fields of the config that the stage does
    not read (`unread`) may differ, and those that describe the data, which has a fingerprint.
    """
    differs = [
        f"{words} {_shown(saved[name])} where {_shown(current.get(name))} is asked for"
        for name, words in COMPARED.items()
        if name in saved and saved[name] != current.get(name)
    ]
    # `accumulate` changes the cleaner's training only by rounding, that of generators by more
    may_change = (*MAY_CHANGE, *(("accumulate",) if saved.get("stage") in STAGES else ()))
    unread = {*unread, *OF_DATA}
    old, new = (
        flat({name: value for name, value in record["config"].items() if name not in unread})
        for record in (saved, current)
    )
    differs += [
        f"{name} {old[name]} where {new[name]} is asked for"
        for name in old
        if name in new and name not in may_change and old[name] != new[name]
    ]
    if differs:
        raise CheckpointError(
            f"{path}: the saved run has {', '.join(differs)}; "
            "continue it as it was begun, or choose another output folder"
        )


def _shown(value: Any) -> Any:
    """A value for a message; a long text, such as a vocabulary, is replaced by its fingerprint."""
    return digest([value]) if isinstance(value, str) and len(value) > 60 else value


def write_log(path: Path, rows: Iterable[LogRow]) -> None:
    """Write the log of a run as CSV, with a header."""
    write_whole(path, csv_text([LogRow._fields, *rows]))
