"""`geneoh train`: the weights of one stage, from interactions on disk."""

from pathlib import Path
from typing import Any

import click

from geneoh.choices import STAGES

from .. import options


@click.command()
@click.option("--stage", type=click.Choice(STAGES), required=True, help="Which network.")
@options.data
@options.folder
@options.config
@options.settings
@click.option("--threads", type=click.IntRange(min=1), help="CPU threads, if not torch's choice.")
@options.device
def train(
    stage: Any,
    data: Path,
    folder: Path,
    config: str | None,
    settings: tuple[str, ...],
    threads: int | None,
    device: str,
) -> None:
    """Train a stage; started again with the same folder, an interrupted run continues.

    Writes STAGE.safetensors, the run's state and STAGE_log.csv (loss, error left on held-out
    objects, rate, seconds) to the output folder. Once motion, spatial and temporal are there,
    `geneoh denoise --weights FOLDER` uses them. Spatial and temporal learn on what MotionDiff
    leaves (that of the folder, or the shipped one). Toch and regression are baselines of eval.
    Without --config the shipped one of the stage.
    """
    import torch

    from geneoh.config import as_dict, configured
    from geneoh.denoisers.library import load_motion
    from geneoh.synthesis.shards import find_shards, read_shards, shard_record
    from geneoh.training.config import TrainConfig
    from geneoh.training.loop import train as fit

    from .. import devices, progress

    if threads is not None:
        torch.set_num_threads(threads)
    chosen = configured(TrainConfig(), options.find_config(config or stage), settings)
    parts = read_shards(data, "train"), read_shards(data, "val")
    before = load_motion(folder) if stage in ("spatial", "temporal") else None
    with progress.progress_bars() as on_progress:
        path = fit(
            stage,
            chosen,
            *parts,
            folder,
            device=devices.named(device),
            motion_denoiser=before,
            data_record=as_dict(shard_record(find_shards(data, "train")[0])),
            on_step=lambda now: on_progress(stage, now.step, now.steps),
        )
    click.echo(f"wrote {path}")
