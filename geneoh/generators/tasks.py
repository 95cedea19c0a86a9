"""What the training of the networks of both generators shares: batches that are drawn by seed."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.config import as_dict
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.data import TrainingData
from geneoh.training.loop import OnePhase, own_part
from geneoh.training.processes import Team

Loss = Callable[[Any, Any, Any, Draws], Tensor]
"""The loss of a network on samples, with the settings of the run and random numbers."""
DrawnSamples = Iterable[tuple[Any, torch.Generator, Part]]
"""Samples, the generator of the random numbers of their loss, and which of the batch they are."""


@dataclass(frozen=True)
class SamplesPiece:
    """Samples of a batch on which the loss is taken at once."""

    samples: Bundle
    config: Any
    generator: torch.Generator
    part: Part
    of: Loss

    def loss(self, model: nn.Module) -> Tensor:
        """What the samples add to the loss of the batch."""
        draws = Draws(self.part.count, self.generator, self.part)
        share = self.part.count / self.part.total
        return share * self.of(model, self.samples, self.config, draws)


class SamplesTask(OnePhase):
    """A network that learns from samples which are drawn for every batch; a `training.loop.Task`.

    Subclasses are frozen dataclasses with these fields, and say what is drawn and what is lost.
    """

    name: Any
    config: Any
    data: TrainingData[Any]

    @property
    def loss(self) -> Loss:
        """The loss of the network."""
        raise NotImplementedError

    def drawn(self, training: bool, own: Part, pieces: int, *parts: object) -> DrawnSamples:
        """The items of a batch that are `own`, in pieces, by seed and `parts` (purpose, number)."""
        raise NotImplementedError

    def learned_from(self) -> dict[str, Any]:
        """Fingerprints of the data and of networks before, for the record of the weights."""
        raise NotImplementedError

    def pieces(self, step: int, team: Team, device: torch.device) -> Sequence[SamplesPiece]:
        """This process's part of the batch of a step, in the pieces that are worked off in turn."""
        own = own_part(self.config, team)
        return self._pieces(device, self.drawn(True, own, self.config.accumulate, "step", step))

    @torch.no_grad()
    def validate(self, model: Any, index: int) -> Float[Tensor, ""]:
        """The loss on a fixed batch of validation samples."""
        whole = Part(0, self.config.batch, self.config.batch)
        device = next(model.parameters()).device
        (piece,) = self._pieces(device, self.drawn(False, whole, 1, "validation", index))
        return piece.loss(model)

    def record(self) -> dict[str, Any]:
        """Network, config, fingerprints of what it learns from, and how that was made."""
        named = {"stage": self.name, "config": as_dict(self.config)}
        return {**named, **self.learned_from(), "made": self.data.record}

    def _pieces(self, device: torch.device, drawn: DrawnSamples) -> list[SamplesPiece]:
        return [
            SamplesPiece(samples.to(device), self.config, generator, part, self.loss)
            for samples, generator, part in drawn
        ]
