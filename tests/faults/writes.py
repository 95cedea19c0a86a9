"""Writes that fail: every way in which Python changes a file or folder, counted in one place.

Native libraries that write by themselves (safetensors) are not counted while they write; the new
name that they write to and its place in the folder are.
"""

import builtins
import errno
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

ERRORS: dict[str, Callable[[], BaseException]] = {
    "disk full": lambda: OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
    "no permission": lambda: PermissionError(errno.EACCES, os.strerror(errno.EACCES)),
    "interrupted": KeyboardInterrupt,
    "read-only": lambda: OSError(errno.EROFS, os.strerror(errno.EROFS)),
}
EVERY = 0
"""In place of a call's number: all of them fail."""
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CALLS = ("replace", "rename", "fsync", "mkdir", "truncate", "link", "symlink")


class Faults:
    """Counts the calls that change files, and fails in one of them or in all."""

    def __init__(self, at: int, error: Callable[[], BaseException], report: Path) -> None:
        self.at, self.error, self.report, self.count = at, error, report, 0
        self.open, self.low_open = io.open, os.open

    def hit(self) -> None:
        """Count a call, which fails where it is its turn."""
        self.count += 1
        with self.open(self.report, "w") as file:
            file.write(str(self.count))
        if self.at in (EVERY, self.count):
            raise self.error()

    def install(self) -> None:
        """Let all calls of this process go through here."""
        builtins.open = io.open = self.opened  # type: ignore[assignment]
        os.open = self.low_opened
        for name in CALLS:
            setattr(os, name, self.counted(getattr(os, name)))

    def counted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """A call of the system that is counted."""

        def counting(*args: Any, **options: Any) -> Any:
            self.hit()
            return call(*args, **options)

        return counting

    def low_opened(self, path: Any, flags: int, *args: Any, **options: Any) -> int:
        """`os.open`."""
        if flags & WRITING and not str(path).startswith("/dev/"):
            self.hit()
        return self.low_open(path, flags, *args, **options)

    def opened(self, file: Any, mode: str = "r", buffering: int = -1, *args: Any, **options: Any):
        """`open`; what is written through the file is counted as well."""
        if not set(mode) & set("wxa+") or str(file).startswith("/dev/"):
            return self.open(file, mode, buffering, *args, **options)
        self.hit()
        raw = CountedFile(file, mode.replace("b", "").replace("t", ""))
        raw.hit = self.hit
        buffer = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        return buffer if "b" in mode else io.TextIOWrapper(buffer, *args, **options)


class CountedFile(io.FileIO):
    """A file whose writes are counted."""

    hit: Callable[[], None]

    def write(self, data: Any) -> int:
        """Write some bytes."""
        self.hit()
        return super().write(data)
