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
FEWEST_RECORDINGS = 8  # for an interval: fewer do not show the variance


@dataclass(frozen=True)
class Cell:
    """One measure of one method under one noise."""

    mean: float
    """Mean over clips, then over seeds."""
    deviation: float | None
    """Standard deviation over seeds of the mean over clips; None with one seed."""
    low: float | None
    """Lower bound of the mean's 95% interval; None below `FEWEST_RECORDINGS`."""
    high: float | None
    """Upper bound of that interval."""
    count: int
    """Number of cases with a value."""

    @property
    def ends(self) -> tuple[float, float] | None:
        """Ends of an error bar: the interval, whose middle differs from the mean where seeds have
        unequal numbers of values, or else the deviation; None without either."""
        if self.low is not None and self.high is not None:
            return self.low, self.high
        spread = self.deviation
        return None if spread is None else (self.mean - spread, self.mean + spread)

    def shown(self, measure: Measure) -> str:
        """Mean ± deviation over seeds (if there is one), rounded to the measure's digits."""
        mean = f"{self.mean:.{measure.digits}f}"
        return mean if self.deviation is None else f"{mean}±{self.deviation:.{measure.digits}f}"


@dataclass(frozen=True)
class TableBlock:
    """The table of one noise of a data set, with methods in the requested order."""

    dataset: str
    noise: str
    clips: int
    seeds: int
    cells: dict[str, dict[str, Cell]]
    """By method, then by measure; measures without a value are missing."""
    failed: dict[str, int]
    """Number of failed cases, by method; only of methods with any."""

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
        """Text of a measure for every method, and whether its rounded value is the best."""
        cells = [found.get(measure.key) for found in self.cells.values()]
        means = [cell and round(cell.mean, measure.digits) for cell in cells]
        pick = min if measure.better == "less" else max
        best = pick((mean for mean in means if mean is not None), default=None)
        return [
            ("n/a", False) if cell is None else (cell.shown(measure), mean == best)
            for cell, mean in zip(cells, means, strict=True)
        ]

    def lines(self, measures: Sequence[Measure]) -> Iterator[tuple[str, list[tuple[str, bool]]]]:
        """One line per method: its name, and its cells (text, is best) of these measures."""
        columns = [self.column(measure) for measure in measures]
        for index, method in enumerate(self.cells):
            missing = self.failed.get(method, 0)
            name = f"{method} ({missing} failed)" if missing else method
            yield name, [column[index] for column in columns]

    def gaps(self) -> Iterator[str]:
        """Remarks on means over fewer cases than others, such as slip where nothing touches."""
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
    """One table for each data set and noise; methods without any score are left out."""
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
    """Statistics of one measure of one method over clips and seeds; None without any value."""
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
    """The values of each group, in the order in which the groups first appear."""
    groups: dict[object, list[float]] = {}
    for group, value in values:
        groups.setdefault(group, []).append(value)
    return list(groups.values())


def recordings_interval(recordings: Sequence[Sequence[float]]) -> tuple[float | None, float | None]:
    """95% interval of the mean of all values, with recordings as independent clusters.

    Windows and seeds of one recording are not independent. The mean is a ratio estimator (sum of
    values over their number), whose variance follows from the residual sums of the recordings; the
    interval uses Student's t. None with fewer recordings than `FEWEST_RECORDINGS`.
    """
    count, size = len(recordings), sum(map(len, recordings))
    if count < FEWEST_RECORDINGS:
        return None, None
    mean = sum(map(sum, recordings)) / size
    squares = sum((sum(values) - mean * len(values)) ** 2 for values in recordings)
    half = float(t.ppf((1 + LEVEL) / 2, count - 1)) * sqrt(squares * count / (count - 1)) / size
    return mean - half, mean + half


def seed_agreement(scores: Iterable[Score]) -> float | None:
    """Smallest Kendall's tau, over pairs of seeds, of the ranks of the methods by MPJPE.

    1 means the same order. None with fewer than two seeds or methods with an MPJPE, or if a seed
    ranks all methods equal.
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
    """One Markdown table of all blocks, with the best of each column and noise in bold."""
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
