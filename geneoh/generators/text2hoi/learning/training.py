"""The networks of Text2HOI as tasks of the training loop, and the loss of each."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.choices import ActionStage
from geneoh.errors import ConfigError
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.learning.recorded import RecordedConfig
from geneoh.generators.text2hoi.learning.samples import (
    ActionData,
    ActionSamples,
    Text2HoiConfig,
    draw_samples,
    sentences,
)
from geneoh.generators.text2hoi.networks.autoencoders import (
    ContactNetwork,
    LengthConfig,
    LengthNetwork,
    contact_loss,
    length_loss,
)
from geneoh.generators.text2hoi.networks.interaction import (
    Condition,
    InteractionNetwork,
    set_statistics,
)
from geneoh.generators.text2hoi.networks.library import ASKED
from geneoh.generators.text2hoi.networks.losses import geometric_loss, simple_loss
from geneoh.generators.text2hoi.networks.objects import map_as_read
from geneoh.generators.text2hoi.networks.refiner import RefinerNetwork, points_of, refiner_loss
from geneoh.generators.text2hoi.networks.tokens import Tokens, actions_of, tokens_of
from geneoh.seeds import seeded_generator
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.data import TrainingData
from geneoh.training.resume import digest
from geneoh.training.run_config import RunConfig
from geneoh.training.tasks import DrawnSamples, SamplesTask, divided_batch, first_weights


@dataclass(frozen=True)
class ActionTask(SamplesTask):
    """One network of Text2HOI, learned from actions."""

    name: ActionStage
    config: Text2HoiConfig
    data: TrainingData[ActionData]
    encoder: TextEncoder
    contact: ContactNetwork | None = None  # estimates contact maps for later networks
    interaction: InteractionNetwork | None = None  # makes the clips that the refiner learns from

    def loss(self, model: Any, samples: ActionSamples, draws: Draws) -> Float[Tensor, ""]:
        """The loss of the network."""
        if self.name == "contact":
            noise = draws.normal(model.config.latent).to(samples.text)
            known = samples.objects, samples.touched, samples.text
            return contact_loss(model, *known, divergence=self.config.divergence, noise=noise)
        if self.interaction is not None:
            return refiner_task_loss(self.interaction, model, samples, self.config, draws)
        return interaction_loss(model, samples, self.config, draws)

    def network(self) -> nn.Module:
        """An untrained network, with statistics fitted to the data where it normalises."""
        with first_weights(self.config.seed, self.name, "weights"):
            if self.name == "contact":
                return ContactNetwork(self.config.contact)
            if self.name == "refiner":
                return RefinerNetwork(self.config.refiner)
            network = InteractionNetwork(self.config.interaction)
        if network.config.normalised:
            set_statistics(network, self.data.training.actions)
        if network.config.form == "paper" and self.contact is not None:
            take_points(network, self.contact)
        return network

    def drawn(self, training: bool, own: Part, pieces: int, *parts: object) -> DrawnSamples:
        """The pieces of a batch of `ActionSamples`, which is drawn as a whole and then divided."""
        data = self.data.training if training else self.data.validation
        generator = seeded_generator(self.config.seed, *parts)
        draws = Draws(own.count, generator, own)
        samples = draw_samples(data, self.config, self.encoder, draws, self.contact)
        return divided_batch(samples, generator, own, pieces)

    def learned_from(self) -> dict[str, Any]:
        """Fingerprints of the actions, the text encoder and the networks of earlier stages."""
        before = {"contact": self.contact, "interaction": self.interaction}
        weights = {
            name: each and digest(each.state_dict().values()) for name, each in before.items()
        }
        return actions_record(self.data, self.encoder) | weights | {"made": self.data.record}


@dataclass(frozen=True)
class LengthTrainConfig(RunConfig):
    """The training of the length network."""

    steps: int = 2000
    batch: int = 64
    divergence: float = 0.001  # weight of the KL divergence of the latent
    length: LengthConfig = field(default_factory=LengthConfig)
    recorded: RecordedConfig = field(default_factory=RecordedConfig)
    """How recordings of the user become actions."""


@dataclass(frozen=True)
class LengthSamples(Bundle):
    """A batch of sentences with the lengths of their actions."""

    length: Int[Tensor, " B"]
    text: Float[Tensor, "B W"]


@dataclass(frozen=True)
class LengthTask(SamplesTask):
    """The length network, learned from sentences and the lengths of their actions."""

    config: LengthTrainConfig
    data: TrainingData[ActionData]
    encoder: TextEncoder
    name: str = "length"

    def loss(self, model: LengthNetwork, samples: LengthSamples, draws: Draws) -> Float[Tensor, ""]:
        """The loss of the network."""
        noise = draws.normal(model.config.latent).to(samples.text)
        length, weight = samples.length, self.config.divergence
        return length_loss(model, length, samples.text, divergence=weight, noise=noise)

    def network(self) -> LengthNetwork:
        """An untrained network."""
        with first_weights(self.config.seed, self.name, "weights"):
            return LengthNetwork(self.config.length)

    def drawn(self, training: bool, own: Part, pieces: int, *parts: object) -> DrawnSamples:
        """Random actions with a random sentence each."""
        data = self.data.training if training else self.data.validation
        generator = seeded_generator(self.config.seed, self.name, *parts)
        draws = Draws(own.count, generator, own)
        chosen = data.actions.take(draws.integers(0, len(data.actions)))
        text = self.encoder.encode(sentences(chosen, data, draws))
        return divided_batch(LengthSamples(chosen.length, text), generator, own, pieces)

    def learned_from(self) -> dict[str, Any]:
        """Fingerprints of the actions and of the text encoder."""
        return {**actions_record(self.data, self.encoder), "made": self.data.record}


def take_points(network: InteractionNetwork, contact: ContactNetwork) -> None:
    """Copy the contact network's point features into a network and freeze them, as in the paper."""
    try:
        network.object.points.load_state_dict(contact.points.state_dict())
    except RuntimeError as error:
        raise ConfigError(
            "interaction: expected a contact network whose points are read as in the paper's form, "
            "got another one; train it in the same folder first, with `geneoh train --stage "
            "contact --config contact_paper`"
        ) from error
    network.object.points.requires_grad_(False)


