"""`geneoh train`: the weights of one stage, from interactions on disk."""

from pathlib import Path
from typing import Any

import click

from geneoh.choices import STAGES

from .. import options


@click.command()
@click.option("--stage", type=click.Choice(STAGES), required=True, help="Network to train.")
@options.data
@options.folder
@options.config
@options.settings
@click.option(
    "--threads", type=click.IntRange(min=1), help="CPU threads; default: chosen by torch."
)
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
    """Train a stage. An interrupted run continues when it is started again with the same folder.

    Writes STAGE.safetensors, the state of the run and STAGE_log.csv (loss, error left on held-out
    objects, rate, seconds) to the output folder. Once motion, spatial and temporal are there,
    `geneoh denoise --weights FOLDER` uses them. Spatial and temporal learn on the output of
    MotionDiff: of the one in the folder, else of the shipped one. Toch and regression are the
    baselines of `geneoh eval`. Without --config the shipped configuration of the stage is used.
    Settings are those of TrainConfig, such as steps=1000 or corruption.gap_share=0.5.
    """
    import torch

    from geneoh.config import as_dict, configured
    from geneoh.denoisers.library import load_motion
    from geneoh.nn.devices import named_device
    from geneoh.synthesis.shards import find_shards, read_shards, shard_record
    from geneoh.training.config import TrainConfig
    from geneoh.training.loop import train as fit

    from .. import progress

    if threads is not None:
        torch.set_num_threads(threads)
    chosen = configured(TrainConfig(), options.find_config(config or stage), settings)
    parts = read_shards(data, "train"), read_shards(data, "val")
    place = named_device(device)
    follows = stage in ("spatial", "temporal")
    motion_denoiser = load_motion(folder).to(place) if follows else None
    with progress.progress_bars() as on_progress:
        path = fit(
            stage,
            chosen,
            *parts,
            folder,
            device=place,
            motion_denoiser=motion_denoiser,
            data_record=as_dict(shard_record(find_shards(data, "train")[0])),
            on_step=lambda now: on_progress(stage, now.step, now.steps),
        )
    click.echo(f"wrote {path}")
