"""Random choices of words, and typing errors, for training sentences."""

from collections.abc import Sequence
from typing import TypeVar

import torch

Choice = TypeVar("Choice")


def one_of(options: Sequence[Choice], generator: torch.Generator) -> Choice:
    """One of the options, all equally likely."""
    return options[int(torch.randint(len(options), (), generator=generator))]


def chance(share: float, generator: torch.Generator) -> bool:
    """True with the probability `share`."""
    return float(torch.rand((), generator=generator)) < share


def misspelt(words: Sequence[str], *, generator: torch.Generator) -> list[str]:
    """The words with one typing error in one word of four letters or more, if there is one."""
    long = [n for n, word in enumerate(words) if len(word) >= 4]
    if not long:
        return list(words)
    chosen = one_of(long, generator)
    word = words[chosen]
    at = 1 + int(torch.randint(len(word) - 2, (), generator=generator))
    letter = one_of("abcdefghijklmnopqrstuvwxyz", generator)
    error = one_of(
        (
            word[:at] + word[at + 1] + word[at] + word[at + 2 :],  # two letters change places
            word[:at] + word[at + 1 :],
            word[:at] + word[at] + word[at:],
            word[:at] + letter + word[at + 1 :],
        ),
        generator,
    )
    return [*words[:chosen], error, *words[chosen + 1 :]]
