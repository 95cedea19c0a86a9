"""Training tasks of the networks of Text2HOI, by the stage names of `geneoh train`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from geneoh.choices import GeneratorStage
from geneoh.generators.text2hoi.learning.action_data import action_data
from geneoh.generators.text2hoi.learning.samples import Text2HoiConfig
from geneoh.generators.text2hoi.learning.text_training import TextTask, TextTrainConfig
from geneoh.generators.text2hoi.learning.training import ActionTask, LengthTask, LengthTrainConfig
from geneoh.generators.text2hoi.networks.library import conditioned_network, load_text_encoder
from geneoh.progress import OnProgress
from geneoh.training.data import Learned
from geneoh.training.run_config import stage_config
from geneoh.training.tasks import Task


def generator_task(
    stage: GeneratorStage,
    config: Path | None,
    settings: Sequence[str],
    learned: Learned,
    on_progress: OnProgress | None = None,
) -> tuple[Task, tuple[str, ...]]:
    """The task of `geneoh train --stage` and notes on its data; `settings` override the file.

    `settings` are texts such as `a.b=c`. All networks but the text encoder learn from actions, with
    the networks of earlier stages in the folder, or the shipped ones.

    Raises:
        InputError: there are no actions.
        CheckpointError: weights in the folder do not fit their network.
        ConfigError: the file cannot be read, a setting is unknown or of the wrong type, or networks
            of earlier stages were trained with another text encoder.
    """
    if stage == "text":
        return TextTask(stage_config(TextTrainConfig(), stage, config, settings)), ()
    if stage == "length":
        lengths = stage_config(LengthTrainConfig(), stage, config, settings)
        encoder = load_text_encoder(learned.text_encoder, learned.folder)
        lengths = replace(lengths, length=replace(lengths.length, text=encoder.width))
        data = action_data(learned, lengths.recorded, on_progress)
        return LengthTask(lengths, data, encoder), data.notes
    chosen = stage_config(Text2HoiConfig(), stage, config, settings)
    encoder = load_text_encoder(learned.text_encoder, learned.folder)
    chosen = replace(
        chosen,
        contact=replace(chosen.contact, text=encoder.width),
        interaction=replace(chosen.interaction, text=encoder.width),
    )
    contact = interaction = None
    if stage != "contact":
        contact = conditioned_network("contact", learned.folder, encoder)
    if stage == "refiner":
        interaction = conditioned_network("interaction", learned.folder, encoder)
    data = action_data(learned, chosen.recorded, on_progress)
    return ActionTask(stage, chosen, data, encoder, contact, interaction), data.notes
