"""Ctrl-C that waits for the end of a block."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """A Ctrl-C within the block counts at its end.

    For imports of packages that catch every exception while they are imported, so that one which
    arrives then would be lost, or would end the process in the middle of native code.
    """
    pressed: list[Any] = []
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, lambda *given: pressed.append(given))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if pressed and callable(before):
            before(*pressed[0])  # also where the block raises, which would hide it
