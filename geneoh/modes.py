"""Modes of torch that callers set for work of their own; ours is done without them."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import torch


@contextmanager
def undisturbed() -> Iterator[None]:
    """Work in float32 on the CPU, with gradients where they are asked for, whatever modes the
    caller set; what is to be on another device says so.

    It also decorates a function: `@undisturbed()`.
    """
    theirs = torch.get_default_dtype()
    with ExitStack() as modes:
        modes.enter_context(torch.inference_mode(False))
        modes.enter_context(torch.no_grad())
        for device in ("cpu", "cuda"):
            if torch.is_autocast_enabled(device):
                modes.enter_context(torch.autocast(device, enabled=False))
        if not torch.empty(0).is_cpu:  # a mode of devices slows every call
            modes.enter_context(torch.device("cpu"))
        if theirs != torch.float32:  # it is one for all threads: set only where it must be
            torch.set_default_dtype(torch.float32)
            modes.callback(torch.set_default_dtype, theirs)
        yield
