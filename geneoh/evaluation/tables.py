"""From scores to tables: means over clips, their spread over seeds, intervals, ranks."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

import numpy as np

from geneoh.evaluation.scores import COLUMNS, MEASURES, Measure, Score

RESAMPLES = 2000
"""Of the bootstrap."""
LEVEL = 0.95
"""Of its intervals."""


@dataclass(frozen=True)
class Cell:
    """One measure of one row under one noise."""

    mean: float
    """Over clips, then over seeds."""
    spread: float | None
    """Standard deviation over seeds of the mean over clips; None with one seed."""
    low: float | None
    """Bootstrap interval of the mean, over clips, or over seeds where there is one clip."""
    high: float | None
    count: int
    """Cases that it is made of."""


@dataclass(frozen=True)
class Block:
    """The rows under one noise of a data set, in the order in which they were asked for."""

    dataset: str
    noise: str
    clips: int
    seeds: int
    rows: dict[str, dict[str, Cell]]
    """By row, then by measure; measures without any value are left out."""
    failed: dict[str, int]
    """Cases on which a row has nothing to show."""

    @property
    def measures(self) -> tuple[Measure, ...]:
        """Those that any row has."""
        there = {key for cells in self.rows.values() for key in cells}
        return tuple(measure for measure in COLUMNS if measure.key in there)

    @property
    def title(self) -> str:
        """What the numbers are made of."""
        clips = f"{self.clips} clip{'s' if self.clips > 1 else ''}"
        return f"{self.dataset}, {self.noise}: {clips}, {self.seeds} seed{'s' * (self.seeds > 1)}"

    def best(self, measure: Measure) -> float:
        """The best mean of a column, rounded as it is shown."""
        means = [
            round(cells[measure.key].mean, measure.digits)
            for cells in self.rows.values()
            if measure.key in cells
        ]
        return min(means) if measure.better == "less" else max(means)


def blocks_of(scores: Iterable[Score], rows: Sequence[str]) -> list[Block]:
    """A block for each data set and noise; rows that have no score at all are left out."""
    scores = list(scores)
    places = dict.fromkeys((score.dataset, score.noise) for score in scores)
    return [
        block_of(
            dataset, noise, [s for s in scores if (s.dataset, s.noise) == (dataset, noise)], rows
        )
        for dataset, noise in places
    ]


def block_of(dataset: str, noise: str, scores: list[Score], rows: Sequence[str]) -> Block:
    """The table of one noise."""
    cells: dict[str, dict[str, Cell]] = {}
    failed: dict[str, int] = {}
    for row in rows:
        made = [score for score in scores if score.row == row]
        if not made:
            continue
        found = {measure.key: cell_of(made, measure.key) for measure in MEASURES}
        cells[row] = {key: cell for key, cell in found.items() if cell is not None}
        if count := sum(bool(score.failed) for score in made):
            failed[row] = count
    clips, seeds = ({getattr(s, name) for s in scores} for name in ("clip", "seed"))
    return Block(dataset, noise, len(clips), len(seeds), cells, failed)


def cell_of(scores: list[Score], key: str) -> Cell | None:
    """One measure over clips and seeds; None without any value."""
    values = {
        (score.clip, score.seed): value
        for score in scores
        if (value := score.values.get(key)) is not None
    }
    if not values:
        return None
    by_seed = means_by(values, 1)
    by_clip = means_by(values, 0)
    spread = stdev(by_seed) if len(by_seed) > 1 else None
    low, high = interval(by_clip if len(by_clip) > 1 else by_seed)
    return Cell(fmean(by_seed), spread, low, high, len(values))


def means_by(values: dict[tuple[str, int], float], part: int) -> list[float]:
    """Means over all values that share their clip (part 0) or their seed (part 1)."""
    groups: dict[object, list[float]] = {}
    for key, value in values.items():
        groups.setdefault(key[part], []).append(value)
    return [fmean(group) for group in groups.values()]


def interval(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Bootstrap percentile interval of a mean, the same at every call; None for a single value."""
    if len(values) < 2:
        return None, None
    pick = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    means = np.asarray(values)[pick].mean(1)
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


