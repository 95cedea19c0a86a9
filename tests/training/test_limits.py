"""Every number of every training configuration has limits."""

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace

import pytest

from geneoh.config import Limited
from geneoh.errors import ConfigError
from geneoh.generators.both2hands.training import Both2HandsConfig
from geneoh.generators.text2hoi.learning.samples import Text2HoiConfig
from geneoh.generators.text2hoi.learning.text_training import TextTrainConfig
from geneoh.generators.text2hoi.learning.training import LengthTrainConfig
from geneoh.training.augmentation import AugmentationConfig
from geneoh.training.config import TrainConfig
from geneoh.training.corruption import CorruptionConfig
from geneoh.training.recordings import ClipConfig
from geneoh.training.windows import WindowConfig

CONFIGS = (
    *(TrainConfig(), Text2HoiConfig(), LengthTrainConfig(), TextTrainConfig(), Both2HandsConfig()),
)


def limited(config: Limited) -> Iterator[Limited]:
    """A configuration, and those in it that are not of made data."""
    yield config
    for field in fields(config):
        inner = getattr(config, field.name)
        if is_dataclass(inner) and field.name != "synthesis":
            assert isinstance(inner, Limited), f"{field.name} has no limits"
            yield from limited(inner)


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: type(config).__name__)
def test_numbers_that_no_setting_has_are_refused(config):
    for each in limited(config):
        values = {field.name: getattr(each, field.name) for field in fields(each)}
        for name, value in values.items():
            wrong = {int: (-1, 10**12), float: (-1.0, math.nan)}.get(type(value), ())
            for number in wrong if name != "seed" else ():
                with pytest.raises(ConfigError, match=f"'{name}' must be "):
                    replace(each, **{name: number})


@pytest.mark.parametrize(
    ("config", "name"),
    [
        (Text2HoiConfig().contact, "latent"),
        (TrainConfig().motion, "depth"),
        *((TrainConfig(), name) for name in ("batch", "steps", "warmup", "accumulate")),
        *((TrainConfig(), f"{what}_every") for what in ("validate", "checkpoint")),
        (TrainConfig(), "validation_batches"),
        (CorruptionConfig(), "gaps"),
    ],
)
def test_networks_batches_and_runs_are_not_empty(config, name):
    with pytest.raises(ConfigError, match=f"'{name}' must be .*, got 0; correct the value"):
        replace(config, **{name: 0})


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (TrainConfig, {"ema": 1.5}),
        (TrainConfig, {"clip": 0.0}),
        (WindowConfig, {"frames": 1}),
        (WindowConfig, {"short_share": 2.0}),
        (ClipConfig, {"shortest": 1}),
        (CorruptionConfig, {"gap_frames": (10, 2)}),
        (CorruptionConfig, {"translation": (0.0, 0.01)}),
        (CorruptionConfig, {"clean_share": 7.0}),
    ],
)
def test_numbers_beyond_the_limits_of_their_setting_are_refused(kind, wrong):
    ((name, _),) = wrong.items()
    with pytest.raises(ConfigError, match=f"{kind.__name__}: '{name}' must "):
        kind(**wrong)


def test_a_text_encoder_has_a_class_for_all_that_sentences_name():
    text = TextTrainConfig().text
    with pytest.raises(ConfigError, match=f"'verbs' must be {text.verbs} to 4096, got 3"):
        TextTrainConfig(text=replace(text, verbs=3))


@pytest.mark.parametrize("periods", [(), (0.0,), (2.0, math.inf)])
def test_motion_of_no_period_is_refused(periods):
    with pytest.raises(ConfigError, match="'periods' must be above 0 and at most 1000000"):
        AugmentationConfig(periods=periods)
