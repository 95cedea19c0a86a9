"""`geneoh train`: the weights of one stage, from made interactions and from recordings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from click import Choice

from geneoh.choices import BODY_SOURCES, BODY_STAGES, GENERATOR_STAGES, SEED_LIMITS, STAGES
from geneoh.errors import ConfigError

from .. import options, progress

ACTIONS = "runs/actions"
"""Default folder of the actions that the generator learns from."""
BODIES = "runs/bodies"
"""Default folder of the bodies that the generator of hands learns from."""


@click.command()
@options.option(
    "--stage: Network to train.",
    Choice((*STAGES, *GENERATOR_STAGES, *BODY_STAGES)),
    required=True,
)
@options.many(
    "--data sources: What to learn from; may be repeated. A folder alone holds made clips; "
    "interactions to clean are made where it is empty. SOURCE is one of `geneoh convert --help`, "
    "or `sequences` for npz files; WEIGHT is its share of the windows, relative to the others.",
    show_default=f"{options.INTERACTIONS}; {ACTIONS} and {BODIES} for the generators",
    metavar="[SOURCE=]PATH[:WEIGHT]",
)
@options.folder
@options.config_and_settings
@options.option(
    "--seed: Seed of the first weights and of every batch.  [default: the configuration's]",
    click.IntRange(*SEED_LIMITS),
)
@options.option(
    "--start: Weights to go on from instead of random ones: the shipped ones, or those of a "
    "folder. The configuration is then `finetune`, if no other is named.",
    options.FOLDER,
    metavar="shipped|FOLDER",
)
@options.mano
@options.option(
    "--text-encoder: Folder of a CLIP or sentence-transformers model that networks of the "
    "generator are to be told sentences by; default: ours.",
    options.FOLDER,
)
@options.option(
    "--skeleton: Your SMPL-H or SMPL-X model, for the exact bones of recorded bodies; without it "
    "those of a typical adult.",
    options.FILE,
)
@options.option("--threads: CPU threads; default: chosen by torch.", options.COUNT)
@options.device
def train(
    config: str | None, seed: int | None, threads: int | None, device: str, **chosen: Any
) -> None:
    """Train a stage. An interrupted run continues when it is started again with the same folder.

    Writes STAGE.safetensors, the state of the run and STAGE_log.csv (loss, error left on held-out
    objects, rate, seconds) to the output folder, and the clips that are cut out of recordings to
    its subfolder recordings/. Once motion, spatial and temporal are there, `geneoh denoise
    --weights FOLDER` uses them. Spatial and temporal learn on the output of MotionDiff: of the one
    in the folder, else of the shipped one. Trajectory, relations and latent are the stages in the
    paper's form, for the preset `paper`. Toch and regression are the baselines of `geneoh eval`.
    Without --config the shipped configuration of the stage is used. Settings are those of
    TrainConfig, such as steps=1000, corruption.gap_share=0.5 or synthesis.count=2048. A file may
    serve several stages; --set takes settings of the stage alone.

    Text, length, contact, interaction and refiner are networks of the generator. All but the first
    learn from one folder of `geneoh synthesize --actions`, or from recordings of h2o=, grab= or
    arctic=, each with those before it that are in the output folder, or the shipped ones. Their
    settings are those of TextTrainConfig, LengthTrainConfig and, from contact on, Text2HoiConfig.

    Body_hands, text_hands and blend are networks of the generator of hands for a body. They learn
    from one folder of `geneoh synthesize --bodies`, or from recordings of both57m=, motionx= or
    amass= (bodies alone), the blend with the other two, which are in the output folder, or the
    shipped ones; their settings are those of Both2HandsConfig.

    Several processes share each batch, on one machine or on many, and take the same steps as one,
    those of the generators nearly the same: torchrun --nproc-per-node 2 --no-python -- geneoh train
    --stage motion. With --device cuda each has a GPU.
    """
    from functools import partial

    import torch

    from geneoh.nn.devices import named_device
    from geneoh.training.loop import train as fit
    from geneoh.training.processes import joined
    from geneoh.training.run_config import refuse_replaced

    if threads is not None:
        torch.set_num_threads(threads)
    stage, folder = chosen["stage"], chosen["folder"]
    if seed is not None:
        chosen["settings"] = (*chosen["settings"], f"seed={seed}")
    request = Request(config or ("finetune" if chosen["start"] else stage), **chosen)
    make = cleaner_task if stage in STAGES else _generator_task
    with joined(named_device(device)) as (team, place):
        say = click.echo if not team.rank else lambda words: None
        with team.first_alone(), progress.progress_bars(not team.rank) as on_progress:
            task, weights, notes = make(request, place, on_progress)
            refuse_replaced(task.config, *request.configuration())
        for note in notes:
            say(note)
        with progress.progress_bars(not team.rank) as on_progress:
            path = fit(
                task,
                folder,
                device=place,
                start=weights,
                on_step=partial(on_progress, stage),
                team=team,
            )
        say(f"wrote {path}")


@dataclass(frozen=True)
class Request:
    """What the command line asks for, by the names of its parameters."""

    config: str
    stage: Any
    sources: tuple[str, ...]
    folder: Path
    settings: tuple[str, ...]
    start: Path | None
    mano: Path | None
    text_encoder: Path | None
    skeleton: Path | None

    def configuration(self) -> tuple[Path, tuple[str, ...]]:
        """The file of the configuration, and the settings that change it."""
        return options.find_config(self.config), self.settings

    def only_source(self, default: str) -> str:
        """The source that a generator learns from; `ConfigError` for more than one."""
        if len(self.sources) > 1:
            raise ConfigError(
                f"--data: expected one source with --stage {self.stage}, got {len(self.sources)}; "
                "keep one"
            )
        return self.sources[0] if self.sources else default


def cleaner_task(request: Request, place: Any, on_progress: Any) -> Any:
    """The training task of a stage of the cleaner, its initial weights, and notes on its data."""
    from geneoh.denoisers.library import load_motion
    from geneoh.readers.base import ReaderOptions
    from geneoh.synthesis.shapes.scans import FILE
    from geneoh.training.config import FOLLOWS, TrainConfig
    from geneoh.training.data import parsed_source, refuse_other_making, training_data
    from geneoh.training.run_config import refuse_settings, stage_config
    from geneoh.training.stages import StageTask
    from geneoh.training.start import started_from

    stage, folder, start = request.stage, request.folder, request.start
    _refuse_unused(stage, "text_encoder", "skeleton")
    chosen, weights = stage_config(TrainConfig(), stage, *request.configuration()), None
    if start is not None:
        chosen, weights = started_from(None if start == Path("shipped") else start, stage, chosen)
    sources = [parsed_source(text) for text in request.sources or (options.INTERACTIONS,)]
    readers = ReaderOptions(mano_dir=request.mano)
    if not any(one.source for one in sources):
        _refuse_unused(f"{stage} and made interactions", "mano")
        refuse_settings("clips", request.settings, "recordings")
    if all(one.source for one in sources):
        refuse_settings("synthesis", request.settings, "made interactions")
    if not any((one.path / FILE).exists() for one in sources):
        refuse_settings("synthesis.scanned", request.settings, "`geneoh synthesize --objects`")
    data = training_data(sources, folder / "recordings", chosen, readers, on_progress=on_progress)
    refuse_other_making(data.record, chosen.synthesis, request.settings)
    motion = load_motion(folder).to(place) if stage in FOLLOWS else None
    task = StageTask(stage, chosen, data.training, data.validation, motion, data.record)
    return task, weights, data.notes


def _generator_task(request: Request, place: Any, on_progress: Any) -> Any:
    """The training task of a network of a generator, its initial weights, and notes."""
    from geneoh.readers.base import ReaderOptions
    from geneoh.training.data import Learned, parsed_source
    from geneoh.training.start import weights_for

    stage = request.stage
    if stage in BODY_STAGES:
        from geneoh.generators.both2hands.library import SHIPPED
        from geneoh.generators.both2hands.stages import body_task as task_of

        _refuse_unused(stage, "mano", *(["text_encoder"] if stage == "body_hands" else []))
        data = parsed_source(request.only_source(BODIES), BODY_SOURCES)
        made, of_recordings = "bodies", "skeleton"
    else:
        from geneoh.generators.text2hoi.learning.stages import generator_task as task_of
        from geneoh.generators.text2hoi.networks.library import SHIPPED

        # the vocabulary of subwords is learned again, and weights do not fit another vocabulary
        alone = ["start", "sources", "text_encoder", "mano"] if stage == "text" else []
        _refuse_unused(stage, "skeleton", *alone)
        data = parsed_source(request.only_source(ACTIONS))
        made, of_recordings = "actions", "mano"
    if not data.source:
        _refuse_unused(f"{stage} and made {made}", of_recordings)
    folder = SHIPPED if request.start == Path("shipped") else request.start
    start = folder and folder / f"{stage}.safetensors"
    readers = ReaderOptions(mano_dir=request.mano)
    how = request.folder, request.text_encoder, start, readers, request.skeleton
    task, notes = task_of(request.stage, *request.configuration(), Learned(data, *how), on_progress)
    return task, weights_for(task, start), notes


def _refuse_unused(stage: Any, *names: str) -> None:
    """Refuse options on the command line that a stage does not use."""
    for name, option in options.on_command_line().items():
        if name in names:
            raise ConfigError(
                f"{option}: expected none with --stage {stage}, which takes nothing from it; "
                "leave it out"
            )
