"""`python -m tests.fuzz`: changed files through the command, and a table of what became of them."""

import argparse
import gc
import os
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # before numpy is imported
os.environ["TOKENIZERS_PARALLELISM"] = "false"  # a vocabulary that is learned starts no threads
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import torch
from forked import forked

from tests.fuzz.corpus import keep, kept
from tests.fuzz.table import Tally
from tests.fuzz.target import Target
from tests.fuzz.targets import write_targets
from tests.fuzz.trial import Case, draw_case, run_case, run_command

SHARE = 0.1
"""Share of the inputs that are cleaned to the end."""
WARMED = ("npz own", "MANO", "arctic")
"""Targets that are cleaned to the end for the modules that this imports."""


def main() -> int:
    """Run the corpus, then new inputs until one of the limits; 1 where a problem was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="new inputs (default: 1000)")
    parser.add_argument("--hours", type=float, default=1000.0, help="longest time")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", help="only this kind of file, as the table calls it")
    parser.add_argument("--keep", type=Path, help="folder for what does harm, such as the corpus")
    given = parser.parse_args()
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory(prefix="fuzz_") as folder:
        return fuzz(Path(folder), given)


def fuzz(folder: Path, given: argparse.Namespace) -> int:
    """All inputs, in a folder of their own."""
    targets, out = write_targets(folder / "in"), folder / "out"
    old = warm(targets, folder)
    tally, end = Tally(), time.monotonic() + 3600 * given.hours
    for name, case in kept(targets):
        outcome = run_case(case, out, old)
        tally.add_known(name, outcome)
    for case in cases(targets, given, tally):
        if time.monotonic() > end:
            break
        outcome = run_case(case, out, old)
        tally.add(outcome)
        if tally.inputs % 500 == 0:
            print(f"{tally.inputs} inputs, {tally.denoised} cleaned", file=sys.stderr)
        if outcome.problem and given.keep:
            print(f"kept as {keep(outcome, given.keep)}", flush=True)
    print("\n".join(tally.lines(given.seed)), flush=True)
    return int(tally.problems > 0)


def cases(targets: list[Target], given: argparse.Namespace, tally: Tally) -> Iterator[Case]:
    """New inputs, kind by kind in turn, with the share that is to be cleaned."""
    kinds = sorted({target.kind for target in targets if given.kind in (None, target.kind)})
    for number in range(given.count):
        draw, kind = random.Random(f"{given.seed} {number}"), kinds[number % len(kinds)]
        of_kind = [target for target in targets if target.kind == kind]
        yield draw_case(of_kind, draw, whole=tally.denoised < SHARE * (number + 1))


def warm(targets: list[Target], folder: Path) -> bytes:
    """Import all that sound files of every target make the command import; the last result.

    The commands run in children, which report what they imported: this process must not start
    threads. Other commands, such as `view`, run once for each thing that they write.
    """
    once, result, seen = {target.root: target for target in targets}, b"", set[tuple[str, str]]()
    for target in once.values():
        others = {(words[0], written(words)): words for words in target.others}
        new = [words for key, words in others.items() if key not in seen]
        seen.update(others)
        for command in (target.command, *new):
            out = folder / "out"
            shutil.rmtree(out, ignore_errors=True)
            out.mkdir()
            whole = command == target.command and target.name in WARMED
            case = Case(target, "", b"", command, whole)
            report = folder / "modules.txt"
            ended = forked(reporting(run_command(case, out), report), folder / "said.txt")
            if ended.code != 0 or ended.problem:
                raise SystemExit(f"{target.name}: the sound files: {ended.problem} {ended.said}")
            import_all(report)
            gc.freeze()  # so that the children copy fewer pages
            result = (out / "clean.npz").read_bytes() if (out / "clean.npz").exists() else result
    return result


def written(words: tuple[str, ...]) -> str:
    """The file that a command writes."""
    return words[words.index("-o") + 1]


def reporting(run: Callable[[], None], report: Path) -> Callable[[], None]:
    """Run, and write down the names of all modules that are imported by then."""

    def both() -> None:
        try:
            run()
        finally:
            report.write_text("\n".join(sys.modules))

    return both


def import_all(report: Path) -> None:
    """Import the modules of a report."""
    import importlib
    from contextlib import suppress

    for name in report.read_text().splitlines():
        if name not in sys.modules:
            with suppress(Exception):  # such as names that a package only pretends to have
                importlib.import_module(name)


if __name__ == "__main__":
    sys.exit(main())
