"""Work for worker processes, which import it by name; it needs no torch."""

import os
import signal
import threading
import time
from pathlib import Path

from geneoh.workers.pool import results_of


def doubled(item: int) -> int:
    """Twice a number."""
    return 2 * item


def holds_interrupts(item: int) -> bool:
    """Whether Ctrl-C cannot reach this process."""
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def doubled_unless_odd(item: int) -> int:
    """Twice an even number."""
    if item % 2:
        raise ValueError(f"{item} is odd")
    return 2 * item


class Refused(Exception):
    """An error that cannot be unpickled, because it takes two arguments."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first} {second}")


def refused(item: int) -> int:
    """Raise such an error."""
    raise Refused("no", str(item))


def doubled_or_killed(item: tuple[int, str]) -> int:
    """Twice a number; the process is killed as often as a file beside has no letters left."""
    number, file = item
    if file:
        left = Path(file).read_text()
        Path(file).write_text(left[1:])
        if left:
            os.kill(os.getpid(), signal.SIGKILL)
    return 2 * number


def killed_while_it_sends(item: tuple[int, str]) -> int | bytes:
    """Twice a number; where a folder is named, first an answer too long for the pipe.

    It is made when the folder holds "go", and the process is killed while it waits to send it.
    """
    number, folder = item
    if folder and not Path(folder, "begun").exists():
        Path(folder, "begun").touch()
        while not Path(folder, "go").exists():
            time.sleep(0.05)
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGKILL)).start()
        return bytes(2**23)
    return 2 * number


def ended_by_itself(item: int) -> int:
    """End the process, as one that cannot start."""
    os._exit(3)


def tidied(folder: str) -> None:
    """Leave a file that says so when the work is ended."""
    try:
        Path(folder, f"begun_{os.getpid()}").touch()
        time.sleep(60)
    finally:
        Path(folder, f"tidied_{os.getpid()}").touch()


def threads(item: int) -> tuple[int, str, str]:
    """Threads of torch in this process, and what OpenMP and libigl are told."""
    import torch

    return torch.get_num_threads(), os.environ["OMP_NUM_THREADS"], os.environ["IGL_NUM_THREADS"]


def slowly_doubled(item: int) -> int:
    """Twice a number, after half a second."""
    time.sleep(0.5)
    return 2 * item


def doubled_in_processes(numbers):
    return list(results_of(numbers, doubled, jobs=2, lost=lambda *given: None))
