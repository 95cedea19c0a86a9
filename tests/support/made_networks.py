"""The smallest networks of Text2HOI, and runs of their training."""

from dataclasses import replace

import torch
from made_actions import NAMES, WordEncoder, made_actions

from geneoh.generators.text2hoi.learning.samples import ActionData, Text2HoiConfig
from geneoh.generators.text2hoi.learning.training import ActionTask
from geneoh.generators.text2hoi.networks.autoencoders import ContactConfig
from geneoh.generators.text2hoi.networks.interaction import InteractionConfig, InteractionNetwork
from geneoh.generators.text2hoi.networks.losses import LossWeights
from geneoh.generators.text2hoi.networks.objects import PointConfig
from geneoh.generators.text2hoi.networks.refiner import RefinerConfig, RefinerWeights
from geneoh.streamed import Streamed
from geneoh.training.data import TrainingData

POINTS = PointConfig(near=6, middle=8, whole=12)
TINY = Text2HoiConfig(
    steps=4,
    batch=6,
    warmup=1,
    checkpoint_every=2,
    validate_every=2,
    validation_batches=1,
    contact=ContactConfig(latent=3, hidden=12, text=WordEncoder.width, points=POINTS),
    interaction=InteractionConfig(
        width=16,
        depth=2,
        heads=2,
        frames_per_token=4,
        text=WordEncoder.width,
        object_points=24,
        object_tokens=5,
        points=POINTS,
    ),
    losses=LossWeights(frames=8, points=12),
    refiner=RefinerConfig(width=16, depth=2, heads=2, frames_per_token=4, points=24),
    refining=RefinerWeights(frames=2),
)
"""A run of four steps that saves and validates after the second and the last."""


def in_paper_form(config: InteractionConfig) -> InteractionConfig:
    """The same size in the form of the paper."""
    return replace(
        config, form="paper", frames_per_token=1, frame="world", normalised=False, object_tokens=0
    )


def answering(config: InteractionConfig, seed: int = 0) -> InteractionNetwork:
    """A network with random answers: in our form an untrained one has none of its own."""
    torch.manual_seed(seed)
    network = InteractionNetwork(config).eval()
    for layer in network.outputs:
        torch.nn.init.normal_(layer.weight, std=0.1)
        torch.nn.init.normal_(layer.bias, std=0.1)
    for codec in network.codecs:
        torch.nn.init.orthogonal_(codec.axes)
        codec.covariance[0] = 1.0
    return network


def tiny_data(**changes) -> ActionData:
    """A few made actions."""
    return ActionData(Streamed.of([made_actions(**changes)]), NAMES)


def tiny_task(stage, config: Text2HoiConfig = TINY, **given) -> ActionTask:
    """A stage that learns from a few made actions."""
    data = TrainingData(tiny_data(), tiny_data(), {"source": "test"})
    if stage == "refiner":
        given = {"interaction": answering(config.interaction)} | given
    return ActionTask(stage, config, data, WordEncoder(), **given)
