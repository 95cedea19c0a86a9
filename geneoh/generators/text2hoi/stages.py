"""The networks of Text2HOI by the names of their stages, as `geneoh train` learns them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from geneoh.choices import ActionStage, GeneratorStage
from geneoh.config import as_dict, configured
from geneoh.errors import ConfigError
from geneoh.generators.text2hoi.config import Text2HoiConfig
from geneoh.generators.text2hoi.library import contact_network, encoder_of
from geneoh.generators.text2hoi.samples import ActionData
from geneoh.generators.text2hoi.text_training import TextTask, TextTrainConfig
from geneoh.generators.text2hoi.training import ActionTask
from geneoh.synthesis.action_shards import DEFAULTS, read_actions
from geneoh.synthesis.shards import find_shards, shard_record
from geneoh.training.loop import Task


def generator_task(
    stage: GeneratorStage,
    config: Path | None,
    settings: Sequence[str],
    data: Path,
    folder: Path,
    text_encoder: Path | None = None,
) -> Task:
    """What `geneoh train --stage` learns, with the settings of a file and then of `a.b=c` texts.

    All but the text encoder learn from actions of the folder `data`, with the networks before them
    that are in `folder`, or the shipped ones.

    Raises:
        InputError: `data` holds no actions.
        CheckpointError: weights in `folder` do not fit their network.
        ConfigError: the file cannot be read, or a setting is unknown or of the wrong type.
    """
    if stage == "text":
        return TextTask(configured(TextTrainConfig(), config, settings))
    return action_task(stage, config, settings, data, folder, text_encoder)


def action_task(
    stage: ActionStage,
    config: Path | None,
    settings: Sequence[str],
    data: Path,
    folder: Path,
    text_encoder: Path | None,
) -> ActionTask:
    """What a stage learns from actions; arguments and errors are those of `generator_task`."""
    chosen = configured(Text2HoiConfig(), config, settings)
    encoder = encoder_of(folder, text_encoder)
    chosen = replace(
        chosen,
        contact=replace(chosen.contact, text=encoder.width),
        interaction=replace(chosen.interaction, text=encoder.width),
    )
    contact = None if stage == "contact" else contact_network(folder)
    if contact is not None and contact.config.text != encoder.width:
        raise ConfigError(
            f"{folder}: the contact network was trained with a text encoder of "
            f"{contact.config.text} features, got one of {encoder.width}; train it again"
        )
    training, validation = (
        ActionData(actions, tuple(names))
        for actions, names in (read_actions(data, split) for split in ("train", "val"))
    )
    made = as_dict(shard_record(find_shards(data, "train", DEFAULTS)[0], DEFAULTS))
    return ActionTask(stage, chosen, training, validation, encoder, contact, made)
