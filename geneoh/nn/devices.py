"""The device that --device names, checked before any work starts."""

import torch

from geneoh.errors import ConfigError

UNKNOWN = "Expected one of"
"""How torch's message on a kind of device that it does not know begins: a list of all kinds."""


def named_device(name: str) -> torch.device:
    """The torch device of that name; `ConfigError` where this machine has no such device."""
    try:
        device = torch.device(name)
        torch.zeros(1, device=device).item()  # fails on "meta", whose tensors hold no values
    except (RuntimeError, AssertionError, ImportError) as error:
        reason = str(error).splitlines()[0]
        found = "an unknown kind" if reason.startswith(UNKNOWN) else f"'{reason}'"
        raise ConfigError(
            f"--device {name}: expected a device of this machine, got {found}; "
            "`geneoh info` lists them"
        ) from None
    return device
