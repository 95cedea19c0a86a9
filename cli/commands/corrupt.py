"""`geneoh corrupt`: a noisy twin of a clean sequence, to try a cleaner on."""

from pathlib import Path
from typing import Any

import click

from geneoh.choices import NOISES

from .. import options


@click.command()
@click.argument("clean", type=options.INPUT_FILE)
@click.option("--noise", type=click.Choice(NOISES), required=True, help="Kind of noise.")
@options.seed
@options.side
@options.fps
@options.output
def corrupt(
    clean: Path, noise: Any, seed: int, side: Any, fps: float | None, output: Path | None
) -> None:
    """Add noise to a clean sequence, as hand trackers make it.

    CLEAN is an npz in any layout that geneoh reads; its object is kept. Writes CLEAN with the
    noise's name before its ending, unless -o says otherwise.
    """
    import torch

    from geneoh.readers.npz_files import load_sequence, save_sequence
    from geneoh.sequence.noise import corrupt_sequence

    sequence = load_sequence(clean, side=side, fps=fps)
    noisy = corrupt_sequence(sequence, noise, generator=torch.Generator().manual_seed(seed))
    output = output or clean.with_name(f"{clean.stem}_{noise}{clean.suffix}")
    save_sequence(noisy, output)
    click.echo(f"{output}: {noisy.frames} frames with {noise} noise, seed {seed}")
