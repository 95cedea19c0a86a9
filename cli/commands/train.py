"""`geneoh train`: the weights of one stage, from made interactions and from recordings."""

from pathlib import Path
from typing import Any

import click
from click import Choice

from geneoh.choices import STAGES

from .. import options, progress

FOLLOWS = ("spatial", "temporal", "relations")
"""Stages that learn on the output of MotionDiff."""


@click.command()
@options.option("--stage: Network to train.", Choice(STAGES), required=True)
@options.many(
    "--data sources: What to learn from; may be repeated. A folder alone holds made "
    "interactions, and they are made where it is empty. SOURCE is one of `geneoh convert "
    "--help`, or `sequences` for npz files; WEIGHT is its share of the windows, relative to "
    "the others.",
    default=("runs/data",),
    metavar="[SOURCE=]PATH[:WEIGHT]",
)
@options.folder
@options.config_and_settings
@options.option(
    "--start: Weights to go on from instead of random ones: the shipped ones, or those of a "
    "folder. The configuration is then `finetune`, if no other is named.",
    options.FOLDER,
    metavar="shipped|FOLDER",
)
@options.mano
@options.option("--threads: CPU threads; default: chosen by torch.", options.COUNT)
@options.device
def train(
    stage: Any,
    sources: tuple[str, ...],
    folder: Path,
    config: str | None,
    settings: tuple[str, ...],
    start: Path | None,
    mano: Path | None,
    threads: int | None,
    device: str,
) -> None:
    """Train a stage. An interrupted run continues when it is started again with the same folder.

    Writes STAGE.safetensors, the state of the run and STAGE_log.csv (loss, error left on held-out
    objects, rate, seconds) to the output folder, and the clips that are cut out of recordings to
    its subfolder recordings/. Once motion, spatial and temporal are there, `geneoh denoise
    --weights FOLDER` uses them. Spatial and temporal learn on the output of MotionDiff: of the one
    in the folder, else of the shipped one. Toch and regression are the baselines of `geneoh eval`.
    Without --config the shipped configuration of the stage is used. Settings are those of
    TrainConfig, such as steps=1000, corruption.gap_share=0.5 or synthesis.count=2048.

    Several processes share each batch, on one machine or on many, and take the same steps as one:
    torchrun --nproc-per-node 2 --no-python geneoh train --stage motion. With --device cuda each
    has a GPU.
    """
    import torch

    from geneoh.config import configured
    from geneoh.denoisers.library import load_motion
    from geneoh.nn.devices import named_device
    from geneoh.readers.base import ReaderOptions
    from geneoh.training.config import TrainConfig
    from geneoh.training.data import parsed_source, training_data
    from geneoh.training.loop import train as fit
    from geneoh.training.processes import joined
    from geneoh.training.stages import StageTask
    from geneoh.training.start import started_from

    if threads is not None:
        torch.set_num_threads(threads)
    with joined(named_device(device)) as (team, place):
        named = config or ("finetune" if start else stage)
        chosen, weights = configured(TrainConfig(), options.find_config(named), settings), None
        if start is not None:
            chosen, weights = started_from(
                None if start == Path("shipped") else start, stage, chosen
            )
        asked, follows = [parsed_source(text) for text in sources], stage in FOLLOWS
        say = click.echo if not team.rank else lambda words: None
        readers, cache = ReaderOptions(mano_dir=mano), folder / "recordings"
        with team.first_alone(), progress.progress_bars(not team.rank) as on_progress:
            data = training_data(asked, cache, chosen, readers, on_progress=on_progress)
        for note in data.notes:
            say(note)
        with progress.progress_bars(not team.rank) as on_progress:
            path = fit(
                StageTask(
                    stage,
                    chosen,
                    data.training,
                    data.validation,
                    load_motion(folder).to(place) if follows else None,
                    data.record,
                ),
                folder,
                device=place,
                start=weights,
                on_step=lambda now: on_progress(stage, now.step, now.steps),
                team=team,
            )
        say(f"wrote {path}")
