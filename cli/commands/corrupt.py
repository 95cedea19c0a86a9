"""`geneoh corrupt`: a noisy twin of a clean sequence, to try a cleaner on."""

from pathlib import Path
from typing import Any

import click
from click import Choice

from geneoh.choices import NOISES, OBJECT_NOISES
from geneoh.errors import numbered

from .. import options


@click.command()
@click.argument("clean", type=options.FILE)
@options.option("--noise: Noise on the hand.", Choice(NOISES))
@options.option("--object-noise: Noise on the poses of the object.", Choice(OBJECT_NOISES))
@options.seed
@options.reading
@options.bare
@options.output
def corrupt(
    clean: Path,
    noise: Any,
    object_noise: Any,
    seed: int,
    mano: Path | None,
    output: Path | None,
    overwrite: bool,
    **how: Any,
) -> None:
    """Add noise to a clean sequence, as hand trackers make it.

    CLEAN is an npz in any layout that geneoh reads, or keypoints as npy, JSON or CSV. Its object is
    kept, unless --object-noise asks for noisy poses. Writes an npz named like CLEAN with the names
    of the noises before its ending, unless -o says otherwise.
    """
    import torch

    from geneoh.files.outputs import check_outputs
    from geneoh.readers.npz.files import load, save_sequence
    from geneoh.sequence.noise import corrupt_sequence
    from geneoh.sequence.object_noise import corrupt_object

    if noise is None and object_noise is None:
        raise click.UsageError("Missing option '--noise' or '--object-noise'")
    name = "_".join(kind for kind in (noise, object_noise) if kind)
    output = output or clean.with_name(f"{clean.stem}_{name}.npz")
    check_outputs([output], endings=(".npz",), inputs=[clean], overwrite=overwrite)
    noisy = load(clean, mano_dir=mano, **how)
    generator = torch.Generator().manual_seed(seed)
    if noise is not None:
        noisy = corrupt_sequence(noisy, noise, generator=generator)
    if object_noise is not None:
        noisy = corrupt_object(noisy, object_noise, generator=generator)
    save_sequence(noisy, output)
    if noisy.left_out:
        click.echo(f"note: {noisy.left_out}")
    click.echo(f"{output}: {numbered(noisy.frames, 'frame')} with {name} noise, seed {seed}")
