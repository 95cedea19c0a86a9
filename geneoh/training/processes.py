"""Several processes that train one network together, as torchrun starts them.

Each works on its part of every batch, and the gradients are summed. The network is not wrapped in
`DistributedDataParallel`, because losses also call single modules of networks.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import torch
from torch import Tensor, distributed

from geneoh.errors import ConfigError, EndedElsewhereError, GeneOHError
from geneoh.interrupts import INTERRUPTED, on_interrupt

VARIABLES = ("RANK", "WORLD_SIZE", "LOCAL_RANK", "MASTER_ADDR", "MASTER_PORT")
"""Environment variables that torchrun sets in each process."""
PATIENCE = timedelta(days=7)
"""Timeout of collective calls: one process makes the data of all. An end is noticed without it."""
LOST = (
    "another process of the run ended without an error message, as when memory runs out; start the "
    "run again, and it goes on where its state was saved last"
)


@dataclass(frozen=True)
class Team:
    """The processes of a run, as seen by the one with this rank."""

    rank: int = 0
    size: int = 1

    def add_up(self, tensors: Sequence[Tensor]) -> None:
        """Replace each tensor by its sum over the processes, the same in all of them."""
        if self.size == 1:
            return
        flat = torch.cat([tensor.flatten() for tensor in tensors])
        with _losses_of_others():
            distributed.all_reduce(flat)
        parts = flat.split([tensor.numel() for tensor in tensors])
        for tensor, part in zip(tensors, parts, strict=True):
            tensor.copy_(part.view_as(tensor))

    @contextmanager
    def first_alone(self) -> Iterator[None]:
        """Run a block in process 0, then in all others, which can read the files it has written."""
        if self.rank:
            self._meet()
        yield
        if not self.rank:
            self._meet()

    def _meet(self) -> None:
        if self.size > 1:
            with _losses_of_others():
                distributed.barrier()


@contextmanager
def joined(device: torch.device) -> Iterator[tuple[Team, torch.device]]:
    """Join the processes that torchrun started while the block runs; yields team and device.

    Each process uses the GPU with its local rank. If several processes fail, only the first raises
    its own error, and the others raise `EndedElsewhereError`.

    Raises:
        ConfigError: WORLD_SIZE is above 1, but other variables of torchrun are missing.
    """
    if int(os.environ.get("WORLD_SIZE", "1")) == 1:
        yield Team(), device
        return
    if missing := [name for name in VARIABLES if name not in os.environ]:
        raise ConfigError(
            f"WORLD_SIZE is {os.environ['WORLD_SIZE']}: expected {', '.join(missing)} in the "
            "environment as well; start several processes with torchrun"
        )
    from torch.distributed.rendezvous import rendezvous

    if device.type == "cuda":
        device = torch.device("cuda", int(os.environ["LOCAL_RANK"]))
        torch.cuda.set_device(device)
    with _losses_of_others():
        store, rank, size = next(rendezvous("env://", timeout=PATIENCE))
        backend = "nccl" if device.type == "cuda" else "gloo"
        distributed.init_process_group(
            backend, store=store, rank=rank, world_size=size, timeout=PATIENCE
        )
    try:
        yield Team(rank, size), device
    except (Exception, KeyboardInterrupt) as error:
        if not _is_first(store):
            code = INTERRUPTED if isinstance(error, KeyboardInterrupt) else 2
            raise EndedElsewhereError(code) from error
        if isinstance(error, EndedElsewhereError):
            raise GeneOHError(LOST) from error
        raise
    finally:
        distributed.destroy_process_group()


def _is_first(store: Any) -> bool:
    """Whether this is the first process of the run that ends with an error."""
    try:
        return store.add("ended", 1) == 1
    except RuntimeError:  # the store ended with the process that served it
        return False


@contextmanager
def _losses_of_others() -> Iterator[None]:
    """Turn torch's error about another process that has ended into `EndedElsewhereError`."""
    try:
        yield
    except RuntimeError as error:
        raise EndedElsewhereError(2) from error


@contextmanager
def noted_interrupts(team: Team) -> Iterator[Callable[[], bool]]:
    """Record Ctrl-C while the block runs instead of stopping; yields whether it was pressed.

    A second Ctrl-C stops a single process. With several, it is ignored, because torchrun forwards
    the first one, so that each process may get it twice.
    """
    pressed = False

    def note(*_: Any) -> None:
        nonlocal pressed
        if pressed and team.size == 1:
            raise KeyboardInterrupt
        pressed = True

    with on_interrupt(note):
        yield lambda: pressed
