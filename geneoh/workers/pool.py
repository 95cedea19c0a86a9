"""Work in items that do not depend on each other: done here, or in worker processes.

A worker that is killed, such as by a system without memory left, takes no other item with it: a new
one takes its place, its item is tried once more, and then the caller says what becomes of it.
"""

import os
import pickle
import signal
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from geneoh.errors import GeneOHError

Item = TypeVar("Item")
Result = TypeVar("Result")
Do = Callable[[Item], Result]
Lost = Callable[[Item, str], Result]
"""The result of an item that killed its workers, from the item and the reason in words."""

TRIES = 2  # workers that an item may lose
PATIENCE = 10.0  # seconds that a worker has to put away what it has half written


def results_of(
    work: Iterable[Item], do: Do[Item, Result], *, jobs: int, lost: Lost[Item, Result]
) -> Iterator[Result]:
    """The results as they are made, by `jobs` processes with one thread each, or by this one if 1.

    What `do` raises ends the work and is raised here; all workers have ended when it is.

    An item is taken when a worker is free; `do` is a function that a new process can import, and
    `lost`, called in this one, gives the result of an item that killed its workers.
    """
    return in_turn(work, do) if jobs == 1 else in_processes(work, do, jobs, lost)


def in_turn(work: Iterable[Item], do: Do[Item, Result]) -> Iterator[Result]:
    """One item after the other here; with one thread as in workers, for the same numbers."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield from map(do, work)
    finally:
        torch.set_num_threads(before)


@dataclass
class Worker:
    """A process that works on one item at a time."""

    process: BaseProcess
    pipe: Connection
    item: Any = None
    tries: int = 0  # how often the item was begun

    def begin(self, item: Any, tries: int) -> None:
        """Give it an item; where it is dead, the answer will say so."""
        self.item, self.tries = item, tries
        with suppress(OSError):
            # as bytes of its own: tensors would be sent as files that are opened for each
            self.pipe.send_bytes(pickle.dumps(item))


def in_processes(
    work: Iterable[Item], do: Do[Item, Result], jobs: int, lost: Lost[Item, Result]
) -> Iterator[Result]:
    """Results from new processes; see `results_of`."""
    fresh, again = ((item, 1) for item in work), deque[tuple[Item, int]]()
    busy: dict[Any, Worker] = {}
    crew: list[BaseProcess] = []

    def employ(worker: Worker | None = None) -> None:
        """Give a worker, or a new one, the next item; items that lost a worker come last."""
        task = next(fresh, None) or (again.popleft() if again else None)
        if task is not None:
            worker = worker or Worker(*started(crew, _serve, do))
            busy[worker.pipe] = worker
            worker.begin(*task)

    try:
        for _ in range(jobs):
            employ()
        while busy:
            for pipe in wait(list(busy)):
                worker = busy.pop(pipe)
                item, tries = worker.item, worker.tries
                try:
                    answer = worker.pipe.recv()
                except (EOFError, OSError):  # an answer may end in its middle
                    why = cause_of_death(worker.process)
                    if tries < TRIES:
                        again.append((item, tries + 1))
                        employ()
                        continue
                    answer, worker = (lost(item, why), None), None
                employ(worker)
                yield unpacked(answer)
    finally:
        end(crew)


def started(
    crew: list[BaseProcess], target: Callable[..., None], *args: Any
) -> tuple[BaseProcess, Connection]:
    """A new process, which is added to the crew, and the pipe to it.

    It calls `target` with its end of the pipe and the arguments.
    """
    context = get_context("spawn")
    pipe, far = context.Pipe()
    process = context.Process(target=target, args=(far, *args), daemon=True)
    with interrupts_held():
        process.start()
    far.close()  # so that the pipe ends when the process does
    crew.append(process)
    return process, pipe


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Ctrl-C is for this process, which then ends its workers; those started here do not see it."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def cause_of_death(process: BaseProcess) -> str:
    """Why a worker is gone; `GeneOHError` where it ended by itself, as when it cannot start."""
    process.join(PATIENCE)
    code = process.exitcode
    if code is not None and code >= 0:
        raise GeneOHError(
            f"a worker process ended with exit code {code}, for the reason that it printed; "
            "run with --jobs 1 to work without worker processes"
        )
    name = "no signal" if code is None else signal.Signals(-code).name
    return (
        f"{TRIES} worker processes that began it were ended by {name}, as happens where memory "
        "runs out; cut it into shorter ones, or run it with --jobs 1"
    )


def end(crew: Iterable[BaseProcess]) -> None:
    """End all workers, and wait until they have put away what they had half written."""
    for process in crew:
        process.terminate()
    for process in crew:
        process.join(PATIENCE)
        process.kill()
        process.join()


def _serve(pipe: Connection, do: Do[Any, Any]) -> None:
    """What a worker does: items come and answers go through the pipe, until it closes."""
    obey_parent()
    use_one_thread()
    try:
        while True:
            pipe.send_bytes(answered(do, pipe.recv()))
    except (EOFError, OSError):  # the parent has no more work, or is gone
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    except SystemExit:  # end by the signal that asked for it
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTERM)


def obey_parent() -> None:
    """Tidy up and end when the parent asks for it, or was killed."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # tidies up, as `sys.exit` does
    threading.Thread(target=end_with_parent, daemon=True).start()


def end_with_parent() -> None:
    """End this worker when its parent was killed."""
    if (parent := parent_process()) is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


def use_one_thread() -> None:
    """One thread for each worker, since there are as many as cores; those that wait sleep."""
    # read by torch's import, and by libigl at its first query of a distance
    os.environ |= {"OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "PASSIVE", "IGL_NUM_THREADS": "1"}
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


def answered(do: Do[Item, Any], item: Item) -> bytes:
    """What a worker sends: the result, or the error with its traceback as text."""
    try:
        return pickle.dumps((do(item), None))
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # such as that of an error that takes two arguments
            error = RuntimeError(f"{type(error).__name__}: {error}")
        return pickle.dumps((error, traceback.format_exc()))


def unpacked(answer: tuple[Any, str | None]) -> Any:
    """The result in an answer; raises the error in it."""
    value, text = answer
    if text is not None:
        raise value from RuntimeError(f"in a worker process:\n{text}")
    return value


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
