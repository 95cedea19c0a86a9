"""Counts of a run as a table."""

import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field

from tests.fuzz.trial import Outcome

COLUMNS = ("inputs", "refused", "read", "cleaned", "longest, s", "memory, GB", "problems")


@dataclass
class Tally:
    """What became of the inputs so far."""

    counts: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    longest: Counter[str] = field(default_factory=Counter)
    memory: Counter[str] = field(default_factory=Counter)
    known: int = 0
    began: float = field(default_factory=time.monotonic)

    @property
    def inputs(self) -> int:
        """New inputs so far."""
        return sum(count["inputs"] for count in self.counts.values())

    @property
    def denoised(self) -> int:
        """Inputs that were cleaned to the end."""
        return sum(count["cleaned"] for count in self.counts.values())

    @property
    def problems(self) -> int:
        """Inputs that did harm."""
        return sum(count["problems"] for count in self.counts.values())

    def add_known(self, name: str, outcome: Outcome) -> None:
        """Count an input of the corpus."""
        self.known += 1
        if outcome.problem:
            self.counts["corpus"]["problems"] += 1
            tell(name, outcome)

    def add(self, outcome: Outcome) -> None:
        """Count a new input."""
        kind, code = outcome.case.target.kind, outcome.ended.code
        counted = self.counts[kind]
        counted["inputs"] += 1
        if outcome.problem:
            counted["problems"] += 1
            tell(f"{outcome.case.target.name} {outcome.case.file}", outcome)
        elif code == 2:
            counted["refused"] += 1
        else:
            counted["cleaned" if outcome.denoised else "read"] += 1
        self.longest[kind] = max(self.longest[kind], outcome.ended.seconds)
        self.memory[kind] = max(self.memory[kind], outcome.ended.peak / 1e9)

    def lines(self, seed: int) -> Iterator[str]:
        """The table in Markdown."""
        yield f"| files | {' | '.join(COLUMNS)} |"
        yield f"|---|{'--:|' * len(COLUMNS)}"
        kinds = sorted(kind for kind in self.counts if kind != "corpus")
        for kind in kinds:
            yield self.row(kind, self.counts[kind], self.longest[kind], self.memory[kind])
        total: Counter[str] = sum(self.counts.values(), Counter())
        worst = (max(values.values(), default=0) for values in (self.longest, self.memory))
        yield self.row("all", total, *worst)
        took = (time.monotonic() - self.began) / 60
        yield f"\nseed {seed}, {self.known} inputs of the corpus before, {took:.0f} minutes"

    def row(self, name: str, counted: Counter[str], seconds: float, memory: float) -> str:
        """One row of it."""
        cells = [f"{counted[c]:,}" for c in COLUMNS[:4]] + [f"{seconds:.1f}", f"{memory:.2f}"]
        return f"| {name} | {' | '.join(cells)} | {counted['problems']:,} |"


def tell(name: str, outcome: Outcome) -> None:
    """Say at once what an input did."""
    said = outcome.ended.said.strip()[-600:]
    print(f"{name}: {outcome.problem}\n{said}\n", flush=True)
