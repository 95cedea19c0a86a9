"""How work in progress is told: the two kinds of callback that functions take."""

from collections.abc import Callable

OnStep = Callable[[int, int], None]
"""Progress of one piece of work: called as `on_step(done, total)` after each step, with the number
of steps done so far and in all."""

OnProgress = Callable[[str, int, int], None]
"""Progress of work in named stages: called as `on_progress(stage, done, total)` after each step of
a stage; stages follow one another, and the last call of one has `done` equal to `total`."""
