"""How work in progress is told: the two kinds of callback that functions take."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Item = TypeVar("Item")

OnStep = Callable[[int, int], None]
"""Progress of one piece of work: called as `on_step(done, total)` after each step, with the number
of steps done so far and in all."""

OnProgress = Callable[[str, int, int], None]
"""Progress of work in named stages: called as `on_progress(stage, done, total)` after each step of
a stage; stages follow one another, and the last call of one has `done` equal to `total`."""


def steps(items: Sequence[Item], on_step: OnStep | None) -> Iterator[Item]:
    """The items one after the other; `on_step` is called when the work on each is done."""
    for done, item in enumerate(items, 1):
        yield item
        if on_step is not None:
            on_step(done, len(items))
