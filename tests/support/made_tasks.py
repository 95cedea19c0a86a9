"""Runs of a few steps of every stage of the generators, for tests."""

from made_actions import WordEncoder
from made_gestures import tiny_task as tiny_hands_task
from made_networks import tiny_data
from made_networks import tiny_task as tiny_action_task

from geneoh.choices import ACTION_STAGES, BODY_STAGES
from geneoh.generators.text2hoi.learning.text_training import TextTask, TextTrainConfig
from geneoh.generators.text2hoi.learning.training import LengthTask, LengthTrainConfig
from geneoh.generators.text2hoi.networks.autoencoders import LengthConfig
from geneoh.training.data import TrainingData

ALL_STAGES = ("text", "length", *ACTION_STAGES, *BODY_STAGES)


def made_task(stage):
    """A run of any stage, which is validated at its end at the latest."""
    few = {"steps": 2, "batch": 4, "warmup": 1, "validation_batches": 1, "validate_every": 2}
    few |= {"checkpoint_every": 1}
    if stage == "text":
        return TextTask(TextTrainConfig(**few))
    if stage == "length":
        size = LengthConfig(latent=2, hidden=8, text=WordEncoder.width)
        data = TrainingData(tiny_data(), tiny_data(), {"source": "test"})
        return LengthTask(LengthTrainConfig(**few, length=size), data, WordEncoder())
    return (tiny_action_task if stage in ACTION_STAGES else tiny_hands_task)(stage)
