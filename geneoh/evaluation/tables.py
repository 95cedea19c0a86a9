"""From scores to tables: means over clips, deviations over seeds, intervals, ranks."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import sqrt
from statistics import fmean, stdev

from scipy.stats import kendalltau, t

from geneoh.evaluation.protocols.clips import recording_of
from geneoh.evaluation.scores import COLUMNS, MEASURES, Measure, Score

LEVEL = 0.95  # confidence level of intervals
FEWEST = 8  # recordings below which there is no interval: too few to tell how they scatter


@dataclass(frozen=True)
class Cell:
    """One measure of one method under one noise."""

    mean: float
    """Mean over clips, then over seeds."""
    deviation: float | None
    """Of the mean over clips, over seeds; None with one seed."""
    low: float | None
    """Lower end of the mean's 95% interval over recordings; None with fewer than `FEWEST`."""
    high: float | None
    """Upper end of that interval."""
    count: int
    """Number of cases with a value."""

    def shown(self, measure: Measure) -> str:
        """Mean, and deviation over seeds if there is one, with the measure's digits."""
        mean = f"{self.mean:.{measure.digits}f}"
        return mean if self.deviation is None else f"{mean}±{self.deviation:.{measure.digits}f}"


@dataclass(frozen=True)
class TableBlock:
    """The methods under one noise of a data set, in the order in which they were asked for."""

    dataset: str
    noise: str
    clips: int
    seeds: int
    cells: dict[str, dict[str, Cell]]
    """By method, then by measure; only with a value."""
    failed: dict[str, int]
    """Number of cases without a result, for the methods that have such cases."""

    @property
    def measures(self) -> tuple[Measure, ...]:
        """The columns in which any method has a value."""
        there = {key for cells in self.cells.values() for key in cells}
        return tuple(measure for measure in COLUMNS if measure.key in there)

    @property
    def title(self) -> str:
        """Data set, noise, and number of clips and seeds."""
        clips = f"{self.clips} clip{'s' * (self.clips > 1)}"
        return f"{self.dataset}, {self.noise}: {clips}, {self.seeds} seed{'s' * (self.seeds > 1)}"

    def column(self, measure: Measure) -> list[tuple[str, bool]]:
        """Text of a measure for every method, and whether it is the best as it is shown."""
        cells = [found.get(measure.key) for found in self.cells.values()]
        means = [cell and round(cell.mean, measure.digits) for cell in cells]
        pick = min if measure.better == "less" else max
        best = pick((mean for mean in means if mean is not None), default=None)
        return [
            ("n/a", False) if cell is None else (cell.shown(measure), mean == best)
            for cell, mean in zip(cells, means, strict=True)
        ]

    def lines(self, measures: Sequence[Measure]) -> Iterator[tuple[str, list[tuple[str, bool]]]]:
        """A line for each method: its name, and its texts in the columns of these measures."""
        columns = [self.column(measure) for measure in measures]
        for index, method in enumerate(self.cells):
            missing = self.failed.get(method, 0)
            name = f"{method} ({missing} failed)" if missing else method
            yield name, [column[index] for column in columns]

    def gaps(self) -> Iterator[str]:
        """Which means are over fewer cases than others, as those of a slip without any touch."""
        for measure in self.measures:
            few = []
            for method, cells in self.cells.items():
                cases = self.clips * self.seeds - self.failed.get(method, 0)
                if (cell := cells.get(measure.key)) is not None and cell.count < cases:
                    few.append(f"{cell.count} of {cases} with {method}")
            if few:
                yield (
                    f"{measure.title} under {self.noise} is a mean over fewer cases, because the "
                    f"others have nothing to measure: {', '.join(few)}."
                )


def blocks_of(scores: Iterable[Score], methods: Sequence[str]) -> list[TableBlock]:
    """A block for each data set and noise; methods without any score are left out."""
    places: dict[tuple[str, str], list[Score]] = {}
    for score in scores:
        places.setdefault((score.dataset, score.noise), []).append(score)
    return [block_of(*place, found, methods) for place, found in places.items()]


def block_of(dataset: str, noise: str, scores: list[Score], methods: Sequence[str]) -> TableBlock:
    """The table of one noise."""
    cells: dict[str, dict[str, Cell]] = {}
    failed: dict[str, int] = {}
    for method in methods:
        made = [score for score in scores if score.method == method]
        if not made:
            continue
        found = {measure.key: cell_of(made, measure.key) for measure in MEASURES}
        cells[method] = {key: cell for key, cell in found.items() if cell is not None}
        if count := sum(bool(score.failed) for score in made):
            failed[method] = count
    clips, seeds = ({getattr(score, name) for score in scores} for name in ("clip", "seed"))
    return TableBlock(dataset, noise, len(clips), len(seeds), cells, failed)


