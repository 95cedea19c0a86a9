"""Stage "length" of the generator: how many frames an action takes, by its sentence."""

from dataclasses import dataclass, field
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.config import as_dict
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.length import LengthConfig, LengthNetwork, length_loss
from geneoh.generators.text2hoi.recorded import RecordedConfig
from geneoh.generators.text2hoi.samples import ActionData, sentences
from geneoh.generators.text2hoi.training import data_digest, text_record, words_digest
from geneoh.seeds import seeded_generator
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.data import TrainingData
from geneoh.training.loop import OnePhase, first_weights, own_part
from geneoh.training.processes import Team
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
class LengthPiece:
    """Actions on which the loss is taken at once."""

    length: Int[Tensor, " B"]
    text: Float[Tensor, "B W"]
    noise: Float[Tensor, "B Z"]
    divergence: float
    share: float = 1.0

    def loss(self, model: LengthNetwork) -> Tensor:
        """What the actions add to the loss of the batch."""
        weight, noise = self.divergence, self.noise
        return self.share * length_loss(
            model, self.length, self.text, divergence=weight, noise=noise
        )


@dataclass(frozen=True)
class LengthTask(OnePhase):
    """The length network, learned from sentences for actions; a `geneoh.training.loop.Task`."""

    config: LengthTrainConfig
    data: TrainingData[ActionData]
    encoder: TextEncoder
    name: str = "length"

    def network(self) -> LengthNetwork:
        """A fresh network."""
        with first_weights(self.config.seed, self.name, "weights"):
            return LengthNetwork(self.config.length)

    def drawn(
        self, data: ActionData, device: torch.device, *parts: object, part: Part
    ) -> LengthPiece:
        """Random actions with a random sentence each, by seed and `parts` (purpose, number)."""
        draws = Draws(part.count, seeded_generator(self.config.seed, self.name, *parts), part)
        chosen = data.actions.take(draws.integers(0, len(data.actions)))
        text = self.encoder.encode(sentences(chosen, data, draws))
        noise = draws.normal(self.config.length.latent)
        return LengthPiece(
            chosen.length.to(device),
            text.to(device),
            noise.to(device),
            self.config.divergence,
            part.count / part.total,
        )

    def pieces(self, step: int, team: Team, device: torch.device) -> list[LengthPiece]:
        """This process's part of the batch of a step."""
        return [
            self.drawn(self.data.training, device, "step", step, part=part)
            for part in own_part(self.config, team).divided(self.config.accumulate)
        ]

    @torch.no_grad()
    def validate(self, model: LengthNetwork, index: int) -> Float[Tensor, ""]:
        """The loss on a fixed batch of validation actions."""
        whole = Part(0, self.config.batch, self.config.batch)
        device = next(model.parameters()).device
        drawn = self.drawn(self.data.validation, device, "validation", index, part=whole)
        return drawn.loss(model)

    def record(self) -> dict[str, Any]:
        """Stage, config, fingerprints of what it learns from, and how that was made."""
        return {
            "stage": self.name,
            "config": as_dict(self.config),
            "sequences": len(self.data.training.actions),
            "data": data_digest(self.data.training),
            "validation": data_digest(self.data.validation),
            "words": words_digest(self.data.training, self.data.validation),
            **text_record(self.encoder),
            "made": self.data.record,
        }