def agreement(scores: Iterable[Score], key: str = "mpjpe_mm") -> float | None:
    """How alike the seeds rank the rows: Kendall's tau, the least over pairs of seeds; 1 is alike.

    None where there are fewer than two seeds or rows with that measure.
    """
    ranks: dict[int, dict[str, float]] = {}
    scores = list(scores)
    for seed in sorted({score.seed for score in scores}):
        of_seed: dict[str, list[float]] = {}
        for score in scores:
            if score.seed == seed and (value := score.values.get(key)) is not None:
                of_seed.setdefault(score.row, []).append(value)
        ranks[seed] = {row: fmean(values) for row, values in of_seed.items()}
    seeds = list(ranks)
    taus = [
        tau
        for i, first in enumerate(seeds)
        for second in seeds[i + 1 :]
        if (tau := kendall(ranks[first], ranks[second])) is not None
    ]
    return min(taus, default=None)


def kendall(first: dict[str, float], second: dict[str, float]) -> float | None:
    """Pairs in the same order less pairs in another, over all pairs, of what both rank."""
    names = [name for name in first if name in second]
    signs = [
        np.sign(first[a] - first[b]) * np.sign(second[a] - second[b])
        for i, a in enumerate(names)
        for b in names[i + 1 :]
    ]
    return float(np.mean(signs)) if signs else None


def shown(cell: Cell | None, measure: Measure) -> str:
    """Mean, and spread over seeds where there is one."""
    if cell is None:
        return "n/a"
    spread = "" if cell.spread is None else f"±{cell.spread:.{measure.digits}f}"
    return f"{cell.mean:.{measure.digits}f}{spread}"


def named(block: Block, row: str) -> str:
    """A row's name, with how many cases it has nothing for."""
    missing = block.failed.get(row, 0)
    return f"{row} ({missing} failed)" if missing else row


def as_text(blocks: Iterable[Block]) -> Iterator[str]:
    """For a terminal."""
    for block in blocks:
        yield block.title
        names = [named(block, row) for row in block.rows]
        width = max(len(name) for name in names)
        heads = [f"{measure.title} {measure.unit}" for measure in block.measures]
        columns = [
            [shown(cells.get(measure.key), measure) for cells in block.rows.values()]
            for measure in block.measures
        ]
        widths = [max(map(len, [head, *cells])) for head, cells in zip(heads, columns, strict=True)]
        yield " " * width + "".join(
            f"  {head:>{size}}" for head, size in zip(heads, widths, strict=True)
        )
        for index, name in enumerate(names):
            cells = (
                f"  {column[index]:>{size}}" for column, size in zip(columns, widths, strict=True)
            )
            yield f"{name:<{width}}" + "".join(cells)
        yield ""


def as_markdown(blocks: Iterable[Block]) -> Iterator[str]:
    """For a README: one table, the best mean of each column and noise in bold."""
    blocks = list(blocks)
    there = {measure.key for block in blocks for measure in block.measures}
    measures = [measure for measure in COLUMNS if measure.key in there]
    heads = [f"{measure.title}, {measure.unit}" for measure in measures]
    yield "| " + " | ".join(["noise", "row", *heads]) + " |"
    yield "|---|---|" + "---:|" * len(heads)
    for block in blocks:
        for index, (row, cells) in enumerate(block.rows.items()):
            noise = f"{block.dataset}, {block.noise}" if index == 0 else ""
            line = [noise, named(block, row)]
            for measure in measures:
                cell = cells.get(measure.key)
                text = shown(cell, measure)
                if cell is not None and round(cell.mean, measure.digits) == block.best(measure):
                    text = f"**{text}**"
                line.append(text)
            yield "| " + " | ".join(line) + " |"
