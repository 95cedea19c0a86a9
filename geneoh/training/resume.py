"""What a run of training is, told in its files, and whether a saved state belongs to it."""

import csv
import hashlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from geneoh.choices import StageName
from geneoh.config import as_dict, flat
from geneoh.errors import CheckpointError
from geneoh.files.atomic import write_whole
from geneoh.synthesis.motion import Interactions
from geneoh.training.config import TrainConfig
from geneoh.training.optimizer import quick_precision

MAY_CHANGE = ("steps", "checkpoint_every", "validate_every", "validation_batches")
"""Settings that a run may be continued with another value of: they shape none of its steps but
the last ones."""
COLUMNS = ("step", "loss", "error_left", "rate", "seconds")
DIGITS = 16
"""Hexadecimal digits kept of a digest."""


def digest(tensors: Iterable[Tensor]) -> str:
    """A fingerprint of tensors, the same on every machine."""
    found = hashlib.sha256()
    for tensor in tensors:
        found.update(str(tuple(tensor.shape)).encode())
        found.update(tensor.detach().cpu().contiguous().numpy().tobytes())
    return found.hexdigest()[:DIGITS]


def data_digest(data: Interactions) -> str:
    """A fingerprint of interactions by their people and where each hand ends up."""
    return digest([data.offsets, data.wrist[:, -1]])


def training_record(
    stage: StageName,
    config: TrainConfig,
    data: Interactions,
    validation: Interactions,
    device: torch.device,
    *,
    before: nn.Module | None = None,
    made: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """What a checkpoint says about how it was made.

    Args:
        stage: which network.
        config: of the run.
        data: what it learns from.
        validation: what it is judged on.
        device: where.
        before: MotionDiff, for a stage that follows it.
        made: config and seed of the data, where they are known.
    """
    return {
        "stage": stage,
        "config": as_dict(config),
        "sequences": len(data.wrist),
        "data": data_digest(data),
        "validation": data_digest(validation),
        "before": None if before is None else digest(before.state_dict().values()),
        "made": None if made is None else dict(made),
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else "cpu",
        "precision": str(quick_precision(device)).removeprefix("torch."),
        "threads": torch.get_num_threads(),
        "cores": os.cpu_count(),
        "torch": torch.__version__,
    }


def refuse_other_run(path: Path, saved: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
    """Refuse to continue a state that another stage, config or data made.

    What a state does not tell is not compared.

    Raises:
        CheckpointError: with what differs.
    """
    told = {
        "stage": "stage",
        "data": "training data (fingerprint)",
        "validation": "validation data (fingerprint)",
        "before": "MotionDiff (fingerprint)",
    }
    differs = [
        f"{words} {saved[name]} where {asked[name]} is asked for"
        for name, words in told.items()
        if name in saved and saved[name] != asked[name]
    ]
    old, new = (flat(record["config"]) for record in (saved, asked))
    differs += [
        f"{name} {old[name]} where {new[name]} is asked for"
        for name in old
        if name in new and name not in MAY_CHANGE and old[name] != new[name]
    ]
    if differs:
        raise CheckpointError(
            f"{path}: the saved run has {', '.join(differs)}; "
            "continue it as it was begun, or choose another output folder"
        )


def append_row(path: Path, row: list[float | int]) -> None:
    """Add a row to the log, with a header when the file is new."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(COLUMNS)
        writer.writerow(row)


def last_row(path: Path, *names: str) -> dict[str, float]:
    """Some columns of the newest row of a log; nothing where there is none."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: float(rows[-1][name]) for name in names} if rows else {}


def forget_rows_after(path: Path, step: int) -> None:
    """Take out of a log the rows of steps that will be taken again, and a row cut off in writing.

    Without any row left the file goes.
    """
    if not path.exists():
        return
    head, *rows = path.read_text().splitlines(keepends=True)
    kept = [row for row in rows if row.endswith("\n") and int(row.split(",", 1)[0]) <= step]
    if not kept:
        path.unlink()
    elif kept != rows:
        write_whole(path, "".join([head, *kept]))
