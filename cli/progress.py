"""Progress bars for work that takes more than two seconds."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from geneoh.progress import OnProgress

PATIENCE = 2.0
"""Seconds of work before a bar is shown."""


@contextmanager
def progress_bars(shown: bool = True) -> Iterator[OnProgress]:
    """Progress bars on standard error, one stage at a time, while the block runs; or none.

    There is none where standard error is no terminal: a log would hold each step of the bar.
    """
    from tqdm import tqdm

    began = time.monotonic()
    bar = None

    def on_progress(stage: str, done: int, total: int) -> None:
        nonlocal bar
        if bar is None or bar.desc != stage:
            if bar is not None:
                bar.close()
            wait = max(0.0, PATIENCE - (time.monotonic() - began))
            bar = tqdm(total=total, desc=stage, delay=wait, leave=False, dynamic_ncols=True)
        bar.total = total
        bar.update(done - bar.n)

    try:
        seen = shown and sys.stderr is not None and sys.stderr.isatty()  # None where it is closed
        yield on_progress if seen else lambda *_: None
    finally:
        if bar is not None:
            bar.close()