@dataclass(frozen=True)
class Answer:
    """A prediction of the interaction network for noisy clips."""

    clean: Tokens  # the true clips
    guess: Tokens  # the predicted ones
    squared: Float[Tensor, ""]  # the simple loss
    sigma: Float[Tensor, " B"]  # standard deviation of the noise


def answer_to_noise(
    network: InteractionNetwork, samples: ActionSamples, config: Text2HoiConfig, draws: Draws
) -> Answer:
    """The prediction of the network for samples at random noise levels, in one pass."""
    tokens = tokens_of(samples.actions, network.config.frame)
    condition = Condition(
        samples.text,
        samples.objects,
        map_as_read(samples.contact, network.config.form),
        tokens.present,
        tokens.valid,
        ~draws.chance(config.text_dropout).to(tokens.present.device),
        ~draws.chance(config.object_dropout).to(tokens.present.device),
    )
    level = draws.integers(1, len(network.sigmas)).to(tokens.present.device)
    clean = network.normalise(tokens.flat) * tokens.defined
    sigma = network.sigmas[level]
    x = clean + sigma[:, None, None] * draws.like(clean)
    found = network.denoised(x, level.float(), network.encode(condition))
    guess = tokens.with_flat(network.denormalise(found))
    return Answer(tokens, guess, simple_loss(found, clean, tokens.defined), sigma)


def interaction_loss(
    network: InteractionNetwork, samples: ActionSamples, config: Text2HoiConfig, draws: Draws
) -> Float[Tensor, ""]:
    """The loss of the interaction network at random noise levels."""
    answer = answer_to_noise(network, samples, config, draws)
    sigma = answer.sigma
    share = 1 / (1 + sigma.square()) if config.losses.sharp else torch.ones_like(sigma)
    actions, touched = samples.actions, samples.touched
    return answer.squared + geometric_loss(
        answer.guess, answer.clean, actions, touched, config.losses, draws, share
    )


def refiner_task_loss(
    interaction: InteractionNetwork,
    network: RefinerNetwork,
    samples: ActionSamples,
    config: Text2HoiConfig,
    draws: Draws,
) -> Float[Tensor, ""]:
    """The loss of the refiner on clips that one pass of the interaction network denoised.

    Source: Text2HOI, section 3.3 and its code. Object poses are predictions of that network too.
    """
    interaction = interaction.to(samples.text.device)
    with torch.no_grad():
        guess = answer_to_noise(interaction, samples, config, draws).guess
        made = actions_of(guess, samples.actions)
    coarse, clean = (tokens_of(a, network.config.frame) for a in (made, samples.actions))
    contact = map_as_read(samples.contact, network.config.form)
    points, contact, normals = points_of(made, coarse, contact, network.config.points)
    found = network(coarse, points, contact)
    return refiner_loss(found, coarse, clean, points, normals, config.refining)


def actions_record(data: TrainingData[ActionData], encoder: TextEncoder) -> dict[str, Any]:
    """The record of training actions and text encoder that is stored with the weights: actions are
    told apart by their lengths and the last position of each wrist."""
    actions, held_out = (
        digest([part.lengths, part.actions.each(lambda actions: actions.wrist[:, :, -1])])
        for part in (data.training, data.validation)
    )
    return {
        "sequences": len(data.training.actions),
        "data": actions,
        "validation": held_out,
        "words": _words_digest(data.training, data.validation),
        **text_record(encoder),
    }


def _words_digest(*several: ActionData) -> str:
    """A fingerprint of the verbs and object names from which sentences are made."""

    def parts(data: ActionData) -> Iterator[Tensor | str]:
        yield data.actions.each(lambda actions: torch.stack([actions.verb, actions.name], dim=1))
        yield from (*data.names, *data.verb_words)

    return digest(part for data in several for part in parts(data))


def text_record(encoder: TextEncoder) -> dict[str, Any]:
    """The record of the text encoder that is stored with the weights: its vector of `ASKED`.

    A resumed run compares the fingerprint in half precision; the vector itself allows for rounding
    differences between machines.
    """
    vector = encoder.encode([ASKED])
    return {"text": digest([vector.half()]), "text_vector": vector[0].tolist()}