def cell_of(scores: list[Score], key: str) -> Cell | None:
    """One measure over clips and seeds; None without any value."""
    values = [
        (score.clip, score.seed, value)
        for score in scores
        if (value := score.values.get(key)) is not None
    ]
    if not values:
        return None
    by_recording = grouped((recording_of(clip), value) for clip, _, value in values)
    by_seed = [fmean(group) for group in grouped((seed, value) for _, seed, value in values)]
    low, high = recordings_interval(by_recording)
    deviation = stdev(by_seed) if len(by_seed) > 1 else None
    return Cell(fmean(by_seed), deviation, low, high, count=len(values))


def grouped(values: Iterable[tuple[object, float]]) -> list[list[float]]:
    """The values of each group, groups in the order in which they appear."""
    groups: dict[object, list[float]] = {}
    for group, value in values:
        groups.setdefault(group, []).append(value)
    return list(groups.values())


def recordings_interval(recordings: Sequence[Sequence[float]]) -> tuple[float | None, float | None]:
    """Interval of the mean of all values, by how recordings as a whole scatter about it.

    Values of one recording, its windows and seeds, are not independent. A mean of groups is a ratio
    of two sums, so its error is that of the sums' differences from it, by Student's t. None with
    fewer recordings than `FEWEST`.
    """
    count, size = len(recordings), sum(map(len, recordings))
    if count < FEWEST:
        return None, None
    mean = sum(map(sum, recordings)) / size
    squares = sum((sum(values) - mean * len(values)) ** 2 for values in recordings)
    half = float(t.ppf((1 + LEVEL) / 2, count - 1)) * sqrt(squares * count / (count - 1)) / size
    return mean - half, mean + half


def seed_agreement(scores: Iterable[Score]) -> float | None:
    """Kendall's tau of how two seeds rank the methods by MPJPE: the least over pairs of seeds.

    1 means the same order. None with fewer than two seeds or methods that have the measure, or if a
    seed ranks all alike.
    """
    by_seed: dict[int, dict[str, list[float]]] = {}
    for score in scores:
        if (value := score.values.get("mpjpe_mm")) is not None:
            by_seed.setdefault(score.seed, {}).setdefault(score.method, []).append(value)
    taus = []
    for first, second in combinations(by_seed.values(), 2):
        both = [method for method in first if method in second]
        if len(both) > 1:
            ranked = ([fmean(values[method]) for method in both] for values in (first, second))
            tau, _ = kendalltau(*ranked)
            taus.append(float(tau))  # pyright: ignore[reportArgumentType]  # scipy gives no types
    return min((tau for tau in taus if tau == tau), default=None)


def as_text(blocks: Iterable[TableBlock]) -> Iterator[str]:
    """The tables for a terminal."""
    for block in blocks:
        yield block.title
        heads = ["", *(f"{measure.title} {measure.unit}" for measure in block.measures)]
        rows = block.lines(block.measures)
        lines = [[name, *(text for text, _ in cells)] for name, cells in rows]
        widths = [max(map(len, column)) for column in zip(heads, *lines, strict=True)]
        for name, *cells in [heads, *lines]:
            padded = [f"  {cell:>{width}}" for cell, width in zip(cells, widths[1:], strict=True)]
            yield f"{name:<{widths[0]}}" + "".join(padded)
        yield ""


def as_markdown(blocks: Iterable[TableBlock]) -> Iterator[str]:
    """One table of all blocks for a README, the best of each column and noise in bold."""
    blocks = list(blocks)
    there = {measure.key for block in blocks for measure in block.measures}
    measures = [measure for measure in COLUMNS if measure.key in there]
    heads = [f"{measure.title}, {measure.unit}" for measure in measures]
    yield "| " + " | ".join(["noise", "method", *heads]) + " |"
    yield "|---|---|" + "---:|" * len(heads)
    for block in blocks:
        noise = f"{block.dataset}, {block.noise}"
        for name, cells in block.lines(measures):
            texts = [f"**{text}**" if best else text for text, best in cells]
            yield "| " + " | ".join([noise, name, *texts]) + " |"
            noise = ""
