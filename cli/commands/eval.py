"""`geneoh eval`: how far each way of cleaning gets on noisy twins of a recording."""

from pathlib import Path
from typing import Any

import click

from .. import options

FILES = {"taco": ("taco_clean.npz", "taco_object.obj")}
"""Track and mesh of each recording that can be scored, inside --root."""
NOISES = ("clean", "gauss", "gauss_strong", "beta", "bias", "drift", "burst", "drop")


@click.command()
@click.option("--dataset", type=click.Choice(sorted(FILES)), required=True, help="Recording.")
@click.option(
    "--root",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("examples"),
    show_default=True,
    help="Folder with the recording's track and mesh.",
)
@click.option(
    "--noise",
    "noises",
    type=click.Choice(NOISES),
    multiple=True,
    default=("gauss", "beta"),
    show_default=True,
    help="Kind of noise, may be repeated; clean is the recording itself.",
)
@click.option(
    "--seeds", type=click.IntRange(min=1), default=5, show_default=True, help="Per noise."
)
@click.option(
    "--twins",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of stored twins NOISE_SEED.npz; they are drawn afresh otherwise.",
)
@click.option(
    "--preset",
    "presets",
    type=click.Choice(["default", "paper", "fast"]),
    multiple=True,
    default=("default",),
    show_default=True,
    help="Our ways to score, may be repeated.",
)
@options.weights
def eval(
    dataset: str,
    root: Path,
    noises: tuple[Any, ...],
    seeds: int,
    twins: Path | None,
    presets: tuple[Any, ...],
    weights: Path | None,
) -> None:
    """Score the input, the best low-pass filters and geneoh on noisy twins of a recording.

    Prints means and deviations over seeds. The filters' windows are chosen with the ground truth
    in hand, which no user has: a generous baseline.
    """
    import geneoh
    from geneoh.evaluation.compare import compare, drawn_twins, stored_twins, table

    from .. import progress

    track, mesh = FILES[dataset]
    clean = geneoh.load(root / track, obj=root / mesh)
    if twins is None:
        chosen = list(drawn_twins(clean, noises, seeds))
    else:
        chosen = list(stored_twins(clean, twins, noises, seeds))
    ways = [geneoh.Options(preset=preset, weights=weights) for preset in presets]
    with progress.progress_bars() as heard:
        total = len(chosen) * (3 + len(ways))
        done = iter(range(1, total + 1))
        scores = compare(clean, chosen, ways, on_score=lambda _: heard("eval", next(done), total))
    for line in table(scores):
        click.echo(line)
