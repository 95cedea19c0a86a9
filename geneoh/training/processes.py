"""Several processes that train one network together, as torchrun starts them.

Each works on its part of every batch, and their gradients are added up. There is no wrapper around
the network (`DistributedDataParallel`), because losses also call parts of networks.
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
from geneoh.interrupts import on_interrupt

VARIABLES = ("RANK", "WORLD_SIZE", "LOCAL_RANK", "MASTER_ADDR", "MASTER_PORT")
"""What torchrun tells each process in its environment."""
PATIENCE = timedelta(days=7)
"""How long processes wait for each other: one makes the data of all. The end of one is noticed."""
LOST = (
    "another process of the run ended without an error message, as when memory runs out; start the "
    "run again, and it goes on where its state was saved last"
)
INTERRUPTED = 130  # exit code after Ctrl-C, as of the process that says so


@dataclass(frozen=True)
class Team:
    """The processes of a run, seen from one of them."""

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
        """Run a block in process 0 and then in all others, which find what it has written."""
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
    """The processes that were started together, and this one's device, while the block runs.

    Of several GPUs each process takes the one of its number on the machine. Of errors that several
    processes meet one is raised, and in the others `EndedElsewhereError`.

    Raises:
        ConfigError: the environment tells of several processes, but not how they find each other.
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
    """Whether no other process has ended before the run did."""
    try:
        return store.add("ended", 1) == 1
    except RuntimeError:  # the store has gone with the process that held it
        return False


@contextmanager
def _losses_of_others() -> Iterator[None]:
    """Raise `EndedElsewhereError` for what torch raises when another process has ended."""
    try:
        yield
    except RuntimeError as error:
        raise EndedElsewhereError(2) from error


@contextmanager
def noted_interrupts(team: Team) -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C was pressed while the block runs, which it does not stop.

    Pressed twice it stops one process. Each of several may get it twice, as torchrun sends it too.
    """
    pressed = False

    def note(*_: Any) -> None:
        nonlocal pressed
        if pressed and team.size == 1:
            raise KeyboardInterrupt
        pressed = True

    with on_interrupt(note):
        yield lambda: pressed
