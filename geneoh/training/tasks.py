"""What the training loop learns: the base class of its tasks, and what several of them share.

A task has a network, and draws the batch of a step by seed, in pieces on which the loss is taken.
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
"""Samples of pieces of a batch, each with the random numbers of its loss."""


@runtime_checkable
class MicroBatch(Protocol):
    """Samples of a batch on which the loss is taken at once."""

    def loss(self, model: Any) -> Tensor:
        """What the samples add to the loss of the batch."""
        ...


class Task:
    """What a run learns: a network, where its batches come from, and how it is validated.

    Subclasses are frozen dataclasses with these fields.
    """

    name: Any  # of the run's files
    config: Any  # a RunConfig: settings of the run

    def network(self) -> nn.Module:
        """A fresh network on the CPU, initialised from the config's seed."""
        raise NotImplementedError

    def pieces(self, step: int, team: Team, device: torch.device) -> Sequence[MicroBatch]:
        """This process's part of the batch of a step, in the pieces that are worked off in turn."""
        raise NotImplementedError

    def before_step(self, state: TrainState) -> None:
        """Change the state before a step, where a run has several phases."""

    def validate(self, model: Any, index: int) -> Float[Tensor, ""]:
        """The error of a network on a fixed validation batch."""
        raise NotImplementedError

    def record(self) -> dict[str, Any]:
        """What a checkpoint tells of stage, config and data; see `resume.COMPARED`."""
        raise NotImplementedError


@contextmanager
def first_weights(*parts: object) -> Iterator[None]:
    """Networks that are made in the block get random weights by `seed_of` these values.

    Outside of the block torch's global random numbers go on as without it.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed_of(*parts))
        yield


def own_part(config: RunConfig, team: Team) -> Part:
    """Which items of every batch this process works on."""
    return Part(0, config.batch, config.batch).divided(team.size)[team.rank]


def divided_batch(
    batch: AnyBatch, generator: torch.Generator, own: Part, pieces: int
) -> Iterator[tuple[AnyBatch, Draws]]:
    """The items of a process in pieces, each with a copy of the generator after the draw."""
    for part in own.divided(pieces):
        rows = slice(part.first - own.first, part.first - own.first + part.count)
        again = torch.Generator().set_state(generator.get_state())
        yield batch.take(rows, "B"), Draws(part.count, again, part)


@dataclass(frozen=True)
class SamplesPiece:
    """Samples of a batch, the random numbers of their loss, and that loss."""

    samples: Any
    draws: Draws
    of: Callable[[Any, Any, Draws], Tensor]

    def loss(self, model: nn.Module) -> Tensor:
        """What the samples add to the loss of the batch."""
        share = self.draws.batch / self.draws.total
        return share * self.of(model, self.samples, self.draws)


class SamplesTask(Task):
    """A network of a generator, which learns from samples that are drawn for every batch.

    Subclasses say what is drawn and what is lost.
    """

    data: TrainingData[Any]

    def loss(self, model: Any, samples: Any, draws: Draws) -> Tensor:
        """The loss of the network on samples."""
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
        drawn = self.drawn(True, own, self.config.accumulate, "step", step)
        return [SamplesPiece(samples.to(device), draws, self.loss) for samples, draws in drawn]

    @torch.no_grad()
    def validate(self, model: Any, index: int) -> Float[Tensor, ""]:
        """The loss on a fixed batch of validation samples."""
        whole = Part(0, self.config.batch, self.config.batch)
        ((samples, draws),) = self.drawn(False, whole, 1, "validation", index)
        return self.loss(model, samples.to(next(model.parameters()).device), draws)

    def record(self) -> dict[str, Any]:
        """Network, config, fingerprints of what it learns from, and how that was made."""
        named = {"stage": self.name, "config": as_dict(self.config)}
        return {**named, **self.learned_from(), "made": self.data.record}
