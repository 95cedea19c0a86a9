"""Each fault on each command, and whether anything was lost by it."""

import os
import random
import shutil
import signal
import sys
import time
import webbrowser  # noqa: F401 before `become_nobody`, who may not read Python's files
from collections.abc import Callable
from concurrent.futures import process  # noqa: F401 as well
from dataclasses import dataclass
from pathlib import Path

import torch
from forked import Ended, ended, forked, start

from tests.faults.commands import Result, older, other_input, result_in, run_of, write_inputs
from tests.faults.writes import ERRORS, EVERY, Faults

NOBODY = 65534


@dataclass
class Bench:
    """One command in a folder of its own, with its undisturbed result."""

    folder: Path
    name: str
    cleaned: Callable[..., object] | None = None

    def __post_init__(self) -> None:
        """Make the inputs, the older result and the result."""
        self.out, self.said = self.folder / "out", self.folder / "said.txt"
        self.report = self.folder / "count.txt"
        self.folder.mkdir(mode=0o755)
        os.chdir(self.folder)
        write_inputs(self.folder, self.name)
        hand = (self.folder / "hand.npz").read_bytes()
        self.out.mkdir()
        other_input(self.folder)
        assert self.run().code == 0, self.run().said
        self.out.rename(self.folder / "old")
        (self.folder / "hand.npz").write_bytes(hand)
        self.old = result_in(self.folder / "old")
        self.fresh()
        began = time.monotonic()
        done = self.run(before=Faults(-1, KeyboardInterrupt, self.report).install)
        self.seconds = time.monotonic() - began
        assert done.code == 0, done.said
        self.calls, self.new = int(self.report.read_text()), result_in(self.out)

    def fresh(self) -> None:
        """Put the older result back, or nothing for commands that go on where they stopped."""
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.mkdir()
        older(self.folder, self.name)

    def run(self, before: Callable[[], object] | None = None) -> Ended:
        """Run the command in a child."""
        return forked(run_of(self.name, self.cleaned), self.said, before=before)

    def start(self) -> tuple[int, float]:
        """A child that runs the command."""
        return start(run_of(self.name, self.cleaned), self.said)

    def lost(self, ended: Ended | None = None) -> str | None:
        """What is wrong after a fault: of the old files, of the words, or of the next run."""
        if ended is not None:
            if ended.code not in (0, 2, 130) or "Traceback" in ended.said:
                return f"exit code {ended.code}: {ended.said.strip()[-300:]}"
            if left := litter(self.out):
                return f"left {left}"
        if half := self.half():
            return f"half-written: {half}"
        for path in self.out.rglob(".*.tmp"):
            os.utime(path, (0, 0))  # as if a minute had passed
        again = self.run()
        if again.code != 0:
            return f"the next run: exit code {again.code}: {again.said.strip()[-300:]}"
        return self.differs(result_in(self.out))

    def half(self) -> list[str]:
        """Files of a replacing command that are neither the old nor the new ones."""
        there = result_in(self.out).files.items() if self.old.files and older_kept(self) else ()
        known = (self.old.files, self.new.files)
        return [n for n, d in there if not hidden(n) and d not in [k.get(n) for k in known]]

    def differs(self, found: Result) -> str | None:
        """How a result differs from the undisturbed one."""
        if left := sorted(set(found.files) - set(self.new.files)):
            return f"left {left}"
        wrong = [n for n, d in self.new.lasting.items() if found.lasting.get(n) != d]
        return f"other results in {wrong}" if wrong else None


def older_kept(bench: Bench) -> bool:
    """Whether the command replaces results."""
    from tests.faults.commands import REPLACING

    return bench.name in REPLACING


def hidden(name: str) -> bool:
    """Whether a file is one that is being written."""
    return Path(name).name.startswith(".")


def litter(folder: Path) -> list[str]:
    """Files that are left of a write."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob(".*.tmp"))


def failing_writes(bench: Bench, kinds: tuple[str, ...], every: int = 1) -> list[str | None]:
    """Each n-th call that changes files fails, once for each kind of error."""
    problems = []
    for kind in kinds:
        for at in range(1, bench.calls + 1, every):
            bench.fresh()
            faults = Faults(at, ERRORS[kind], bench.report)
            said = bench.lost(bench.run(before=faults.install))
            problems.append(said and f"{bench.name}, {kind} at {at}: {said}")
    return problems


def read_only(bench: Bench) -> list[str | None]:
    """A folder on a read-only disk, and for root's tests one that the user may not write to."""
    problems = []
    ways = [Faults(EVERY, ERRORS["read-only"], bench.report).install]
    libraries = [Path(prefix, "lib") for prefix in (sys.prefix, sys.base_prefix)]
    if os.getuid() != 0 or all(may_enter(at) for library in libraries for at in library.parents):
        ways.append(become_nobody)  # who needs Python's own files
    for before in ways:
        bench.fresh()
        bench.out.chmod(0o555)
        done = bench.run(before=before)
        bench.out.chmod(0o755)
        told = done.code == 2 and "cannot be written" in done.said
        kept = result_in(bench.out).files == (bench.old.files if older_kept(bench) else {})
        said = None if told and kept else f"exit code {done.code}: {done.said.strip()[-300:]}"
        problems.append(said and f"{bench.name}, read-only: {said}")
    return problems


def may_enter(folder: Path) -> bool:
    """Whether everybody may read what is in a folder."""
    return folder.stat().st_mode & 0o005 == 0o005


def become_nobody() -> None:
    """Give up the rights of root, which may write anywhere."""
    if os.getuid() == 0:
        os.setgid(NOBODY)
        os.setuid(NOBODY)


def kills(bench: Bench, count: int, draw: random.Random) -> list[str | None]:
    """The process is killed at random moments."""
    problems = []
    for _ in range(count):
        bench.fresh()
        after = draw.uniform(0, bench.seconds)
        child = bench.start()
        time.sleep(after)
        os.kill(child[0], signal.SIGKILL)
        ended(child, bench.said)
        said = bench.lost()
        problems.append(said and f"{bench.name}, killed after {after:.2f} s: {said}")
    return problems


def two_at_once(bench: Bench) -> list[str | None]:
    """Two runs on one output at the same time."""
    bench.fresh()
    children = [bench.start(), start(run_of(bench.name, bench.cleaned), bench.report)]
    codes = [ended(children[0], bench.said), ended(children[1], bench.report)]
    bad = [one.said.strip()[-300:] for one in codes if one.code not in (0, 2)]
    said = bad[0] if bad else bench.lost()
    return [said and f"{bench.name}, two at once: {said}"]


def cleaned_before(folder: Path) -> Callable[..., object]:
    """The cleaning of a hand, made once: what is written does not depend on how it was made."""
    import geneoh

    folder.mkdir()
    write_inputs(folder, "denoise")
    sequence = geneoh.load(folder / "hand.npz", obj=folder / "object.obj")
    with torch.random.fork_rng():
        result = geneoh.denoise(sequence, geneoh.Options(preset="fast", samples=1, steps=1))
    return lambda *_, **__: result
