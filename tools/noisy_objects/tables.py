"""Which cases each table needs, and its lines."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np

from geneoh.choices import NOISES, OBJECT_NOISES
from tools.noisy_objects.cases import Case, Scores, rows
from tools.noisy_objects.clips import (
    BESIDE,
    BOXED,
    FILMED,
    HOVERING,
    HULL,
    LARGE,
    MADE,
    RECORDING,
    ROUND,
    ROUND_SCANS,
    SHAKEN,
    SPINS,
    TRACKED,
    TRAY,
    WALKED,
    CoveredNoise,
    Gap,
    Stuck,
    WhiteNoise,
)
from tools.noisy_objects.filters import ObjectFilter

KINDS = ("exact", *OBJECT_NOISES)
HAND = ("result", "result acceleration")


CLIPS = (RECORDING, *MADE)
HAND_NOISES = ("clean", *NOISES)
SHAKES = ("exact", "shaky_2", "shaky_10")
BESIDE_CLIPS = tuple(BESIDE + name for name in CLIPS)
HOVERING_CLIPS = tuple(HOVERING + name for name in (RECORDING, "drawer", "bottle"))
FILMED_CLIPS = tuple(
    before + name for name in (RECORDING, "mug", "bottle", "pan") for before in ("", FILMED)
)
TRACKED_CLIPS = tuple(TRACKED + name for name in (RECORDING, "mug", "bottle", "pan"))
FILMED_NOISES = ("clean", "gauss", "beta", "bias")
LASTING_NOISES = (*FILMED_NOISES, "camera")
LARGE_CLIPS = tuple(before + name for name in CLIPS for before in ("", LARGE))
WALKED_CLIPS = tuple(before + name for name in CLIPS for before in ("", WALKED))
ENCLOSED = (*CLIPS, ROUND_SCANS[1])
ENCLOSED_CLIPS = tuple(before + name for name in ENCLOSED for before in ("", HULL, BOXED))
USUAL: dict[str, Any] = {"preset": "default"}
Grid = tuple[Sequence[str], Sequence[Any], Sequence[Any], dict[str, Any]]
GRIDS: dict[str, Grid] = {
    "hands": ((RECORDING,), ("clean", "gauss", "camera"), KINDS, USUAL),
    "trusted": (
        (RECORDING,),
        ("clean", "gauss"),
        ("shaky_2", "shaky_10", "flips"),
        USUAL | {"trusted": True},
    ),
    "guard": (CLIPS, HAND_NOISES, KINDS, {}),
    "shaken": (tuple(SHAKEN + name for name in CLIPS), HAND_NOISES, SHAKES, {}),
    "beside": (BESIDE_CLIPS, HAND_NOISES, ("exact", "shaky_10"), {}),
    "hovering": (HOVERING_CLIPS, HAND_NOISES, ("exact", "shaky_10"), {}),
    "filmed": (FILMED_CLIPS, FILMED_NOISES, ("exact", "shaky_2"), {}),
    "tracked": (TRACKED_CLIPS, FILMED_NOISES, ("exact", "shaky_2"), {}),
    "filmed_trusted": (FILMED_CLIPS, FILMED_NOISES, ("exact",), {"trusted": True}),
    "large": (LARGE_CLIPS, LASTING_NOISES, ("exact",), {}),
    "enclosed": (ENCLOSED_CLIPS, LASTING_NOISES, ("exact",), {}),
    "enclosed_trusted": (ENCLOSED_CLIPS, LASTING_NOISES, ("exact",), {"trusted": True}),
    "covered": (CLIPS, LASTING_NOISES, ("exact", *get_args(CoveredNoise)), {}),
    "gaps": (CLIPS, LASTING_NOISES, ("exact", *get_args(Gap)), {}),
    "stuck": (CLIPS, ("clean", "gauss", "camera"), ("exact", *get_args(Stuck)), {}),
    "tray": (tuple(TRAY + name for name in CLIPS), LASTING_NOISES, ("exact",), {}),
    "walked": (WALKED_CLIPS, LASTING_NOISES, ("exact",), {"alone": True}),
    "round": ((*ROUND, *ROUND_SCANS), ("gauss",), ("exact", "flips", SPINS), {}),
    "refined": (CLIPS, ("gauss",), OBJECT_NOISES, {}),
    "white": (CLIPS, ("gauss",), get_args(WhiteNoise), {}),
    "filtered": (CLIPS, ("clean", "burst", "gauss"), ("exact", *get_args(ObjectFilter)), {}),
    "alone": (CLIPS[:2], HAND_NOISES, ("exact",), USUAL | {"alone": True}),
}
"""Clips, noises of the hand, noises of the object and other fields of the cases of each table."""
TABLES = (*GRIDS, "limits")


def cases_of(table: str, seeds: int) -> list[Case]:
    """The cases of a table, those of the first seed first."""
    if table not in GRIDS:
        raise SystemExit(f"no table is called '{table}'; there are {', '.join(TABLES)}")
    clips, noises, kinds, how = GRIDS[table]
    every = product(range(seeds), clips, noises, kinds)
    return [Case(c, n, k, s, **how) for s, c, n, k in every]


def lines_of(table: str, seeds: int, path: Path) -> Iterator[str]:
    """The lines of a table, after all of its cases have been measured."""
    found: dict[tuple[str, str, str], list[Scores]] = defaultdict(list)
    for case, scores in rows(cases_of(table, seeds), path):
        found[case.clip, case.noise, case.kind].append(scores)
    if table in ("refined", "white"):
        yield from lines_of_objects(found)
        return
    if table == "stuck":
        yield from lines_of_stuck(found)
        return
    if table == "filtered":
        yield from lines_of_filters(found)
        return
    kinds = list(dict.fromkeys(kind for _, _, kind in found))
    yield f"| clip | noise | input | filter | {' | '.join(kinds)} |"
    yield "|---" * (4 + len(kinds)) + "|"
    for clip, noise in dict.fromkeys(key[:2] for key in found):
        first = found[clip, noise, kinds[0]]
        cells = [cell(first, name, f"{name} acceleration") for name in ("input", "filter")]
        cells += [cell(found[clip, noise, kind], *HAND) for kind in kinds]
        yield f"| {clip} | {noise} | {' | '.join(cells)} |"


def lines_of_filters(found: dict[tuple[str, str, str], list[Scores]]) -> Iterator[str]:
    """Scores of input, filter and result for each filter on the hand or on the object."""
    yield "| clip | noise | filtered | input | filter | result |"
    yield "|---" * 6 + "|"
    for (clip, noise, kind), scores in found.items():
        cells = [cell(scores, n, f"{n} acceleration") for n in ("input", "filter", "result")]
        yield f"| {clip} | {noise} | {kind} | {' | '.join(cells)} |"


def lines_of_stuck(found: dict[tuple[str, str, str], list[Scores]]) -> Iterator[str]:
    """Errors of hands as input, filtered and cleaned, and of objects as input and refined."""
    yield "| clip | noise | poses | input | filter | result | object input | refined |"
    yield "|---" * 8 + "|"
    for (clip, noise, kind), scores in found.items():
        names = ["input", "filter", "result"]
        names += ["object input", "object refined"] if kind.startswith("stuck") else []
        cells = [cell(scores, name) for name in names]
        cells += [""] * (5 - len(cells))
        yield f"| {clip} | {noise} | {kind} | {' | '.join(cells)} |"


def cell(found: list[Scores], *names: str) -> str:
    """The means of some scores over the seeds."""
    return " / ".join(f"{np.mean([scores[name] for scores in found]):.1f}" for name in names)


def lines_of_objects(found: dict[tuple[str, str, str], list[Scores]]) -> Iterator[str]:
    """Errors of objects as input, smoothed and refined, and of hands relative to them."""
    names = "clip hand object input smoothed refined ratio lost hand ratio"
    yield f"| {' | '.join(names.split())} |"
    yield "|---" * 10 + "|"
    for (clip, noise, kind), scores in found.items():
        names = ("object input", "object smooth", "object refined")
        cells = [cell(scores, name) for name in names]
        cells.append(ratio(scores, "object refined", "object input"))
        lost = [s for s in scores if "object refined lost" in s]
        cells.append(cell(lost, "object refined lost") if lost else "")
        cells.append(cell(scores, "relative refined"))
        cells.append(ratio(scores, "relative refined", "relative input"))
        yield f"| {clip} | {noise} | {kind} | {' | '.join(cells)} |"


def ratio(found: list[Scores], upper: str, lower: str) -> str:
    """One mean over the other."""
    return f"{np.mean([s[upper] for s in found]) / np.mean([s[lower] for s in found]):.2f}"
