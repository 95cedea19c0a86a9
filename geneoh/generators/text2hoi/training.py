"""The networks of Text2HOI as tasks of the training loop."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import torch
from torch import Tensor, nn

from geneoh.choices import ActionStage
from geneoh.generators.tasks import DrawnSamples, Loss, SamplesTask
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.config import Text2HoiConfig
from geneoh.generators.text2hoi.contact import ContactNetwork
from geneoh.generators.text2hoi.interaction import InteractionNetwork
from geneoh.generators.text2hoi.refiner import RefinerNetwork
from geneoh.generators.text2hoi.samples import ActionData, draw_samples
from geneoh.generators.text2hoi.scales import set_statistics
from geneoh.generators.text2hoi.task_losses import (
    contact_task_loss,
    interaction_loss,
    refiner_task_loss,
)
from geneoh.generators.text2hoi.text import ASKED
from geneoh.seeds import seeded_generator
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.data import TrainingData
from geneoh.training.loop import divided_batch, first_weights
from geneoh.training.resume import digest


@dataclass(frozen=True)
class ActionTask(SamplesTask):
    """One network of Text2HOI, learned from actions; a `geneoh.training.loop.Task`."""

    name: ActionStage
    config: Text2HoiConfig
    data: TrainingData[ActionData]
    encoder: TextEncoder
    contact: ContactNetwork | None = None  # of which later networks are told estimated maps
    interaction: InteractionNetwork | None = None  # whose clips the refiner learns to refine

    @property
    def loss(self) -> Loss:
        """The loss of the network."""
        if self.name == "contact":
            return contact_task_loss
        if self.interaction is not None:
            return partial(refiner_task_loss, self.interaction)
        return interaction_loss

    def network(self) -> nn.Module:
        """A fresh network, made for the text encoder and with the scales of the data."""
        with first_weights(self.config.seed, self.name, "weights"):
            if self.name == "contact":
                return ContactNetwork(self.config.contact)
            if self.name == "refiner":
                return RefinerNetwork(self.config.refiner)
            network = InteractionNetwork(self.config.interaction)
        if network.config.normalised:
            set_statistics(network, self.data.training.actions)
        if network.config.form == "paper" and self.contact is not None:
            network.object.points.load_state_dict(self.contact.points.state_dict())
            network.object.points.requires_grad_(False)
        return network

    def drawn(self, training: bool, own: Part, pieces: int, *parts: object) -> DrawnSamples:
        """Samples that are drawn together and then divided."""
        data = self.data.training if training else self.data.validation
        generator = seeded_generator(self.config.seed, *parts)
        draws = Draws(own.count, generator, own)
        samples = draw_samples(data, self.config, self.encoder, draws, self.contact)
        return divided_batch(samples, generator, own, pieces)

    def learned_from(self) -> dict[str, Any]:
        """Fingerprints of the actions, the text encoder and the networks before."""
        before = {"contact": self.contact, "interaction": self.interaction}
        weights = {
            name: each and digest(each.state_dict().values()) for name, each in before.items()
        }
        return actions_record(self.data, self.encoder) | weights


def actions_record(data: TrainingData[ActionData], encoder: TextEncoder) -> dict[str, Any]:
    """What weights tell of the actions that they were learned from, and of the text encoder."""
    return {
        "sequences": len(data.training.actions),
        "data": data_digest(data.training),
        "validation": data_digest(data.validation),
        "words": words_digest(data.training, data.validation),
        **text_record(encoder),
    }


def data_digest(data: ActionData) -> str:
    """A fingerprint of actions by their lengths and the last place of each wrist."""
    return digest([data.lengths, data.actions.each(lambda actions: actions.wrist[:, :, -1])])


def words_digest(*several: ActionData) -> str:
    """A fingerprint of what sentences for actions are made of: their verbs and objects."""

    def parts(data: ActionData) -> Iterator[Tensor | str]:
        yield data.actions.each(lambda actions: torch.stack([actions.verb, actions.name], dim=1))
        yield from (*data.names, *data.verb_words)

    return digest(part for data in several for part in parts(data))


def text_record(encoder: TextEncoder) -> dict[str, Any]:
    """What weights tell of the text encoder that they were trained with, by the vector of `ASKED`.

    A fingerprint of it in half precision, by which runs are continued; and its numbers, because
    machines round a vector apart.
    """
    vector = encoder.encode([ASKED])
    return {"text": digest([vector.half()]), "text_vector": vector[0].tolist()}
