"""Protection of geneoh's computations from modes of torch and numpy that a caller has set."""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import torch

_lock = threading.Lock()
_running = 0
_theirs = torch.float32
"""The caller's default dtype, while computations run."""


@contextmanager
def undisturbed() -> Iterator[None]:
    """Run with defaults, whatever modes the caller set: float32, CPU, no autocast, and gradients
    only where they are enabled inside. Code for other devices names them explicitly.

    It also decorates a function: `@undisturbed()`. The default dtype is that of the whole process:
    other threads see float32 until the last computation ends.
    """
    with ExitStack() as modes:
        modes.enter_context(torch.inference_mode(False))
        modes.enter_context(torch.no_grad())
        for device in ("cpu", "cuda"):
            if torch.is_autocast_enabled(device):
                modes.enter_context(torch.autocast(device, enabled=False))
        if not torch.empty(0).is_cpu:  # only then, as a device mode slows every call
            modes.enter_context(torch.device("cpu"))
        modes.enter_context(np.errstate(divide="warn", over="warn", under="ignore", invalid="warn"))
        modes.enter_context(default_float32())
        yield


@contextmanager
def default_float32() -> Iterator[None]:
    """Set the default dtype of all threads; the last of several computations sets it back."""
    global _running, _theirs
    with _lock:
        if _running == 0:
            _theirs = torch.get_default_dtype()
            torch.set_default_dtype(torch.float32)
        _running += 1
    try:
        yield
    finally:
        with _lock:
            _running -= 1
            if _running == 0:
                torch.set_default_dtype(_theirs)
