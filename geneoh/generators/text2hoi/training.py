"""The networks of Text2HOI as tasks of the training loop."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.choices import ActionStage
from geneoh.config import as_dict
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.config import Text2HoiConfig
from geneoh.generators.text2hoi.contact import ContactNetwork
from geneoh.generators.text2hoi.interaction import InteractionNetwork
from geneoh.generators.text2hoi.refiner import RefinerNetwork
from geneoh.generators.text2hoi.samples import ActionData, Samples, draw_samples
from geneoh.generators.text2hoi.scales import set_statistics
from geneoh.generators.text2hoi.task_losses import (
    Loss,
    contact_task_loss,
    interaction_loss,
    refiner_task_loss,
)
from geneoh.generators.text2hoi.text import ASKED
from geneoh.seeds import seeded_generator
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.loop import OnePhase, divided_batch, first_weights, own_part
from geneoh.training.processes import Team
from geneoh.training.resume import digest


@dataclass(frozen=True)
class SamplesPiece:
    """Samples of a batch on which the loss is taken at once."""

    samples: Samples
    config: Text2HoiConfig
    generator: torch.Generator
    part: Part
    of: Loss

    def loss(self, model: nn.Module) -> Tensor:
        """What the samples add to the loss of the batch."""
        draws = Draws(self.part.count, self.generator, self.part)
        share = self.part.count / self.part.total
        return share * self.of(model, self.samples, self.config, draws)


@dataclass(frozen=True)
class ActionTask(OnePhase):
    """One network of Text2HOI, learned from actions; a `geneoh.training.loop.Task`."""

    name: ActionStage
    config: Text2HoiConfig
    data: ActionData
    validation: ActionData
    encoder: TextEncoder
    contact: ContactNetwork | None = None  # of which later networks are told estimated maps
    interaction: InteractionNetwork | None = None  # whose clips the refiner learns to refine
    made: Mapping[str, Any] | None = None  # how the data was made, for the record

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
            set_statistics(network, self.data.actions)
        if network.config.form == "paper" and self.contact is not None:
            network.object.points.load_state_dict(self.contact.points.state_dict())
            network.object.points.requires_grad_(False)
        return network

    def drawn(
        self, data: ActionData, *parts: object, part: Part
    ) -> tuple[Samples, torch.Generator]:
        """A batch, or part of it, with its generator, by seed and `parts` (purpose, number)."""
        generator = seeded_generator(self.config.seed, *parts)
        draws = Draws(part.count, generator, part)
        return draw_samples(data, self.config, self.encoder, draws, self.contact), generator

    def pieces(self, step: int, team: Team, device: torch.device) -> list[SamplesPiece]:
        """This process's part of the batch of a step, in the pieces that are worked off in turn."""
        own = own_part(self.config, team)
        samples, generator = self.drawn(self.data, "step", step, part=own)
        divided = divided_batch(samples, generator, own, self.config.accumulate)
        return [
            SamplesPiece(some.to(device), self.config, again, part, self.loss)
            for some, again, part in divided
        ]

    @torch.no_grad()
    def validate(self, model: nn.Module, index: int) -> Float[Tensor, ""]:
        """The loss on a fixed batch of validation clips."""
        whole = Part(0, self.config.batch, self.config.batch)
        samples, generator = self.drawn(self.validation, "validation", index, part=whole)
        samples = samples.to(next(model.parameters()).device)
        piece = SamplesPiece(samples, self.config, generator, whole, self.loss)
        return piece.loss(model)

    def record(self) -> dict[str, Any]:
        """Network, config, fingerprints of what it learns from, and how that was made."""
        before = {"contact": self.contact, "interaction": self.interaction}
        return {
            "stage": self.name,
            "config": as_dict(self.config),
            "sequences": len(self.data.actions),
            "data": data_digest(self.data),
            "validation": data_digest(self.validation),
            "words": words_digest(self.data, self.validation),
            **text_record(self.encoder),
            **{name: each and digest(each.state_dict().values()) for name, each in before.items()},
            "made": None if self.made is None else dict(self.made),
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
