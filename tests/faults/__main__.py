"""`python -m tests.faults`: writes that fail, kills, read-only folders, two runs; as a table."""

import argparse
import os
import random
import sys
import tempfile
from pathlib import Path

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # before numpy is imported
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import torch

from tests.faults.commands import COMMANDS
from tests.faults.trials import (
    Bench,
    cleaned_before,
    failing_writes,
    kills,
    read_only,
    two_at_once,
)

KINDS = ("disk full", "no permission", "interrupted")
CLEANING = ("denoise", "batch")
"""Commands for which a hand is cleaned once."""
COLUMNS = ("failing writes", "kills", "read-only folders", "two at once", "problems")


def main() -> int:
    """Run all faults on all commands; 1 where something was lost."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--command", action="append", choices=COMMANDS, help="default: all")
    parser.add_argument("--kills", type=int, default=30, help="of each command (default: 30)")
    parser.add_argument("--every", type=int, default=1, help="only each n-th write (default: 1)")
    parser.add_argument("--kind", action="append", choices=KINDS, help="default: all")
    parser.add_argument("--seed", type=int, default=0, help="of the moments of the kills")
    given = parser.parse_args()
    torch.set_num_threads(1)
    problems = 0
    print(f"| command | {' | '.join(COLUMNS)} |\n|---|{'--:|' * len(COLUMNS)}", flush=True)
    with tempfile.TemporaryDirectory(prefix="faults_") as folder:
        Path(folder).chmod(0o755)
        for name in given.command or COMMANDS:
            problems += faults_of(name, Path(folder), given)
    return int(problems > 0)


def faults_of(name: str, folder: Path, given: argparse.Namespace) -> int:
    """All faults on one command, a row of the table; the number of problems."""
    cleaned = cleaned_before(folder / f"cleaned_{name}") if name in CLEANING else None
    bench, draw = Bench(folder / name, name, cleaned), random.Random(given.seed)
    made = (
        failing_writes(bench, tuple(given.kind or KINDS), given.every),
        kills(bench, given.kills, draw),
        read_only(bench),
        two_at_once(bench),
    )
    problems = [said for some in made for said in some if said]
    counts = " | ".join(str(len(some)) for some in made)
    print(f"| {name} | {counts} | {len(problems)} |", flush=True)
    for said in problems:
        print(said, file=sys.stderr, flush=True)
    return len(problems)


if __name__ == "__main__":
    sys.exit(main())
