"""Progress reports: the two kinds of callback that functions take."""

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import count
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


def counted(on_step: OnStep | None, total: int) -> Callable[[], None]:
    """A function without arguments that reports the next of `total` steps to `on_step`."""
    done = count(1)
    return lambda: None if on_step is None else on_step(next(done), total)


def timed(on_progress: OnProgress | None, seconds: dict[str, float]) -> Callable[[str], OnStep]:
    """A function that makes the `OnStep` of a stage by its name; it also stores the seconds of the
    stage in `seconds`. A stage that starts again continues from its earlier seconds."""

    def of(stage: str) -> OnStep:
        began = time.monotonic() - seconds.get(stage, 0.0)

        def step(done: int, total: int) -> None:
            seconds[stage] = time.monotonic() - began
            if on_progress is not None:
                on_progress(stage, done, total)

        return step

    return of


def part_of(on_step: OnStep | None, index: int, pieces: int) -> OnStep | None:
    """The callback of one of `pieces` pieces of work of equal size, which reports the overall
    progress."""
    if on_step is None:
        return None
    return lambda done, total: on_step(index * total + done, pieces * total)
