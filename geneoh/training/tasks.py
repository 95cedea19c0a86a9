"""The base classes of training tasks, and functions that several tasks share.

A task has a network, and draws the batch of a step by seed, in pieces for gradient accumulation.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.config import as_dict
from geneoh.seeds import seed_of
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.data import TrainingData
from geneoh.training.processes import Team
from geneoh.training.resume import TrainState
from geneoh.training.run_config import RunConfig

AnyBatch = TypeVar("AnyBatch", bound=Bundle)
DrawnSamples = Iterable[tuple[Any, Draws]]
"""The pieces of a batch: samples, each with the random number source of their loss."""


@runtime_checkable
class MicroBatch(Protocol):
    """Samples of a batch with one forward and backward pass."""

    def loss(self, model: Any) -> Tensor:
        """The contribution of the samples to the loss of the batch."""
        ...


class Task:
    """A training task: a network, the source of its batches, and its validation.

    Subclasses are frozen dataclasses with these fields.
    """

    name: Any  # beginning of the names of the run's files
    config: Any  # a RunConfig: settings of the run

    def network(self) -> nn.Module:
        """A new network on the CPU, initialised from the config's seed."""
        raise NotImplementedError

    def pieces(self, step: int, team: Team, device: torch.device) -> Sequence[MicroBatch]:
        """This process's part of a step's batch, in pieces whose gradients are accumulated."""
        raise NotImplementedError

    def before_step(self, state: TrainState) -> None:
        """Change the state before a step, for runs with several phases."""

    def validate(self, model: Any, index: int) -> Float[Tensor, ""]:
        """The error of a network on a fixed validation batch."""
        raise NotImplementedError

    def learned_from(self) -> dict[str, Any]:
        """Fingerprints of the data and of networks that this one builds on, and how the data was
        made, for the record; see `resume.COMPARED`."""
        raise NotImplementedError

    def record(self) -> dict[str, Any]:
        """Name, config, and what the network learns from, for a checkpoint."""
        return {"stage": self.name, "config": as_dict(self.config), **self.learned_from()}


@contextmanager
def first_weights(*parts: object) -> Iterator[None]:
    """Seed the initial weights of networks that are made in the block by `seed_of` these values.

    The state of torch's global generator is restored after the block.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed_of(*parts))
        yield


def own_part(config: RunConfig, team: Team) -> Part:
    """The items of every batch that this process works on."""
    return Part(0, config.batch, config.batch).divided(team.size)[team.rank]


def divided_batch(
    batch: AnyBatch, generator: torch.Generator, own: Part, pieces: int
) -> Iterator[tuple[AnyBatch, Draws]]:
    """Divide a process's items into pieces, each with a copy of the generator, so that the random
    numbers of the loss do not depend on the division."""
    for part in own.divided(pieces):
        rows = slice(part.first - own.first, part.first - own.first + part.count)
        again = torch.Generator().set_state(generator.get_state())
        yield batch.take(rows, "B"), Draws(part.count, again, part)


@dataclass(frozen=True)
class SamplesPiece:
    """Samples of a batch, the source of random numbers for their loss, and the loss function."""

    samples: Any
    draws: Draws
    of: Callable[[Any, Any, Draws], Tensor]

    def loss(self, model: nn.Module) -> Tensor:
        """The contribution of the samples to the mean loss of the batch."""
        share = self.draws.batch / self.draws.total
        return share * self.of(model, self.samples, self.draws)


class SamplesTask(Task):
    """Training of a generator's network on random samples.

    Subclasses define the samples and the loss.
    """

    data: TrainingData[Any]

    def loss(self, model: Any, samples: Any, draws: Draws) -> Tensor:
        """The loss of the network on samples."""
        raise NotImplementedError

    def drawn(self, training: bool, own: Part, pieces: int, *parts: object) -> DrawnSamples:
        """The items `own` of a batch, in pieces, seeded by config and `parts` (purpose, number)."""
        raise NotImplementedError

    def pieces(self, step: int, team: Team, device: torch.device) -> Sequence[SamplesPiece]:
        """This process's part of a step's batch, in pieces whose gradients are accumulated."""
        own = own_part(self.config, team)
        drawn = self.drawn(True, own, self.config.accumulate, "step", step)
        return [SamplesPiece(samples.to(device), draws, self.loss) for samples, draws in drawn]

    @torch.no_grad()
    def validate(self, model: Any, index: int) -> Float[Tensor, ""]:
        """The loss on a fixed batch of validation samples."""
        whole = Part(0, self.config.batch, self.config.batch)
        ((samples, draws),) = self.drawn(False, whole, 1, "validation", index)
        return self.loss(model, samples.to(next(model.parameters()).device), draws)
