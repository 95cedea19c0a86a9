"""The networks of the generator as tasks of the training loop."""

from collections.abc import Iterable
from pathlib import Path

from typing_extensions import assert_never

from geneoh.choices import GeneratorStage
from geneoh.config import configured
from geneoh.generators.text2hoi.text_training import TextTask, TextTrainConfig
from geneoh.training.loop import Task


def generator_task(
    stage: GeneratorStage, config: Path | None = None, settings: Iterable[str] = ()
) -> Task:
    """What `geneoh train --stage` learns, with the settings of a file and then of `a.b=c` texts.

    Raises:
        ConfigError: the file cannot be read, or a setting is unknown or of the wrong type.
    """
    if stage == "text":
        return TextTask(configured(TextTrainConfig(), config, settings))
    assert_never(stage)
