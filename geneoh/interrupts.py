"""Handle Ctrl-C within a block by a function, or delay it to the end of the block."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

INTERRUPTED = 130
"""Exit code that shells report for a program ended by SIGINT: 128 + 2."""


@contextmanager
def on_interrupt(act: Callable[..., None]) -> Iterator[None]:
    """Ctrl-C within the block calls `act` with the arguments of a signal handler.

    Only the main thread receives signals: in other threads nothing changes. Nor does it where the
    program around Python has a handler of its own, which Python could not set again.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is None:
        yield
        return
    before = signal.signal(signal.SIGINT, act)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Delay a Ctrl-C within the block to its end.

    For imports of packages that catch every exception while they are imported: the interrupt would
    be lost there, or end the process in the middle of native code.
    """
    pressed: list[Any] = []
    before = signal.getsignal(signal.SIGINT)
    try:
        with on_interrupt(lambda *given: pressed.append(given)):
            yield
    finally:
        if pressed and callable(before):
            before(*pressed[0])  # also where the block raises an error, which would hide it
