"""Independent work items, processed in this process or in worker processes.

If a worker is killed, for example because memory ran out, only its own item is affected. A new
worker replaces it and tries the item once more. If that fails too, the caller decides the result.
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
from multiprocessing import current_process, get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from geneoh.errors import GeneOHError

Item = TypeVar("Item")
Result = TypeVar("Result")
Do = Callable[[Item], Result]
Lost = Callable[[Item, str], Result]
"""Makes the result of an item whose workers died, from the item and the reason in words."""

TRIES = 2  # attempts at an item whose workers die
CLEANUP_SECONDS = 10.0  # seconds that a worker has to clean up its unfinished files


def results_of(
    work: Iterable[Item], do: Do[Item, Result], *, jobs: int, lost: Lost[Item, Result]
) -> Iterator[Result]:
    """Yield results as they finish, from `jobs` one-thread processes, or from this one if 1.

    An exception from `do` is raised here after all workers have ended.

    Items are taken from `work` only when a worker is free. `do` must be importable by a new
    process. `lost` is called in this process for an item whose workers died.
    """
    if jobs == 1 or current_process().daemon:  # which may have no processes of its own
        return in_turn(work, do)
    return in_processes(work, do, jobs, lost)


def in_turn(work: Iterable[Item], do: Do[Item, Result]) -> Iterator[Result]:
    """Process items in this process, with one thread so that results equal those of workers."""
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
    tries: int = 0  # attempts at the item, with this one

    def begin(self, item: Any, tries: int) -> None:
        """Send an item; a worker that has died is noticed when its answer is read."""
        self.item, self.tries = item, tries
        with suppress(OSError):
            # pickled here, because `Connection.send` passes each tensor as an open file
            self.pipe.send_bytes(pickle.dumps(item))


def in_processes(
    work: Iterable[Item], do: Do[Item, Result], jobs: int, lost: Lost[Item, Result]
) -> Iterator[Result]:
    """Results from new processes; see `results_of`."""
    fresh, again = ((item, 1) for item in work), deque[tuple[Item, int]]()
    busy: dict[Any, Worker] = {}
    crew: list[BaseProcess] = []

    def employ(worker: Worker | None = None) -> None:
        """Give the next item to a worker, or to a new one; items to try again come last."""
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
                except (EOFError, OSError):  # the worker died, perhaps while it sent the answer
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
    """Start a process that runs `target(pipe end, *args)` and add it to `crew`.

    Returns the process and this end of the pipe.
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
    """Processes started in the block ignore Ctrl-C; this process receives it and ends them."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # whose start would let interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def cause_of_death(process: BaseProcess) -> str:
    """Why a worker was killed; `GeneOHError` if it exited by itself, as when it cannot start."""
    process.join(CLEANUP_SECONDS)
    code = process.exitcode
    if code is not None and code >= 0:
        raise GeneOHError(
            f"a worker process ended with exit code {code}, for the reason that it printed; "
            "one job works without worker processes, and a script that asks for more needs "
            "`if __name__ == '__main__':` around its calls"
        )
    name = "no signal" if code is None else signal.Signals(-code).name
    return (
        f"{TRIES} worker processes that worked on this clip were ended by {name}, as happens where "
        "memory runs out; cut the clip into shorter ones, or run it with --jobs 1"
    )


def end(crew: Iterable[BaseProcess]) -> None:
    """End all workers, and wait until they have cleaned up their unfinished files."""
    for process in crew:
        process.terminate()
    for process in crew:
        process.join(CLEANUP_SECONDS)
        process.kill()
        process.join()


def _serve(pipe: Connection, do: Do[Any, Any]) -> None:
    """Main loop of a worker: receive items and send answers until the pipe closes."""
    obey_parent()
    use_one_thread()
    try:
        while True:
            pipe.send_bytes(answered(do, pipe.recv()))
    except (EOFError, OSError):  # the parent has no more work, or is gone
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    except SystemExit:  # raised by the handler: die by the same signal, as the exit code must show
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTERM)


def obey_parent() -> None:
    """Clean up and end on SIGTERM from the parent, or when the parent was killed."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # so that `finally` blocks run
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Windows cannot hold it; the parent receives it
    threading.Thread(target=end_with_parent, daemon=True).start()


def end_with_parent() -> None:
    """End this worker when its parent was killed."""
    if (parent := parent_process()) is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


def use_one_thread() -> None:
    """Limit this worker to one thread, since there is a worker per core; idle threads sleep."""
    # read by torch's import, and by libigl at its first query of a distance
    os.environ |= {"OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "PASSIVE", "IGL_NUM_THREADS": "1"}
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


def answered(do: Do[Item, Any], item: Item) -> bytes:
    """The pickled answer to an item: the result, or the error with its traceback as text."""
    try:
        return pickle.dumps((do(item), None))
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # such as an error class whose constructor takes two arguments
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
