"""Protection of geneoh's computations from torch modes that a caller has set."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import torch


@contextmanager
def undisturbed() -> Iterator[None]:
    """Run with defaults, whatever modes the caller set: float32, CPU, no autocast, and gradients
    only where they are enabled inside. Code for other devices names them explicitly.

    It also decorates a function: `@undisturbed()`.
    """
    theirs = torch.get_default_dtype()
    with ExitStack() as modes:
        modes.enter_context(torch.inference_mode(False))
        modes.enter_context(torch.no_grad())
        for device in ("cpu", "cuda"):
            if torch.is_autocast_enabled(device):
                modes.enter_context(torch.autocast(device, enabled=False))
        if not torch.empty(0).is_cpu:  # only then, as a device mode slows every call
            modes.enter_context(torch.device("cpu"))
        if theirs != torch.float32:  # it is global to all threads
            torch.set_default_dtype(torch.float32)
            modes.callback(torch.set_default_dtype, theirs)
        yield
