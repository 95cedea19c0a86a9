"""Stage "length" of the generator: how many frames an action takes, by its sentence."""

from dataclasses import dataclass, field
from typing import Any

from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.generators.tasks import DrawnSamples, Loss, SamplesTask
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.length import LengthConfig, LengthNetwork, length_loss
from geneoh.generators.text2hoi.recorded import RecordedConfig
from geneoh.generators.text2hoi.samples import ActionData, sentences
from geneoh.generators.text2hoi.training import actions_record
from geneoh.seeds import seeded_generator
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.data import TrainingData
from geneoh.training.loop import divided_batch, first_weights
from geneoh.training.run_config import RunConfig


@dataclass(frozen=True)
class LengthTrainConfig(RunConfig):
    """The training of the length network."""

    steps: int = 2000
    batch: int = 64
    divergence: float = 0.001  # weight of the divergence of the latent
    length: LengthConfig = field(default_factory=LengthConfig)
    recorded: RecordedConfig = field(default_factory=RecordedConfig)
    """How recordings of the user become actions."""


@dataclass(frozen=True)
class LengthSamples(Bundle):
    """A batch of sentences with the lengths of their actions."""

    length: Int[Tensor, " B"]
    text: Float[Tensor, "B W"]


def length_task_loss(
    network: LengthNetwork, samples: LengthSamples, config: LengthTrainConfig, draws: Draws
) -> Float[Tensor, ""]:
    """The loss of the length network."""
    noise = draws.normal(network.config.latent).to(samples.text)
    length, weight = samples.length, config.divergence
    return length_loss(network, length, samples.text, divergence=weight, noise=noise)


@dataclass(frozen=True)
class LengthTask(SamplesTask):
    """The length network, learned from sentences for actions."""

    config: LengthTrainConfig
    data: TrainingData[ActionData]
    encoder: TextEncoder
    name: str = "length"

    @property
    def loss(self) -> Loss:
        """The loss of the network."""
        return length_task_loss

    def network(self) -> LengthNetwork:
        """A fresh network."""
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
        return actions_record(self.data, self.encoder)
