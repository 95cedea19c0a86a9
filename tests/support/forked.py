"""The command in a forked child, with limits: how it ended, what it took, what it said.

The parent has imported everything and has one thread, so that a child costs milliseconds.
"""

import os
import resource
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

SECONDS = 30.0
"""Longest time of the processor."""
PATIENCE = 4 * SECONDS
"""Longest time of the clock on the wall, which runs on while others have the processor."""
MEMORY = 1_500_000_000
"""Largest resident memory of a child in bytes."""
SPACE = 4_000_000_000
"""Bytes of address space that a child may take beyond the parent's: it protects the machine."""


@dataclass(frozen=True)
class Ended:
    """How a child ended."""

    code: int
    """Exit code; -N after signal N."""
    said: str
    """What it printed, errors included."""
    seconds: float
    """Of the processor."""
    peak: int
    """Largest resident memory in bytes."""

    @property
    def problem(self) -> str | None:
        """What no run of the command may do; None where all is well."""
        if self.code < 0:
            return f"ended by {signal.Signals(-self.code).name} after {self.seconds:.0f} s"
        if self.code not in (0, 2):
            return f"exit code {self.code}"
        if "Traceback" in self.said:
            return "traceback"
        if self.peak > MEMORY:
            return f"{self.peak / 1e9:.1f} GB of memory"
        if self.seconds > SECONDS:
            return f"{self.seconds:.0f} s of the processor"
        return None


def forked(
    action: Callable[[], object],
    said: Path,
    *,
    seconds: float = PATIENCE,
    before: Callable[[], object] | None = None,
) -> Ended:
    """Run an action in a child that is killed after so many seconds.

    Args:
        action: ends with SystemExit, or with a return, which counts as exit code 0.
        said: file that takes what the child prints.
        seconds: of the clock on the wall.
        before: called in the child first, to set traps.
    """
    return ended(start(action, said, before), said, seconds)


def start(
    action: Callable[[], object], said: Path, before: Callable[[], object] | None = None
) -> tuple[int, float]:
    """The process id of a new child, and when it started."""
    assert len(os.listdir("/proc/self/task")) == 1, "a parent with threads cannot fork safely"
    sys.stdout.flush()
    sys.stderr.flush()
    began = time.monotonic()
    pid = os.fork()
    if pid:
        return pid, began
    code = 70
    try:
        turn_output_to(said)
        limit()
        if before is not None:
            before()
        code = exit_code(action)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def exit_code(action: Callable[[], object]) -> int:
    """Run an action as Python runs a program."""
    try:
        action()
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else int(error.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def turn_output_to(path: Path) -> None:
    """Let standard output and standard error go to a file, and read nothing."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o644)
    null = os.open(os.devnull, os.O_RDONLY)
    for source, place in ((null, 0), (file, 1), (file, 2)):
        os.dup2(source, place)
    out = open(1, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    err = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    sys.stdout = sys.__stdout__ = out
    sys.stderr = sys.__stderr__ = err


def limit() -> None:
    """Let no more address space or time be taken, and leave no memory dump."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + SPACE,) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (int(SECONDS) + 1,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def ended(child: tuple[int, float], said: Path, seconds: float = PATIENCE) -> Ended:
    """Wait for a child, kill it when its time is up, and tell how it ended."""
    pid, began = child
    handle = os.pidfd_open(pid)
    try:
        left = max(0.0, began + seconds - time.monotonic())
        if not select.select([handle], [], [], left)[0]:
            signal.pidfd_send_signal(handle, signal.SIGKILL)
        _, status, used = os.wait4(pid, 0)
    finally:
        os.close(handle)
    code = os.waitstatus_to_exitcode(status)
    text = said.read_text(errors="replace") if said.exists() else ""
    return Ended(code, text, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024)
