"""Ctrl-C that waits for the end of a block, or is only noted there."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def on_interrupt(act: Callable[..., None]) -> Iterator[None]:
    """Ctrl-C within the block calls a function, with what handlers of signals are given. In other
    threads than the main one, which alone hears of it, nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, act)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """A Ctrl-C within the block counts at its end.

    For imports of packages that catch every exception while they are imported, so that one which
    arrives then would be lost, or would end the process in the middle of native code.
    """
    pressed: list[Any] = []
    before = signal.getsignal(signal.SIGINT)
    try:
        with on_interrupt(lambda *given: pressed.append(given)):
            yield
    finally:
        if pressed and callable(before):
            before(*pressed[0])  # also where the block raises, which would hide it
