"""What the networks of the generator learn from: made actions, or recordings of the user's."""

from functools import partial
from pathlib import Path

from geneoh.choices import ANNOTATED
from geneoh.config import as_dict
from geneoh.errors import ConfigError
from geneoh.generators.text2hoi.recorded import RecordedConfig
from geneoh.generators.text2hoi.recorded_data import recorded_actions
from geneoh.generators.text2hoi.samples import ActionData
from geneoh.progress import OnProgress
from geneoh.readers.base import ReaderOptions
from geneoh.synthesis.action_shards import DEFAULTS, read_actions
from geneoh.synthesis.shards import find_shards, shard_record, unfinished
from geneoh.training.data import DataSource, TrainingData


def action_data(
    data: DataSource,
    config: RecordedConfig,
    cache: Path,
    options: ReaderOptions,
    on_progress: OnProgress | None = None,
) -> TrainingData[ActionData]:
    """Made actions of a folder, or those of recordings, whose shards lie in the folder `cache`.

    Raises:
        InputError: there are no actions, or files cannot be read.
        ConfigError: the source is none with labels of actions, or settings of recordings are given
            for made actions.
    """
    if not data.source:
        if config != RecordedConfig():
            raise ConfigError(
                "recorded: expected no settings of recordings with the made actions of "
                f"{data.path}, got some; leave them out"
            )
        training, validation = (
            ActionData(actions, tuple(names))
            for actions, names in (read_actions(data.path, split) for split in ("train", "val"))
        )
        record = shard_record(find_shards(data.path, "train", DEFAULTS)[0], DEFAULTS)
        notes = unfinished(data.path, record.config)
        return TrainingData(training, validation, as_dict(record), notes)
    if data.source not in ANNOTATED:
        raise ConfigError(
            f"--data {data.source}=...: expected {', '.join(ANNOTATED)}, whose recordings come "
            "with labels of actions, or a folder alone; choose one of them"
        )
    source = ANNOTATED[ANNOTATED.index(data.source)]
    return recorded_actions(
        source,
        data.path,
        data.shards_in(cache, "actions_"),
        config,
        options,
        on_step=on_progress and partial(on_progress, source),
    )
